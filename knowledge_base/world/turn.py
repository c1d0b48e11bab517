"""Turns for many who ask and some who change: one lock that neither keeps the other from.

Three rules make the order:

- Who waits for the lock stands in line, first come, first served, whether to ask or to change something. Whoever comes
  and finds the lock free may go first as long as the first in line has been that for less than `PATIENCE_S`; then all
  join the line at its end. (To hand the lock from thread to thread each time costs more than most questions do.)
- Of those who change something only one has the *turn*. It may keep that without the lock (`alone`); others who want to
  change something wait apart meanwhile, and get the turn in order of arrival.
- Most questions are answered without the lock as long as the *door* is open (`Stamp.version` is not `None`). A change
  shuts it from when it stands in line until it is made, so that those questions take their place there, too. Otherwise
  who asks without pause would hold Python's own lock (GIL), and a change would wait for that, 5 ms each time that it
  touches a file or gets the lock from another thread.

An interrupt (`KeyboardInterrupt`) may come at any moment. So the lock *is* Python's own, which whoever asks gives back
without a line of Python in between. A change gives back what it got when it is interrupted as it begins; only at the
very moment at which it ends an interrupt may leave the lock taken, and then the world has to be opened anew.

Re-entrance: a thread that holds the lock may take it again at once, and one that has the turn may take both. A thread
that holds the lock only to ask cannot change anything; waiting for the turn it would keep out who has it.
"""

from __future__ import annotations

from _thread import RLock  # the type: `threading.RLock` is a function
from collections import deque
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from threading import Lock, get_ident
from time import monotonic
from types import TracebackType
from typing import NamedTuple

from knowledge_base.errors import ConflictError

PATIENCE_S = 0.0005
"""How long the first in line lets others go first: a few changes' time, some times what handing the lock over takes."""


@dataclass(slots=True)
class Stamp:
    """The version of a world, by which who reads a few facts without a lock knows that they are of one version.

    Attributes:
        version: `None` while a change is being made, or waits to be made.
        newest: the version that was made last.
    """

    version: int | None = 0
    newest: int = 0

    def open(self) -> None:
        """Who reads without the lock may go on."""
        self.version = self.newest

    def shut(self) -> None:
        """Who reads has to take the lock."""
        self.version = None


class _Place(NamedTuple):
    """Where a thread waits; its gate is opened when it is first in line."""

    thread: int
    gate: Lock


def _place() -> _Place:
    gate = Lock()
    gate.acquire()
    return _Place(get_ident(), gate)


class Turn(RLock):  # type: ignore[misc]  # it may be subclassed, whatever its stub says
    """The lock of a world; used as a context manager by who asks.

    Args:
        stamp: that of the world, for who reads without the lock.
        patience_s: how long the first in line lets others go first, in seconds.
    """

    _held = RLock._is_owned  # type: ignore[attr-defined]  # noqa: SLF001  by this thread; `threading.Condition` asks so, too

    def __init__(self, stamp: Stamp, patience_s: float = PATIENCE_S) -> None:
        self._stamp = stamp
        self._patience_s = patience_s
        self._guard = Lock()  # for what follows; held for a moment only
        self._line: deque[_Place] = deque()
        self._due = 0.0  # when the patience of the first in line is over
        self._changers: deque[_Place] = deque()
        self._changer: int | None = None  # who has the turn
        self._depth = 0  # how often it was taken again
        self._changes = 0  # how many keep the door shut
        self._as_changing, self._as_alone = _Changing(self), _Alone(self)

    @property
    def waiting(self) -> tuple[int, int]:
        """How many threads stand in line, and how many wait for the turn to change something."""
        with self._guard:
            return len(self._line), len(self._changers)

    def __enter__(self) -> bool:  # type: ignore[override]  # as `with` calls it
        mine = self._held()
        try:
            may_go = mine or not self._line or monotonic() < self._due
            if not (may_go and self.acquire(blocking=False)):
                place = _place()
                with self._guard:
                    self._join(place)
                self._enter(place)
        except BaseException:  # interrupted, perhaps with the lock already
            if self._held() and not mine:
                self.release()
            raise
        return True

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

    @contextmanager
    def ajar(self) -> Iterator[None]:
        """Who reads without the lock may go on; used while changing, as long as nothing is changed."""
        with self._guard:
            self._open()
        try:
            yield
        finally:
            with self._guard:
                self._shut()

    def take(self) -> None:
        """Begin to be `changing`: get the turn and the lock, and shut the door."""
        me = get_ident()
        if self._changer != me and self._held():
            raise ConflictError("a question is being answered in this thread; nothing can be changed meanwhile")
        again, entered = self._changer == me, False
        with self._guard:
            self._shut()
        try:
            entered = self.__enter__()
            if again:
                self._depth += 1
            else:
                self._get_turn(me)
        except BaseException:
            with self._guard:
                if self._changer == me and not again:
                    self._leave()
                self._open()
            if entered if again else self._held():
                self.release()
            raise

    def take_turn(self) -> None:
        """Begin to be `alone`: get the turn, and with it nothing else."""
        with self._guard:
            free = self._changer is None and not self._held()
            if free:
                self._changer = get_ident()
        if not free:
            self.take()
            with self._guard:
                self._open()
            self.release()

    def give_turn_back(self) -> None:
        """End to be `alone`."""
        with self._guard:
            self._leave()

    def give_back(self) -> None:
        """End to be `changing`."""
        try:
            with self._guard:
                self._leave()
                self._open()
        finally:
            self.release()

    def _get_turn(self, me: int) -> None:
        """Have the turn; if somebody is alone, leave the line and stand in it again when the turn has come."""
        with self._guard:
            if self._changer is None:
                self._changer = me
                return
            place = _place()
            self._changers.append(place)
            self._open()
        self.release()
        try:
            self._enter(place)
        except BaseException:
            with self._guard:
                if place in self._changers:
                    self._changers.remove(place)
                    self._shut()  # `take` opens it
            raise

    def _enter(self, place: _Place) -> None:
        """Wait in line; who is first waits for the lock, and opens the gate of the next when it has it."""
        try:
            place.gate.acquire()
            self.acquire()
        finally:  # also when it is interrupted
            with self._guard:
                if place in self._line:
                    was_first = self._line[0] is place
                    self._line.remove(place)
                    if was_first and self._line:
                        self._call_first()

    # --- under the guard

    def _leave(self) -> None:
        """Give the turn to who has waited longest, and put that one in line."""
        if self._depth:
            self._depth -= 1
        elif self._changers:
            place = self._changers.popleft()
            self._changer = place.thread
            self._shut()
            self._join(place)
        else:
            self._changer = None

    def _shut(self) -> None:
        self._changes += 1
        self._stamp.shut()

    def _open(self) -> None:
        self._changes -= 1
        if not self._changes:
            self._stamp.open()

    def _join(self, place: _Place) -> None:
        self._line.append(place)
        if len(self._line) == 1:
            self._call_first()

    def _call_first(self) -> None:
        self._due = monotonic() + self._patience_s
        self._line[0].gate.release()


class _Changing:
    """Entering it takes the turn, leaving it gives it back; as a class, since every change passes here."""

    __slots__ = ("_turn",)

    def __init__(self, turn: Turn) -> None:
        self._turn = turn

    def __enter__(self) -> None:
        self._turn.take()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._turn.give_back()


class _Alone:
    """Entering it takes the turn without the lock, leaving it gives it back."""

    __slots__ = ("_turn",)

    def __init__(self, turn: Turn) -> None:
        self._turn = turn

    def __enter__(self) -> None:
        self._turn.take_turn()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._turn.give_turn_back()
