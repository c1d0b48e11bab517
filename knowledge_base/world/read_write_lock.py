"""Read-write lock: admits queries and changes in the order of arrival; an interrupt always releases the lock.

Python raises an interrupt (`KeyboardInterrupt`) on the entry to a function, at each iteration of a loop, or on the
return from a call. Each `__exit__` is therefore the method of Python's own lock: one call into C, which no interrupt
precedes. A gate is a queue, because a gate may be opened twice.
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
"""Time in seconds for which the first waiting thread lets other threads acquire the lock first.

This time is long enough for several changes and several handovers of the lock.
"""


class Enter(Protocol):
    """Type of a context manager's `__enter__`."""

    def __call__(self) -> None:
        """Acquire the lock."""


class Exit(Protocol):
    """Type of a context manager's `__exit__`."""

    def __call__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None, /
    ) -> None:
        """Release the lock."""


class FairLock:
    """Re-entrant lock that admits threads in order of arrival; used as a context manager.

    A thread that finds the lock free acquires the lock immediately, until the patience of the first waiting thread
    ends. After that time, each new thread joins the line at its end. A handover between threads costs more than most of
    the work under the lock.

    Args:
        patience_s: time in seconds for which the first waiting thread lets other threads acquire the lock first.

    Attributes:
        held: returns whether this thread has acquired the lock.
        release: releases the lock once.
        marked: set by the thread that has the lock; cleared when a thread acquires the free lock.
    """

    __slots__ = ("__exit__", "_acquire", "_due", "_gates", "_patience_s", "held", "marked", "release")

    __exit__: Exit

    def __init__(self, patience_s: float) -> None:
        lock = RLock()
        self.held: Callable[[], bool] = lock._is_owned  # type: ignore[attr-defined]  # noqa: SLF001
        self.release = lock.release
        self.__exit__ = lock.__exit__
        self._acquire = lock.acquire
        self._patience_s = patience_s
        self._gates: deque[SimpleQueue[None]] = deque()  # only the gate of the first thread is open
        self._due = 0.0  # end of the first thread's patience
        self.marked = False

    @property
    def length(self) -> int:
        """Number of waiting threads."""
        return len(self._gates)

    def __enter__(self) -> None:
        marked_here = self.marked and self.held()
        may_go = not self._gates or self.held() or monotonic() < self._due
        try:
            if not (may_go and self._acquire(False)):  # noqa: FBT003  the keyword would double the cost of a query
                self._wait()
        except BaseException:
            self.let_go()
            raise
        if not marked_here:  # no call may follow: an interrupt could precede the call
            self.marked = False

    def let_go(self) -> None:
        """Release the lock if an interrupted call has acquired it."""
        try:
            self.release()
        except RuntimeError:  # the interrupt came before the lock was acquired
            return

    def take_if_free(self) -> bool:
        """Acquire the lock unless another thread has or awaits the lock; return whether this thread has acquired it."""
        return not self._gates and self._acquire(False)  # noqa: FBT003  see `__enter__`

    def _wait(self) -> None:
        """Wait in line and acquire the lock; then open the gate of the next thread."""
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
            except IndexError:  # no thread waits
                pass
            else:
                self._due = monotonic() + self._patience_s


class ReadWriteLock:
    """Lock of a world, with three modes.

    `with lock` admits queries, `with lock.changing()` a change, and `with lock.alone()` the preparation of a change.

    While a thread is *alone*, other threads may query. A thread that wants to change the world then waits in a separate
    line, in order of arrival, and precedes every later thread.

    Each mode is re-entrant; a thread that is changing the world or is alone may enter all modes. A thread that only
    queries must not change the world: its wait would block the thread that is alone.

    Args:
        patience_s: time in seconds for which the first waiting thread lets other threads acquire the lock first.
    """

    __slots__ = ("__enter__", "__exit__", "_alone", "_as_alone", "_as_changing", "_lock")

    __enter__: Enter
    __exit__: Exit

    def __init__(self, patience_s: float = PATIENCE_S) -> None:
        self._lock = FairLock(patience_s)  # marked by a thread that changes the world
        self._alone = FairLock(patience_s)  # acquired by the thread that is alone, or is the next to be
        self.__enter__ = self._lock.__enter__
        self.__exit__ = self._lock.__exit__
        self._as_changing = _Passage(self._begin_changing, self._lock.__exit__)
        self._as_alone = _Passage(self._begin_alone, self._alone.__exit__)

    @property
    def waiting(self) -> tuple[int, int]:
        """Number of threads in the line, and of threads in the separate line."""
        return self._lock.length, self._alone.length

    def changing(self) -> AbstractContextManager[None]:
        """Return a context manager that excludes all other threads.

        Raises:
            ConflictError: on entry to the block, this thread is evaluating a query.
        """
        return self._as_changing

    def alone(self) -> AbstractContextManager[None]:
        """Return a context manager that excludes changes of other threads.

        Other threads may query, unless this thread is changing the world already.

        Raises:
            ConflictError: on entry to the block, this thread is evaluating a query.
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
        self._lock.marked = True  # no call may follow: an interrupt could precede the call

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
                with self._lock:  # waits for the change of a thread that was alone just before
                    pass
        except BaseException:
            if entered:
                self._alone.let_go()
            raise

    def _may_change(self) -> bool:
        """Return whether this thread is alone or is changing the world already."""
        if self._alone.held():
            return True
        if not self._lock.held():
            return False
        if not self._lock.marked:
            raise ConflictError("a question is being answered in this thread; nothing can be changed meanwhile")
        return True


class _Passage:
    """A context manager that consists of two functions; the second may be a C function."""

    __slots__ = ("__enter__", "__exit__")

    __enter__: Enter
    __exit__: Exit

    def __init__(self, enter: Enter, leave: Exit) -> None:
        self.__enter__, self.__exit__ = enter, leave
