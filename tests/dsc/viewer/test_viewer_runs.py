"""A kept run in the viewer: all its records, also those that it makes while somebody looks."""

from __future__ import annotations

import os
import shutil
import threading
from typing import Any

import pytest

from dsc import parse_plot
from dsc.dynamic.library import Library
from dsc.events import Event
from dsc.runs.store import RunStore
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from dsc.trace import Record, Trace
from dsc.viewer.record_sources import records_of
from knowledge_base import KnowledgeBase, Schema, StoreError

SCHEMA = Schema.parse("(define (domain d))")

PING = """
plot: ping
receives: {go: }
states:
  a: {on: {go: b}}
  b: {on: {go: e}}
  e: {final: true}
"""


def kept_run(path, halfway) -> list[Any]:
    """Run a plot in a store; `halfway` is called when the first of its two events has been taken."""
    heard: list[Record] = []

    async def main(kb):
        clock = LoopClock()
        trace = Trace(clock.now)
        trace.listen(heard.append)
        store = RunStore(kb, path, {"run": "ping", "seed": 7})
        sequencer = Sequencer(Library([parse_plot(PING)]), kb, [], clock, trace, store=store)
        sequencer.post(Event("go"), after=1.0)
        sequencer.post(Event("go"), after=2.0)
        sequencer.listen(lambda step: halfway() if clock.now() >= 2 else None)  # before this one is kept
        return await sequencer.run("ping")

    with KnowledgeBase.open(SCHEMA, path) as kb:
        assert run_simulated(main(kb)).finished
    return heard


def records(log) -> list[Any]:
    return [log.record(seq) for seq in range(1, len(log) + 1)]


def test_a_run_that_has_ended_is_its_records(tmp_path):
    heard = kept_run(tmp_path / "run.kb", lambda: None)
    with records_of(tmp_path / "run.kb") as log:
        assert not log.live
        assert [record["seq"] for record in records(log)] == [record.seq for record in heard]
        assert [record["type"] for record in records(log)] == [record.type for record in heard]
        assert (log.header["run"], log.header["seed"]) == ("ping", 7)


def test_records_of_a_running_run_are_followed_until_its_end(tmp_path):
    seen: list[tuple[Any, Any, int]] = []

    def halfway() -> None:
        if seen:
            return
        opened = records_of(tmp_path / "run.kb")
        log = opened.__enter__()
        seen.append((opened, log, len(log)))
        assert log.live

    heard = kept_run(tmp_path / "run.kb", halfway)
    ((opened, log, before),) = seen
    over = threading.Event()
    log.on_more(lambda: None if log.live else over.set())
    assert log.live is False or over.wait(timeout=20)
    opened.__exit__(None, None, None)
    assert 0 < before < len(heard)
    assert [record["seq"] for record in records(log)] == [record.seq for record in heard]


def test_a_run_whose_process_was_killed_is_live_only_once_a_program_writes_again(tmp_path):
    killed = tmp_path / "killed"

    def halfway() -> None:
        if not killed.exists():
            shutil.copytree(tmp_path / "run", killed)

    (tmp_path / "run").mkdir()
    kept_run(tmp_path / "run" / "run.kb", halfway)
    lock = killed / "run.kb-lock"
    mark = lock.read_bytes()
    lock.write_bytes(mark.replace(b"%20d" % os.getpid(), b"%20d" % 2**40))  # no machine has so many processes
    with records_of(killed / "run.kb") as log:
        assert not log.live
        assert len(log) > 0
        again = threading.Event()
        log.on_more(lambda: again.set() if log.live else None)
        lock.write_bytes(mark)
        assert again.wait(timeout=20)


def test_a_store_without_a_run_is_shown_as_what_it_knows(tmp_path):
    KnowledgeBase.open(SCHEMA, tmp_path / "plain.kb").close()
    with records_of(tmp_path / "plain.kb") as log:
        assert log.header["store"] is True
    (tmp_path / "other.kb").write_bytes(b"SQLite format 3\0" + bytes(100))
    with pytest.raises(StoreError), records_of(tmp_path / "other.kb"):
        pass
