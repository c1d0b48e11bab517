"""Read-write lock: questions and changes take turns in order of arrival, and an interrupt never leaves it taken.

Python raises an interrupt (`KeyboardInterrupt`) as it enters a function, begins a loop again, or returns from a call.
So each `__exit__` is the method of Python's own lock: one call into C, which no interrupt precedes. A gate is a queue,
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
"""Time in which the first in line lets others go first: several changes, and several handovers of the lock."""


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

    A thread that finds the lock free goes first while the first in line has patience; then all join the line at its
    end. A handover costs more than most of the work under the lock.

    Args:
        patience_s: time in which the first in line lets others go first, in seconds.

    Attributes:
        held: tells whether this thread has the lock.
        release: gives the lock back, once.
        marked: set by the thread that has the lock; cleared when a thread takes it from free.
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
        marked_here = self.marked and self.held()
        may_go = not self._gates or self.held() or monotonic() < self._due
        try:
            if not (may_go and self._acquire(False)):  # noqa: FBT003  the keyword would double the cost of a question
                self._wait()
        except BaseException:
            self.let_go()
            raise
        if not marked_here:  # no calls from here on: they could be interrupted
            self.marked = False

    def let_go(self) -> None:
        """Give back the lock that an interrupted call may have taken."""
        try:
            self.release()
        except RuntimeError:  # the interrupt came before the call took it
            return

    def take_if_free(self) -> bool:
        """Take the lock unless another thread has it or waits in line; return whether this thread has it now."""
        return not self._gates and self._acquire(False)  # noqa: FBT003  as above

    def _wait(self) -> None:
        """Wait in line and take the lock; the end of the wait opens the next gate."""
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
        patience_s: time in which the first in line lets others go first, in seconds.
    """

    __slots__ = ("__enter__", "__exit__", "_alone", "_as_alone", "_as_changing", "_lock")

    __enter__: Enter
    __exit__: Exit

    def __init__(self, patience_s: float = PATIENCE_S) -> None:
        self._lock = FairLock(patience_s)  # marked by a thread that changes something
        self._alone = FairLock(patience_s)  # had by a thread that is alone, or waits apart and is next
        self.__enter__ = self._lock.__enter__
        self.__exit__ = self._lock.__exit__
        self._as_changing = _Passage(self._begin_changing, self._lock.__exit__)
        self._as_alone = _Passage(self._begin_alone, self._alone.__exit__)

    @property
    def waiting(self) -> tuple[int, int]:
        """Number of threads in line, and of threads that wait apart."""
        return self._lock.length, self._alone.length

    def changing(self) -> AbstractContextManager[None]:
        """No other thread asks or changes anything.

        Raises:
            ConflictError: on entering, this thread is inside a question.
        """
        return self._as_changing

    def alone(self) -> AbstractContextManager[None]:
        """No other thread changes anything; other threads may ask, unless this one changes something already.

        Raises:
            ConflictError: on entering, this thread is inside a question.
        """
        return self._as_changing if self._lock.marked and self._lock.held() else self._as_alone

    def _begin_changing(self) -> None:
        may_change = self._may_change()
        entered = False
        try:
            self._lock.__enter__()
            entered = True
            if may_change:
                pass
            elif self._alone.take_if_free():
                self._alone.release()
            else:
                self._lock.release()
                with self._alone:
                    self._lock.__enter__()
        except BaseException:
            if entered:
                self._lock.let_go()
                if not may_change:
                    self._alone.let_go()
            raise
        self._lock.marked = True  # no calls from here on: they could be interrupted

    def _begin_alone(self) -> None:
        if self._may_change():
            self._alone.__enter__()
            return
        entered = False
        try:
            with self._lock:
                entered = True
                taken = self._alone.take_if_free()
            if not taken:
                self._alone.__enter__()
        except BaseException:
            if entered:
                self._alone.let_go()
            raise

    def _may_change(self) -> bool:
        """Whether this thread is alone or changes something already."""
        if self._alone.held():
            return True
        if not self._lock.held():
            return False
        if not self._lock.marked:
            raise ConflictError("a question is being answered in this thread; nothing can be changed meanwhile")
        return True


class _Passage:
    """A context manager made of two functions; the second may be one of C's."""

    __slots__ = ("__enter__", "__exit__")

    __enter__: Enter
    __exit__: Exit

    def __init__(self, enter: Enter, leave: Exit) -> None:
        self.__enter__, self.__exit__ = enter, leave
