"""Turns for many who ask and some who change: one lock that neither keeps the other from.

Three rules make the order:

- Who waits for the lock stands in line (`world.line`), first come, first served, whether to ask or to change something.
- Who changes something may want to be *alone* with that, without the lock: others who want to change something leave
  the lock's line then and wait apart, in order of arrival, and go before whoever comes later to change something.
- Most questions are answered without the lock as long as the *door* is open (`Stamp.version` is not `None`). A change
  shuts it from when it stands in line until it is made, so that those questions take their place there, too. Otherwise
  who asks without pause would hold Python's own lock (GIL), and a change would wait for that, 5 ms each time that it
  touches a file or gets the lock from another thread. Who asks with the lock, and sees nobody coming to change
  anything, opens the door again.

So a change has nothing to do when it ends but to give back a lock of Python's own. No line of Python is run for that,
and no interrupt can come before it. (A block that is a generator, like a transaction, can be interrupted as it is
left; it ends when the interrupt and its traceback are forgotten.)

Re-entrance: a thread that holds the lock may take it again at once, and one that changes something or is alone may
take both. A thread that holds the lock only to ask cannot change anything; waiting to be let it would keep out who is
alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from types import TracebackType

from knowledge_base.errors import ConflictError
from knowledge_base.world.fair_lock import PATIENCE_S, FairLock


@dataclass(slots=True)
class Stamp:
    """The version of a world, by which who reads a few facts without a lock knows that they are of one version.

    Attributes:
        version: `None` while a change is being made, or waits to be made, and after it until somebody asks.
        newest: the version that was made last.
    """

    version: int | None = 0
    newest: int = 0


class ReadWriteLock(FairLock):
    """The lock of a world; used as a context manager by who asks.

    Args:
        stamp: that of the world, for who reads without the lock.
        patience_s: how long the first in line lets others go first, in seconds.
    """

    def __init__(self, stamp: Stamp, patience_s: float = PATIENCE_S) -> None:
        super().__init__(patience_s)
        self._stamp = stamp
        self._alone = FairLock(patience_s)
        self._apart: set[object] = set()  # who waits until somebody is alone no longer, and then for the lock
        self._first_apart = FairLock(patience_s)  # had by one of these
        self._coming: set[object] = set()  # who stands in line to change something
        self._changing = False  # who has the lock has it to change something
        self._as_changing = _Passage(self._begin_changing, self.__exit__)
        self._as_alone = _Passage(self._begin_alone, self._alone.__exit__)

    @property
    def waiting(self) -> tuple[int, int]:
        """How many threads stand in line, and how many wait until somebody is alone no longer."""
        return self.length, self._alone.length + self._first_apart.length

    def __enter__(self) -> bool:
        again = self.get()
        if not again:  # no calls from here on: they could be interrupted
            self._changing = False
            if not self._coming:
                self._stamp.version = self._stamp.newest
        return again

    def changing(self) -> AbstractContextManager[None]:
        """Nobody else changes anything or asks.

        Raises:
            ConflictError: on entering, this thread is inside a question.
        """
        return self._as_changing

    def alone(self) -> AbstractContextManager[None]:
        """Nobody else changes anything; who asks may go on.

        Raises:
            ConflictError: on entering, this thread is inside a question.
        """
        return self._as_alone

    def made(self) -> None:
        """Who reads without the lock may go on; said by who changes something, when nothing is changed any more."""
        if not self._coming:
            self._stamp.version = self._stamp.newest

    @contextmanager
    def ajar(self) -> Iterator[None]:
        """Who reads without the lock may go on; used while changing, as long as nothing is changed."""
        self.made()
        try:
            yield
        finally:
            self._stamp.version = None

    def _begin_changing(self) -> None:
        self._get_to_change()
        # No calls from here on: they could be interrupted.
        self._stamp.version = None  # for good: now nobody can open it
        self._changing = True

    def _begin_alone(self) -> None:
        again = self._get_to_change()
        if not (again or self._coming):
            self._stamp.version = self._stamp.newest
        try:
            try:
                self._alone.acquire()  # it is free, or will be at once
            finally:
                self.release()
        except BaseException:
            self._alone.let_go()
            raise

    def _get_to_change(self) -> bool:
        """Get the lock while nobody else is alone, with the door shut; whether this thread had it already."""
        again = self.held()
        if again and not self._changing and not self._alone.held():
            raise ConflictError("a question is being answered in this thread; nothing can be changed meanwhile")
        entered, me = False, object()
        try:
            try:
                self._coming.add(me)
                self._stamp.version = None
                self.get()
                entered = True
                if not again and self._has_to_wait():
                    self.release()
                    self._wait_apart(me)
            finally:
                self._coming.discard(me)
        except BaseException:
            if entered:
                self.let_go()
            raise
        return again

    def _has_to_wait(self) -> bool:
        """Whether another thread is alone, or has waited longer for that to end."""
        if self._alone.held():
            return False
        another = bool(self._apart)
        try:
            self._alone.acquire(blocking=False)
        finally:
            try:
                self._alone.release()
            except RuntimeError:  # it was not to be had
                another = True
        return another

    def _wait_apart(self, me: object) -> None:
        """Wait until nobody is alone, and then for the lock, in order of arrival."""
        try:
            self._apart.add(me)
            self._coming.discard(me)
            with self._first_apart:
                with self._alone:
                    pass
                self._coming.add(me)
                self._stamp.version = None
                self.get()
        finally:
            self._apart.discard(me)


class _Passage:
    """A context manager that is made of two functions; the second may be one of C's."""

    __slots__ = ("__enter__", "__exit__")

    __enter__: Callable[[], None]
    __exit__: Callable[[type[BaseException] | None, BaseException | None, TracebackType | None], None]

    def __init__(
        self,
        enter: Callable[[], None],
        leave: Callable[[type[BaseException] | None, BaseException | None, TracebackType | None], None],
    ) -> None:
        self.__enter__, self.__exit__ = enter, leave
