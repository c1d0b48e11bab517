"""What a store acknowledged outlives `kill -9` of the process that writes it, at whatever moment.

Ten times here; `make kill-kb` does it more often (`KILLS` in the environment).
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from random import Random

import kb_writer
import pytest
from kb_strategies import SCHEMA
from kb_worlds import everything

from knowledge_base import KnowledgeBase

KILLS = int(os.environ.get("KILLS", "10"))


def killed_after(path: Path, durability: str, lines: int) -> int:
    """Let a process write until it has said so many lines, kill it, and tell the last version it acknowledged.

    It goes on writing while its lines are read, so the moment is a random one of its work.
    """
    command = [sys.executable, kb_writer.__file__, str(path), durability]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        heard = [process.stdout.readline() for _ in range(lines)]
        process.kill()
        heard += process.stdout.readlines()  # what it said before it died
    said = [int(line) for line in heard if line.endswith("\n") and line != "open\n"]
    assert "open\n" in heard, "the writer could not open what its predecessor left"
    return said[-1] if said else 0


class Expected:
    """What the store must hold at each version."""

    def __init__(self) -> None:
        self.kb = KnowledgeBase(SCHEMA)

    def at(self, version: int) -> tuple:
        while self.kb.version < version:
            self.kb.apply(kb_writer.change(self.kb.version + 1), author="writer")
        assert self.kb.version == version
        return everything(self.kb)


@pytest.mark.parametrize("durability", ["process", "power"])
def test_nothing_acknowledged_is_lost_and_nothing_is_torn(tmp_path, durability):
    path, random, expected, acknowledged = tmp_path / "world.kb", Random(durability), Expected(), 0  # noqa: S311
    for _ in range(KILLS):
        acknowledged = max(acknowledged, killed_after(path, durability, random.randrange(1, 60)))
        with KnowledgeBase.open(None, path, durability) as kb:
            assert kb.version >= acknowledged
            assert everything(kb) == expected.at(kb.version)
            kept = kb.changes(since=max(0, kb.version - 20))
            assert [c.version for c in kept] == list(range(kb.version - len(kept) + 1, kb.version + 1))
            assert everything(kb) == everything(kb.at(version=kb.version))
            if kb.version:
                first = kb.apply(kb_writer.change(kb.version), author="writer", key=str(kb.version))
                assert first == kept[-1]  # its key is there too, so it is not done again
