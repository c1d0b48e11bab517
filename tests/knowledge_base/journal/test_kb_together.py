"""Several commits and other rows as one transaction of the file."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import pytest
from kb_interrupts import interrupted as interrupted_at

from knowledge_base import Delta, KnowledgeBase, Schema, fact
from knowledge_base.errors import ConflictError, SchemaError, StoreError

SCHEMA = Schema.parse("(define (domain d) (:predicates (p) (q) (r)))")


def tell(kb: KnowledgeBase, name: str) -> None:
    kb.apply(Delta(added=(fact(name),)), author="me")


def interrupted(kb):
    with kb.together():
        tell(kb, "q")
        raise RuntimeError("no")


def with_a_change_that_fails(kb):
    with kb.together() as connection:
        tell(kb, "p")
        connection.execute("ALTER TABLE changes RENAME TO gone")
        with pytest.raises(StoreError, match="no such table"):
            tell(kb, "q")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "world.kb"


def on_file(path) -> tuple[int, list[str]]:
    with KnowledgeBase.open(None, path, read_only=True) as seen:
        return seen.version, [one.predicate for one in seen.snapshot().facts]


def test_each_change_keeps_its_version_and_the_file_gets_all_at_once(path):
    heard = []
    with KnowledgeBase.open(SCHEMA, path) as kb:
        kb.subscribe(lambda change: heard.append(change.version))
        with kb.together() as connection:
            tell(kb, "p")
            assert kb.ask("(p)")
            assert heard == [1]
            assert on_file(path) == (0, [])
            tell(kb, "q")
            connection.execute("CREATE TABLE mine (x)")
        assert on_file(path) == (2, ["p", "q"])
        assert [change.version for change in kb.changes()] == [1, 2]
        tell(kb, "r")
    assert on_file(path)[0] == 3


def test_a_listener_in_a_together_block_reads_past_versions(path):
    heard = []
    with KnowledgeBase.open(SCHEMA, path) as kb:
        kb.subscribe(lambda change: heard.append((kb.changes(since=change.version - 1), kb.at(version=change.version))))
        with kb.together():
            tell(kb, "p")
            tell(kb, "q")
    assert [[one.version for one in changes] for changes, _ in heard] == [[1], [2]]
    assert [view.ask("(q)") for _, view in heard] == [False, True]


def test_a_thread_that_looks_back_waits_for_the_end_of_a_block(path):
    found = []
    with KnowledgeBase.open(SCHEMA, path) as kb:
        other = threading.Thread(target=lambda: found.extend(kb.changes()))
        with kb.together():
            tell(kb, "p")
            other.start()
            tell(kb, "q")
        other.join()
    assert [change.version for change in found] == [1, 2]


def test_a_block_that_raises_leaves_nothing_in_the_file_and_closes_the_door(path):
    with KnowledgeBase.open(SCHEMA, path) as kb:
        tell(kb, "p")
        with pytest.raises(RuntimeError, match="no"):
            interrupted(kb)
        with pytest.raises(StoreError, match="lacks the last changes"):
            tell(kb, "r")
        with pytest.raises(StoreError, match="lacks the last changes"), kb.together():
            pass
    assert on_file(path) == (1, ["p"])


class NoTextError(Exception):
    def __str__(self):
        raise ValueError("no text")


class NoClassError(Exception):
    @property  # type: ignore[misc]
    def __class__(self):
        raise RuntimeError("no class")


@pytest.mark.parametrize("kind", [NoTextError, NoClassError, SystemExit])
def test_a_block_whose_error_cannot_be_read_closes_the_store_for_changes(path, kind):
    def fail(kb):
        with kb.together():
            tell(kb, "p")
            raise kind

    with KnowledgeBase.open(SCHEMA, path) as kb:
        with pytest.raises(kind):
            fail(kb)
        with pytest.raises(StoreError, match="lacks the last changes"):
            tell(kb, "q")


def test_a_change_that_is_refused_spoils_nothing_else(path):
    with KnowledgeBase.open(SCHEMA, path) as kb:
        with kb.together():
            tell(kb, "p")
            with pytest.raises(SchemaError):
                kb.apply(Delta(added=(fact("q", "too", "many"),)), author="me")
        tell(kb, "r")
    assert on_file(path) == (2, ["p", "r"])


def test_a_change_that_cannot_be_written_takes_the_others_with_it(path):
    with KnowledgeBase.open(SCHEMA, path) as kb:
        with pytest.raises(StoreError, match="no such table"):
            with_a_change_that_fails(kb)
        with pytest.raises(StoreError, match="lacks"):
            tell(kb, "r")
    assert on_file(path) == (0, [])


def test_rows_that_cannot_be_written_are_told_as_an_error_of_the_store(path):
    with (
        KnowledgeBase.open(SCHEMA, path) as kb,
        pytest.raises(StoreError, match="nowhere"),
        kb.together() as connection,
    ):
        connection.execute("INSERT INTO nowhere VALUES (1)")


def test_other_threads_wait_with_their_changes_and_not_with_their_questions(path):
    asked, changed = threading.Event(), threading.Event()

    def other(kb):
        kb.ask("(p)")
        asked.set()
        tell(kb, "q")
        changed.set()

    with KnowledgeBase.open(SCHEMA, path) as kb:
        with kb.together():
            tell(kb, "p")
            thread = threading.Thread(target=other, args=(kb,))
            thread.start()
            assert asked.wait(10)
            assert not changed.is_set()
        thread.join(10)
        assert changed.is_set()
    assert on_file(path) == (2, ["p", "q"])


def test_a_together_block_requires_a_writable_file_and_no_open_transaction(path):
    with pytest.raises(StoreError, match="in memory"), KnowledgeBase(SCHEMA).together():
        pass
    KnowledgeBase.open(SCHEMA, path).close()
    with KnowledgeBase.open(None, path, read_only=True) as kb, pytest.raises(ConflictError), kb.together():
        pass
    with KnowledgeBase.open(SCHEMA, path) as kb, kb.transaction("me"), pytest.raises(ConflictError), kb.together():
        pass


def test_a_closed_store_says_so(path):
    kb = KnowledgeBase.open(SCHEMA, path)
    kb.close()
    with pytest.raises(StoreError), kb.together():
        pass


def test_an_interrupt_at_any_moment_at_which_a_block_is_left_loses_nothing_in_silence(tmp_path):
    """What is told afterwards is in the file, or refused; and nobody waits for ever."""
    was_interrupted, moment = True, 0
    while was_interrupted:
        path = tmp_path / f"world{moment}.kb"
        told: list[str] = []

        def tell_more(kb, told):
            with suppress(StoreError):
                tell(kb, "q")
                told.append("q")

        with KnowledgeBase.open(SCHEMA, path) as kb:
            block = kb.together()
            block.__enter__()
            tell(kb, "p")
            leave: Callable[[], Any] = partial(block.__exit__, None, None, None)
            was_interrupted = interrupted_at(moment, leave)
            del block, leave
            other = threading.Thread(target=tell_more, args=(kb, told), daemon=True)
            other.start()
            other.join(5)
            assert not other.is_alive(), f"interrupted at moment {moment}"
        assert ("q" in on_file(path)[1]) == bool(told), f"interrupted at moment {moment}"
        moment += 1
    assert moment > 1
    assert on_file(path) == (2, ["p", "q"])
