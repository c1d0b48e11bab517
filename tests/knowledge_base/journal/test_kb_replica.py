"""A store that is only read follows its writer; and what waits ends when a knowledge base is closed."""

from __future__ import annotations

import asyncio
import multiprocessing
from typing import Any

import kb_writer
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kb_strategies import SCHEMA, THINGS, deltas, removals
from kb_worlds import PROPERTY, everything, graph_content

from knowledge_base import (
    Change,
    ConditionCancelledError,
    ConflictError,
    Delta,
    Fact,
    HistoryError,
    KnowledgeBase,
    Schema,
    StoreError,
    fact,
)

ON_SHELF = Delta(added=(fact("on", "cup1", "shelf"),))
OFF_SHELF = Delta(removed=(fact("on", "cup1", "shelf"),))


@pytest.fixture
def path(tmp_path):
    return tmp_path / "world.kb"


@pytest.fixture
def writer(path):
    with KnowledgeBase.open(SCHEMA, path) as kb:
        kb.apply(Delta(nodes=THINGS), author="writer")
        yield kb


@pytest.fixture
def replica(writer, path):
    with KnowledgeBase.open(None, path, read_only=True) as kb:
        yield kb


def heard(condition) -> list[Any]:
    told = []
    condition.subscribe(lambda firing: told.append((firing.version, firing.truth)), falls=True)
    return told


def test_a_replica_takes_in_what_was_committed_in_order(writer, replica):
    told: list[Change] = []
    replica.subscribe(told.append)
    fired = heard(replica.install("(on ?x shelf)"))
    made = [writer.apply(delta, author=f"author {i}") for i, delta in enumerate((ON_SHELF, OFF_SHELF, ON_SHELF))]
    assert (replica.version, told, replica.ask("(on cup1 shelf)")) == (1, [], False)
    assert replica.refresh() == replica.version == 4
    assert told == made
    assert [change.time for change in told] == [change.time for change in made]
    assert fired == [(2, True), (3, False), (4, True)]
    assert replica.query("(on ?x shelf)") == [{"x": "cup1"}]
    assert replica.changes(since=1) == made
    assert replica.refresh() == 4
    assert told == made


def test_watches_follow_too(writer, replica):
    async def follow():
        with replica.watch("(on ?x ?y)") as changes:
            writer.apply(ON_SHELF, author="writer")
            replica.refresh()
            return await anext(changes)

    assert asyncio.run(follow()).version == 2


@settings(PROPERTY, max_examples=25)
@given(st.lists(deltas() | removals(), max_size=6), st.sets(st.integers(0, 6)))
def test_a_replica_is_what_its_writer_is(tmp_path_factory, changes, refreshed):
    path = tmp_path_factory.mktemp("kb") / "world.kb"
    with KnowledgeBase.open(SCHEMA, path) as writer, KnowledgeBase.open(None, path, read_only=True) as replica:
        for number, change in enumerate(changes):
            writer.apply(Delta(nodes=THINGS), author="writer")
            writer.apply(change, author="writer")
            if number in refreshed:
                replica.refresh()
                assert everything(replica) == everything(writer)
        replica.refresh()
        assert everything(replica) == everything(writer)
        assert graph_content(replica.graph) == (writer.nodes(), set(writer.facts()), writer.values())


def test_a_replica_can_be_fed_by_sources_of_its_own(writer, replica):
    source = replica.bind_source("weight", "cup1", reference="scale")
    source.update(3)
    writer.apply(Delta(values={fact("weight", "cup1"): 1}), author="writer")
    replica.refresh()
    assert (replica.value("weight", ("cup1",)), replica.values()) == (3, {fact("weight", "cup1"): 1})
    writer.apply(Delta(removed_nodes=("cup1",)), author="writer")
    replica.refresh()
    assert source.closed


def test_refresh_is_refused_for_a_writer_and_in_memory(writer, tmp_path):
    with pytest.raises(ConflictError, match=r"world.kb: version 1 is the newest, as this is the store's only writer"):
        writer.refresh()
    with pytest.raises(ConflictError, match="version 0 is the newest; in memory"):
        KnowledgeBase(SCHEMA).refresh()


