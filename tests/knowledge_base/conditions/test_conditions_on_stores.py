"""Conditions and watches on a knowledge base that goes on from a file: where they begin, and writes that fail."""

from __future__ import annotations

import asyncio
from threading import RLock
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kb_random_schemas import brute_witnesses, changes, conditions, languages, parameters
from kb_strategies import SCHEMA, THINGS
from kb_worlds import PROPERTY, Ticks

from knowledge_base import Change, Delta, InputError, KnowledgeBase, Schema, StoreError, fact
from knowledge_base.conditions.notification import Notifier
from knowledge_base.journal.history import MemoryHistory, Version

ON_SHELF = Delta(added=(fact("on", "cup1", "shelf"),))
OFF_SHELF = Delta(removed=(fact("on", "cup1", "shelf"),))


class FullDiskError(Exception):
    pass


@pytest.fixture
def path(tmp_path):
    """A store at version 3: cup1 is on the shelf and weighs 2, nothing else is anywhere."""
    path = tmp_path / "world.kb"
    with opened(path) as kb:
        kb.apply(Delta(nodes=THINGS), author="test")
        kb.apply(ON_SHELF, author="test")
        kb.apply(Delta(values={fact("weight", "cup1"): 2}), author="test")
    return path


def opened(path, **how) -> KnowledgeBase:
    return KnowledgeBase.open(SCHEMA, path, clock=Ticks(), **how)


def heard(condition) -> list[Any]:
    """What a listener is told from now on, falls too: the version, and whether it is true."""
    told = []
    condition.subscribe(lambda firing: told.append((firing.version, firing.truth)), falls=True)
    return told


def fail(connection) -> None:
    raise FullDiskError


def test_conditions_on_a_reopened_store_begin_with_its_world_and_version(path):
    with opened(path) as kb:
        true, false = kb.install("(on ?x shelf)"), kb.install("(on ?x home)")
        assert (true.truth, true.witness, true.version) == (True, {"x": "cup1"}, 3)
        assert (false.truth, false.witness, false.version) == (False, None, 3)


def test_conditions_on_a_reopened_store_count_its_versions_on(path):
    with opened(path) as kb:
        condition = kb.install("(and (on ?x shelf) (> (weight ?x) 1))")
        told = heard(condition)
        kb.apply(OFF_SHELF, author="test")
        kb.apply(ON_SHELF, author="test")
        kb.apply(Delta(removed_nodes=("cup1",)), author="test")
        assert told == [(4, False), (5, True), (6, False)]
        assert condition.version == kb.version == 6


def test_the_numbers_of_a_thing_that_was_in_the_file_go_with_it(path):
    with opened(path) as kb:
        light = kb.install("(not (> (weight ?x) 1))", {"x": "cup1"})
        told = heard(light)
        kb.apply(Delta(removed_nodes=("cup1",)), author="test")
        assert told == [(4, True)]


def test_constants_that_a_longer_schema_brings_are_there_when_conditions_are_installed(tmp_path):
    def schema(constants: str) -> Schema:
        return Schema.parse(f"(define (domain d) (:types place) (:constants {constants} - place))")

    with KnowledgeBase.open(schema("home"), tmp_path / "world.kb"):
        pass
    with KnowledgeBase.open(schema("home work"), tmp_path / "world.kb") as kb:
        condition = kb.install("(exists (?p ?q - place) (not (= ?p ?q)))")
        assert (condition.truth, condition.version) == (True, 1)


def test_a_world_that_was_read_from_json_goes_on_at_its_version(path):
    with opened(path) as kb:
        copy = KnowledgeBase.from_json(kb.to_json())
    condition = copy.install("(on ?x shelf)")
    told = heard(condition)
    assert (condition.truth, condition.version) == (True, 3)
    copy.apply(OFF_SHELF, author="test")
    assert told == [(4, False)]


@pytest.mark.parametrize(
    "delta", [OFF_SHELF, Delta(removed_nodes=("cup1",)), Delta(values={fact("weight", "cup1"): 0})]
)
def test_a_write_that_fails_flips_nothing_and_is_told_to_nobody(path, delta):
    with opened(path) as kb:
        condition = kb.install("(and (on ?x shelf) (> (weight ?x) 1))")
        told = heard(condition)
        seen: list[Change] = []
        kb.subscribe(seen.append)
        with pytest.raises(FullDiskError):
            kb.apply(delta, author="test", along=fail)
        with pytest.raises(FullDiskError), kb.transaction(author="test", along=fail) as tx:
            tx.apply(delta)
        assert (condition.truth, condition.witness, condition.version) == (True, {"x": "cup1"}, 3)
        assert (told, seen) == ([], [])

        change = kb.apply(delta, author="test")
        assert (told, seen) == ([(4, False)], [change])


def test_a_store_that_is_closed_keeps_its_conditions_as_they_were(path):
    with opened(path) as kb:
        condition = kb.install("(on ?x shelf)")
        told = heard(condition)
    with pytest.raises(StoreError, match="closed"):
        kb.apply(OFF_SHELF, author="test")
    assert (condition.truth, condition.version, told) == (True, 3, [])


def test_a_repeated_key_fires_nothing(path):
    with opened(path) as kb:
        kb.apply(OFF_SHELF, author="test", key="clear")
        kb.apply(ON_SHELF, author="test")
    with opened(path) as kb:
        told = heard(kb.install("(on ?x shelf)"))
        assert kb.apply(OFF_SHELF, author="test", key="clear").version == 4
        assert (told, kb.version) == ([], 5)


def test_a_watch_on_a_reopened_store_tells_what_follows_its_version(path):
    async def follow(kb):
        with kb.watch("(on ?x shelf)", limit=1) as changes:
            kb.apply(OFF_SHELF, author="test")
            kb.apply(ON_SHELF, author="test")
            return await anext(changes)

    with opened(path) as kb:
        missed = asyncio.run(follow(kb))
        assert (missed.since, missed.until) == (3, 5)
        assert [c.version for c in kb.changes(since=missed.since)] == [4, 5]


@settings(PROPERTY, max_examples=40)
@given(st.data())
def test_after_any_history_conditions_are_what_evaluating_anew_says(data):
    language = data.draw(languages())
    before = KnowledgeBase(language.schema)
    before.apply(Delta(nodes=language.things), author="test")
    commit(before, data.draw(changes(language)))
    kb = KnowledgeBase(language.schema, history=MemoryHistory(Version(before.snapshot(), before.version, 0.0)))
    e = data.draw(conditions(language))
    params = data.draw(parameters(e, language.schema))
    try:
        condition = kb.install(e, params)
    except InputError:  # about a thing that was removed
        return
    told, expected = heard(condition), []
    assert condition.version == kb.version
    for _ in range(3):
        was = condition.truth
        commit(kb, data.draw(changes(language)))
        truth = bool(brute_witnesses(e, params, kb))
        expected += [(kb.version, truth)] if truth != was else []
        assert (condition.truth, told) == (truth, expected)


def commit(kb, delta) -> None:
    try:
        kb.apply(delta, author="test")
    except InputError:  # about a thing that was removed
        return


def test_nobody_is_called_while_a_transaction_is_open():
    lock: Any = RLock()
    heard = []
    announcer = Notifier(lock)
    with lock:
        announcer.queue(lambda: heard.append("of another commit"))
        announcer.quiet = True
        announcer.deliver()  # as `install` does inside a transaction
        assert heard == []
        announcer.quiet = False
    announcer.deliver()
    assert heard == ["of another commit"]
