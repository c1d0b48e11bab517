"""What a store acknowledged outlives `kill -9` of the process that writes it, at whatever moment.

Ten times here; `make kill-kb` does it more often (`KILLS` in the environment).
"""

from __future__ import annotations

import multiprocessing
import os
from pathlib import Path
from random import Random
from typing import Any

import kb_writer
import pytest
from kb_worlds import everything

from knowledge_base import KnowledgeBase

KILLS = int(os.environ.get("KILLS", "10"))


@pytest.fixture(scope="module")
def processes():
    """Makes processes that have everything imported already."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["kb_writer"])
    return context


def killed_after(processes, path: Path, durability: str, versions: int) -> int:
    """Let a process write until it has acknowledged so many versions, kill it, and tell the last of them.

    It goes on writing while they are read, so the moment is a random one of its work.
    """
    receive, say = processes.Pipe(duplex=False)
    process = processes.Process(target=kb_writer.write, args=(str(path), durability, say))
    process.start()
    say.close()
    last: int = [receive.recv() for _ in range(versions)][-1]
    process.kill()
    try:
        while True:  # what it acknowledged before it died
            last = receive.recv()
    except EOFError:
        receive.close()
    process.join()
    process.close()
    return last


class Expected:
    """What the store must hold at each version."""

    def __init__(self) -> None:
        self.kb = KnowledgeBase(kb_writer.SCHEMA)

    def at(self, version: int) -> tuple[Any, ...]:
        while self.kb.version < version:
            self.kb.apply(kb_writer.change(self.kb.version + 1), author="writer")
        assert self.kb.version == version
        return everything(self.kb)


@pytest.mark.parametrize("durability", ["process", "power"])
def test_nothing_acknowledged_is_lost_and_nothing_is_torn(processes, tmp_path, durability):
    path, random, expected = tmp_path / "world.kb", Random(durability), Expected()  # noqa: S311
    for _ in range(KILLS):
        acknowledged = killed_after(processes, path, durability, random.randrange(1, 80))
        with KnowledgeBase.open(None, path, durability) as kb:
            assert acknowledged <= kb.version <= acknowledged + 1  # one may be written and not yet acknowledged
            assert everything(kb) == expected.at(kb.version)
            kept = kb.changes(since=max(0, kb.version - 20))
            assert [c.version for c in kept] == list(range(kb.version - len(kept) + 1, kb.version + 1))
            assert everything(kb) == everything(kb.at(version=kb.version))
            if kb.version:
                first = kb.apply(kb_writer.change(kb.version), author="writer", key=str(kb.version))
                assert first == kept[-1]  # its key is there too, so it is not done again