def test_nothing_is_taken_in_inside_a_transaction(writer, replica):
    with (
        pytest.raises(ConflictError, match="read_only=True and cannot be changed"),
        replica.transaction(author="me"),
        pytest.raises(ConflictError, match="open in this thread"),
    ):
        replica.refresh()


def test_a_refresh_over_compacted_versions_is_refused(writer, replica):
    writer.apply(ON_SHELF, author="writer")
    writer.apply(OFF_SHELF, author="writer")
    writer.compact()
    with pytest.raises(HistoryError, match="version 1 is no longer kept; the oldest kept is 3"):
        replica.refresh()
    assert replica.version == 1


def test_a_writer_with_a_longer_schema_is_not_followed(path):
    def schema(types):
        return Schema.parse(f"(define (domain d) (:types {types}))")

    with KnowledgeBase.open(schema("cup"), path):
        pass
    with KnowledgeBase.open(None, path, read_only=True) as replica:
        with KnowledgeBase.open(schema("cup can"), path) as writer:
            writer.apply(Delta(nodes={"can1": "can"}), author="writer")
        with pytest.raises(StoreError, match="extended the schema; open the store again"):
            replica.refresh()
        assert (replica.version, replica.nodes()) == (0, {})
    with KnowledgeBase.open(None, path, read_only=True) as again:
        assert again.nodes() == {"can1": "can"}


def test_the_writer_may_be_another_process(path):
    context = multiprocessing.get_context("forkserver")
    asked, answers = context.Pipe()
    process = context.Process(target=kb_writer.write_on_demand, args=(str(path), answers))
    process.start()
    answers.close()
    assert asked.recv() == 0
    told = []
    with KnowledgeBase.open(None, path, read_only=True) as replica:
        replica.subscribe(lambda change: told.append(change.version))
        loud = heard(replica.install("(quiet)"))
        for count in (1, 7, 30):
            asked.send(count)
            version = asked.recv()
            assert replica.refresh() == version
            assert replica.value("time", ()) == version
    asked.send(0)
    process.join()
    assert process.exitcode == 0
    assert told == list(range(1, 39))
    assert loud == [(version, version % 2 == 1) for version in told]


# --- closing


class Clock:
    """Remembers which timers still run."""

    def __init__(self) -> None:
        self.running: set[Any] = set()

    def now(self) -> float:
        return 0.0

    def call_later(self, delay_s, callback):
        timer = Timer(self, callback)
        self.running.add(timer)
        return timer


class Timer:
    def __init__(self, clock, callback) -> None:
        self.clock, self.callback = clock, callback

    def cancel(self) -> None:
        self.clock.running.discard(self)


def test_closing_stops_timers_and_cancels_what_is_installed(writer):
    clock = Clock()
    held = writer.install("(quiet)", hold_s=3, clock=clock)
    told = heard(held)
    writer.apply(Delta(added=(Fact("quiet"),)), author="test")
    (timer,) = clock.running
    writer.close()
    timer.callback()
    assert (clock.running, held.cancelled, told) == (set(), True, [])


def test_closing_ends_waits_and_watches():
    async def wait():
        kb = KnowledgeBase(SCHEMA)
        firing = asyncio.ensure_future(kb.install("(quiet)").wait())
        change = asyncio.ensure_future(anext(kb.watch(), None))
        await asyncio.sleep(0)
        kb.close()
        with pytest.raises(ConditionCancelledError, match=r"\(quiet\) is cancelled"):
            await firing
        return await change

    assert asyncio.run(wait()) is None


def test_closing_closes_sources_and_tells_nobody():
    kb = KnowledgeBase(SCHEMA)
    source = kb.bind_source("time", reference="clock")
    source.update(5)
    told = heard(kb.install("(> (time) 1)"))
    kb.close()
    kb.close()
    assert (source.closed, told) == (True, [])
    with pytest.raises(ConflictError, match="closed"):
        source.update(6)
