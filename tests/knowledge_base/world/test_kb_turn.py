"""Who asks and who changes something take turns; neither keeps out the other, however often it comes."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from typing import Any

import pytest
from kb_interrupts import interrupted

from knowledge_base import ConflictError, Delta, KnowledgeBase, Schema, fact
from knowledge_base.world.read_write_lock import ReadWriteLock


class Crowd:
    """Threads that come one after the other, and the order in which they get in."""

    def __init__(self) -> None:
        self.turn = ReadWriteLock(patience_s=0)
        self.order: list[str] = []
        self._threads: list[threading.Thread] = []

    def asks(self, name: str, inside: Callable[[], None] | None = None) -> None:
        self._comes(name, lambda: self.turn, inside)

    def changes(self, name: str, inside: Callable[[], None] | None = None) -> None:
        self._comes(name, self.turn.changing, inside)

    def is_alone(self, name: str) -> None:
        self._comes(name, self.turn.alone, None)

    def _comes(
        self, name: str, enter: Callable[[], AbstractContextManager[None]], inside: Callable[[], None] | None
    ) -> None:
        def work() -> None:
            with enter():
                self.order.append(name)
                if inside is not None:
                    inside()

        before = sum(self.turn.waiting)
        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        self._threads.append(thread)
        while sum(self.turn.waiting) == before:
            time.sleep(0)

    def goes(self) -> list[str]:
        for thread in self._threads:
            thread.join(10)
        assert not any(thread.is_alive() for thread in self._threads)
        return self.order


@pytest.fixture
def crowd() -> Crowd:
    return Crowd()


def test_first_come_first_served(crowd: Crowd) -> None:
    with crowd.turn.changing():
        crowd.changes("change 1")
        crowd.asks("question 1")
        crowd.asks("question 2")
        crowd.changes("change 2")
        crowd.asks("question 3")
    assert crowd.goes() == ["change 1", "question 1", "question 2", "change 2", "question 3"]


def test_a_repeated_query_waits_for_an_earlier_change(crowd: Crowd) -> None:
    with crowd.turn:
        crowd.asks("question 1", lambda: crowd.asks("question 3"))
        crowd.changes("change")
        crowd.asks("question 2")
    assert crowd.goes() == ["question 1", "change", "question 2", "question 3"]


def test_a_repeated_change_waits_for_an_earlier_query(crowd: Crowd) -> None:
    with crowd.turn.changing():
        crowd.changes("change 1", lambda: crowd.changes("change 2"))
        crowd.asks("question")
    assert crowd.goes() == ["change 1", "question", "change 2"]


def test_a_change_that_waits_for_the_end_of_alone_precedes_later_changes(crowd: Crowd) -> None:
    with crowd.turn.alone():
        crowd.changes("change 1", lambda: crowd.changes("change 3"))
        crowd.changes("change 2")
        with crowd.turn:
            crowd.asks("question")
    assert crowd.goes() == ["question", "change 1", "change 2", "change 3"]


def test_a_changing_thread_enters_alone_while_another_change_waits(crowd: Crowd) -> None:
    def is_alone() -> None:
        with crowd.turn.alone(), crowd.turn.alone(), crowd.turn.changing():
            crowd.asks("question")

    with crowd.turn.alone():
        crowd.changes("change 1", is_alone)
        crowd.changes("change 2", is_alone)
    assert [one for one in crowd.goes() if one != "question"] == ["change 1", "change 2"]


def test_alone_means_that_others_ask_and_do_not_change(crowd: Crowd) -> None:
    asked = threading.Event()
    with crowd.turn.alone():
        crowd.changes("change")

        def ask() -> None:
            with crowd.turn:
                asked.set()

        thread = threading.Thread(target=ask)
        thread.start()
        thread.join(10)
        assert asked.is_set()
        with crowd.turn.changing():
            crowd.order.append("own change")
    assert crowd.goes() == ["own change", "change"]


def test_alone_waits_for_the_end_of_an_earlier_change(crowd: Crowd) -> None:
    def change() -> None:
        while crowd.turn.waiting[0] == 0 and "alone" not in crowd.order:
            time.sleep(0)
        crowd.order.append("end of change")

    with crowd.turn.alone():
        crowd.changes("change", change)
        crowd.is_alone("alone")
    assert crowd.goes() == ["change", "end of change", "alone"]


def test_the_lock_and_the_turn_may_be_taken_again(crowd: Crowd) -> None:
    turn = crowd.turn
    with turn.alone(), turn.changing(), turn.changing():
        with turn, turn:
            crowd.asks("question")
        with turn:  # although somebody is in line already
            pass
    with turn, turn:
        pass
    assert crowd.goes() == ["question"]
    assert turn.waiting == (0, 0)


def test_nothing_is_changed_inside_a_question(crowd: Crowd) -> None:
    with crowd.turn, pytest.raises(ConflictError, match="being answered in this thread"), crowd.turn.changing():
        pass
    with crowd.turn.changing():
        pass


def test_an_interrupted_wait_leaves_no_thread_in_the_line(crowd: Crowd, monkeypatch) -> None:
    """An interrupt ends the wait at a gate with an exception."""

    class Interrupted:
        def put(self, item: None) -> None: ...

        def get(self) -> None:
            raise KeyboardInterrupt

    def waits(enter: Callable[[], AbstractContextManager[None]]) -> None:
        with pytest.raises(KeyboardInterrupt), enter():
            pass

    with crowd.turn.changing():
        with monkeypatch.context() as patch:
            patch.setattr("knowledge_base.world.read_write_lock.SimpleQueue", Interrupted)
            for enter in (lambda: crowd.turn, crowd.turn.changing):
                thread = threading.Thread(target=waits, args=(enter,))
                thread.start()
                thread.join(10)
        assert crowd.turn.waiting == (0, 0)
        crowd.changes("change")
    assert crowd.goes() == ["change"]


@pytest.mark.parametrize("kept", ["in memory", "in a file"])
def test_writers_get_on_among_readers_that_ask_without_pause(tmp_path, kept: str) -> None:
    """Both sides are counted in what the other does meanwhile, not in time."""
    schema = Schema.parse("(define (domain d) (:predicates (p) (q)))")
    with KnowledgeBase.open(schema, tmp_path / "world.kb" if kept == "in a file" else None) as kb:
        asked, stop = [0, 0], threading.Event()

        def ask(number: int) -> None:
            while not stop.is_set():
                kb.ask("(p)")
                asked[number] += 1

        readers = [threading.Thread(target=ask, args=(number,)) for number in range(2)]
        for reader in readers:
            reader.start()
        for number in range(200):
            delta = Delta(added=(fact("p"),)) if number % 2 == 0 else Delta(removed=(fact("p"),))
            kb.apply(delta, "writer")
        during = list(asked)
        stop.set()
        for reader in readers:
            reader.join(10)
        assert kb.version == 200
        assert all(during)


def changes(turn: ReadWriteLock) -> None:
    with turn.changing():
        pass


def changes_within_a_change(turn: ReadWriteLock) -> None:
    with turn.changing(), turn.changing():
        pass


def is_alone(turn: ReadWriteLock) -> None:
    with turn.alone():
        pass


def changes_and_asks_alone(turn: ReadWriteLock) -> None:
    with turn.alone(), turn.alone(), turn.changing():
        asks(turn)


def asks(turn: ReadWriteLock) -> None:
    with turn:
        pass


@pytest.mark.parametrize("other", [None, changes, is_alone, asks])
@pytest.mark.parametrize("work", [changes, changes_within_a_change, is_alone, changes_and_asks_alone, asks])
def test_an_interrupt_at_any_moment_leaves_the_lock_free(
    work: Callable[[ReadWriteLock], None], other: Callable[[ReadWriteLock], None] | None
) -> None:
    was_interrupted, moment = True, 0
    while was_interrupted:
        turn, begun, over = ReadWriteLock(), threading.Event(), threading.Event()
        others = [threading.Thread(target=keeps, args=(turn, other, begun, over), daemon=True)] if other else []
        for thread in others:
            thread.start()
            begun.wait(5)
        was_interrupted = interrupted(moment, partial(work, turn))
        over.set()
        after = threading.Thread(target=lambda: [each(turn) for each in (changes, is_alone, asks)], daemon=True)  # noqa: B023
        after.start()
        for thread in (*others, after):
            thread.join(5)
            assert not thread.is_alive(), f"interrupted at moment {moment}"
        assert turn.waiting == (0, 0)
        moment += 1
    assert moment > 1


def keeps(
    turn: ReadWriteLock, how: Callable[[ReadWriteLock], None], begun: threading.Event, over: threading.Event
) -> None:
    """Keep others waiting until one waits, or has given up."""
    ways: dict[object, Callable[[], Any]] = {changes: turn.changing, is_alone: turn.alone, asks: lambda: turn}
    with ways[how]():
        begun.set()
        while not (over.is_set() or any(turn.waiting)):
            time.sleep(0)
