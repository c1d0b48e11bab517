"""Read-write lock: questions and changes take turns in order of arrival, and an interrupt never leaves it taken.

An interrupt (`KeyboardInterrupt`) comes as Python enters a function, begins a loop again, or returns from a call. So an
`__exit__` here is that of Python's own lock: one call into C, before which no interrupt can come. A gate is a queue,
because a queue may be opened twice.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager
from queue import SimpleQueue
from threading import RLock
from time import monotonic
from types import TracebackType
from typing import Protocol

from knowledge_base.errors import ConflictError

PATIENCE_S = 0.0005
"""How long the first in line lets others go first: a few changes' time, some times what handing the lock over takes."""


class Enter(Protocol):
    """A context manager's `__enter__` as a value."""

    def __call__(self) -> None:
        """Take the lock."""


class Exit(Protocol):
    """A context manager's `__exit__` as a value."""

    def __call__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None, /
    ) -> None:
        """Give the lock back."""


class FairLock:
    """Re-entrant lock, taken in order of arrival; used as a context manager.

    A thread that finds the lock free goes first as long as the first in line is within its patience; then all join
    the line at its end. (Handing the lock over each time costs more than most of the work done with it.)

    Args:
        patience_s: how long the first in line lets others go first, in seconds.

    Attributes:
        held: whether this thread has the lock.
        release: give the lock back, once.
        marked: set by the thread that has the lock; cleared each time it is taken anew.
    """

    __slots__ = ("__exit__", "_acquire", "_due", "_gates", "_patience_s", "held", "marked", "release")

    __exit__: Exit

    def __init__(self, patience_s: float = PATIENCE_S) -> None:
        lock = RLock()
        self.held: Callable[[], bool] = lock._is_owned  # type: ignore[attr-defined]  # noqa: SLF001
        self.release = lock.release
        self.__exit__ = lock.__exit__
        self._acquire = lock.acquire
        self._patience_s = patience_s
        self._gates: deque[SimpleQueue[None]] = deque()  # that of the first is open
        self._due = 0.0  # when the patience of the first is over
        self.marked = False

    @property
    def length(self) -> int:
        """Number of threads in line."""
        return len(self._gates)

    def __enter__(self) -> None:
        again = self.held()
        try:
            may_go = again or not self._gates or monotonic() < self._due
            if not (may_go and self._acquire(blocking=False)):
                self._wait()
        except BaseException:
            self.let_go()
            raise
        if not again:  # no calls from here on: they could be interrupted
            self.marked = False

    def let_go(self) -> None:
        """Give back what an interrupted call may have taken."""
        try:
            self.release()
        except RuntimeError:  # the interrupt came before the call took it
            return

    def is_free(self) -> bool:
        """Whether no other thread has the lock or stands in line."""
        free = not self._gates
        try:
            self._acquire(blocking=False)
        finally:
            try:
                self.release()
            except RuntimeError:  # another thread has it
                free = False
        return free

    def _wait(self) -> None:
        """Stand in line until the lock is taken; leaving the line opens the next gate."""
        gate: SimpleQueue[None] = SimpleQueue()
        try:
            try:
                self._gates.append(gate)
                if self._gates[0] is gate:
                    gate.put(None)
                    self._due = monotonic() + self._patience_s
                gate.get()
                self._acquire()
            finally:
                self._gates.remove(gate)
        finally:
            try:
                self._gates[0].put(None)
            except IndexError:  # the line is empty
                pass
            else:
                self._due = monotonic() + self._patience_s


class ReadWriteLock:
    """Lock of a world: `with lock` to ask, `with lock.changing()` to change, `with lock.alone()` to prepare a change.

    A thread that is *alone* leaves the lock to questions. Another thread that wants to change something then waits
    apart, in order of arrival, and goes before each later one.

    Each of the three may be entered again; a thread that changes something or is alone may enter all. A thread that
    only asks cannot change anything: its wait would keep out the thread that is alone.

    Args:
        patience_s: how long the first in line lets others go first, in seconds.
    """

    __slots__ = ("__enter__", "__exit__", "_alone", "_apart", "_as_alone", "_as_changing", "_first_apart", "_lock")

    __enter__: Enter
    __exit__: Exit

    def __init__(self, patience_s: float = PATIENCE_S) -> None:
        self._lock = FairLock(patience_s)  # marked by a thread that changes something
        self._alone = FairLock(patience_s)
        self._apart: set[object] = set()  # who waits until no thread is alone, and then for the lock
        self._first_apart = FairLock(patience_s)  # had by one of these
        self.__enter__ = self._lock.__enter__
        self.__exit__ = self._lock.__exit__
        self._as_changing = _Passage(self._begin_changing, self._lock.__exit__)
        self._as_alone = _Passage(self._begin_alone, self._alone.__exit__)

    @property
    def waiting(self) -> tuple[int, int]:
        """Number of threads in line, and of threads that wait apart."""
        return self._lock.length, self._alone.length + self._first_apart.length

    def changing(self) -> AbstractContextManager[None]:
        """No other thread asks or changes anything.

        Raises:
            ConflictError: on entering, this thread is inside a question.
        """
        return self._as_changing

    def alone(self) -> AbstractContextManager[None]:
        """No other thread changes anything; other threads may ask.

        Raises:
            ConflictError: on entering, this thread is inside a question.
        """
        return self._as_alone

    def _begin_changing(self) -> None:
        self._get_to_change()
        self._lock.marked = True  # no calls from here on: they could be interrupted

    def _begin_alone(self) -> None:
        self._get_to_change()
        entered = False
        try:
            try:
                self._alone.__enter__()  # it is free, or will be at once
                entered = True
            finally:
                self._lock.release()
        except BaseException:
            if entered:
                self._alone.let_go()
            raise

    def _get_to_change(self) -> None:
        """Take the lock while no other thread is alone or has waited longer for that."""
        again, alone = self._lock.held(), self._alone.held()
        if again and not (self._lock.marked or alone):
            raise ConflictError("a question is being answered in this thread; nothing can be changed meanwhile")
        entered = False
        try:
            self._lock.__enter__()
            entered = True
            if not (again or alone or (not self._apart and self._alone.is_free())):
                self._lock.release()
                self._wait_apart()
        except BaseException:
            if entered:
                self._lock.let_go()
            raise

    def _wait_apart(self) -> None:
        """Wait until no thread is alone, and then for the lock, in order of arrival."""
        me = object()
        try:
            self._apart.add(me)
            with self._first_apart:
                with self._alone:
                    pass
                self._lock.__enter__()
        finally:
            self._apart.discard(me)


class _Passage:
    """A context manager made of two functions; the second may be one of C's."""

    __slots__ = ("__enter__", "__exit__")

    __enter__: Enter
    __exit__: Exit

    def __init__(self, enter: Enter, leave: Exit) -> None:
        self.__enter__, self.__exit__ = enter, leave
