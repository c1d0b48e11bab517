"""An installed condition: its truth at every version, and who is told when it changes."""

from __future__ import annotations

from collections.abc import Callable, Container
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from threading import Lock
from types import TracebackType
from typing import Literal, Protocol, Self

from knowledge_base.conditions.condition_shape import Args
from knowledge_base.conditions.damping import Hold
from knowledge_base.conditions.join import ConditionRow
from knowledge_base.conditions.waiters import Waiters
from knowledge_base.errors import ConditionCancelledError, InputError
from knowledge_base.facts import Value
from knowledge_base.world.read_write_lock import ReadWriteLock

Fire = Literal["edge", "each"]
FIRE: tuple[Fire, ...] = ("edge", "each")


@dataclass(frozen=True, slots=True)
class Firing:
    """What those who listen to a condition hear.

    Attributes:
        condition: the one that fired.
        number: how many firings of the condition there have been with this one.
        version: the knowledge base's version at which it fired.
        truth: whether it is true; false only for those who asked to be told falls.
        witness: a choice for its free variables that made it true then; `None` when it is not.
    """

    condition: Condition
    number: int
    version: int
    truth: bool
    witness: dict[str, Value] | None


FiringListener = Callable[[Firing], None]


@dataclass(frozen=True, slots=True)
class Terms:
    """On which terms a condition fires; see `KnowledgeBase.install`."""

    fire: Fire
    once: bool
    hold: Hold | None


@dataclass(slots=True)
class _Reading:
    truth: bool
    witness: Args | None
    version: int


@dataclass(slots=True)
class _Listening:
    listener: FiringListener
    falls: bool
    ended: bool = field(default=False)


class Owner(Protocol):
    """Who keeps conditions evaluated.

    Attributes:
        version: the latest version that was judged.
    """

    version: int

    @property
    def lock(self) -> ReadWriteLock:
        """Held while conditions are judged."""
        ...

    def remove(self, condition: Condition) -> None:
        """Forget a condition; under the lock."""
        ...

    def later(self, call: Callable[[], None]) -> None:
        """Queue a call for when the lock is released; under the lock."""
        ...

    def deliver(self) -> None:
        """Make the queued calls; without the lock."""
        ...


class Condition:
    """A condition that the knowledge base keeps evaluated; made by `KnowledgeBase.install`.

    As a context manager it is cancelled at the end of the block. All of it may be used from any thread.
    """

    def __init__(
        self,
        owner: Owner,
        text: str,
        rows: tuple[ConditionRow, ConditionRow],
        names: tuple[str, ...],
        terms: Terms,
        number: int,
    ) -> None:
        rise, _ = self.rows = rows
        self.text = text
        """The condition with its parameters filled in, for messages."""
        self.number = number
        """The how-manieth it was to be installed: the order of firing within a version."""
        self._owner = owner
        self._terms = terms
        self._names = names
        self._now = _Reading(rise.truth, rise.witness, owner.version)
        self._told_true = rise.truth and terms.hold is None
        self._listening: dict[int, _Listening] = {}
        self._keys = count()
        self._guard = Lock()
        self._waiters: Waiters[Firing] = Waiters()
        self._last: Firing | None = None
        self._fired = 0
        self._rises = 0
        self._installed = True
        self._silent = False
        self._closed = False

    @property
    def truth(self) -> bool:
        """Whether it is true, at the latest version; as it was last once it is cancelled."""
        return self._now.truth

    @property
    def witness(self) -> dict[str, Value] | None:
        """A choice for its free variables that makes it true (`{}` if it has none); `None` when it is false."""
        found = self._now.witness
        return None if found is None else dict(zip(self._names, found, strict=True))

    @property
    def version(self) -> int:
        """The knowledge base's version that made its truth or its witnesses what they are, or of installation."""
        return self._now.version

    @property
    def error(self) -> InputError | None:
        """Why it cannot be computed at present, e.g. a division by zero; it then counts as false."""
        with self._owner.lock:
            return next((e for row in self.rows if (e := row.error) is not None), None)

    @property
    def fired(self) -> int:
        """How many times it has fired, as far as that has been told."""
        return 0 if self._last is None else self._last.number

    @property
    def cancelled(self) -> bool:
        """Whether it is not installed any more."""
        return not self._installed

    def subscribe(self, listener: FiringListener, *, falls: bool = False) -> Callable[[], None]:
        """Call `listener` at every firing from now on, with `falls` also when it becomes false.

        It is called after the commit, outside the lock, in commit order and, within a version, in the order
        of installation. Errors are treated as those of `KnowledgeBase.subscribe`. The function returned ends it.
        """
        with self._owner.lock:
            key = next(self._keys)
            self._listening[key] = listening = _Listening(listener, falls)

        def unsubscribe() -> None:
            with self._owner.lock:
                listening.ended = True
                self._listening.pop(key, None)

        return unsubscribe

    async def wait(self, after: int | None = None) -> Firing:
        """The next firing; with `after` also the last one, if more than that many (`fired`) have been.

        Raises:
            ConditionCancelledError: it is or gets cancelled, so that it will not fire again.
        """
        with self._guard:
            if after is not None and self._last is not None and self._last.number > after:
                return self._last
            if self._closed:
                raise ConditionCancelledError(f"{self.text} is cancelled and will not fire again")
            future = self._waiters.join()
        try:
            return await future
        finally:
            with self._guard:
                self._waiters.leave(future)

    def cancel(self) -> None:
        """End it: nothing that has not been told yet is told any more; repeating it is fine."""
        self._silent = True
        with self._owner.lock:
            self.uninstall()
        if self._terms.hold is not None:
            self._terms.hold.stop()
        self._close()

    def __repr__(self) -> str:
        return f"<Condition {self.text}: {self.truth} at version {self.version}>"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.cancel()

    # --- called by its owner, under the lock

    def begin(self) -> None:
        """It is installed; what is true already begins to hold."""
        if self._now.truth:
            self._hold()

    def judge(self, version: int, changed: Container[ConditionRow]) -> None:
        """Its rows are up to date with `version`, which `changed` the witnesses of at least one of them."""
        rise, stay = self.rows
        was = self._now.truth
        truth = rise.truth or (was and stay.truth)
        if not (truth or was):
            return
        self._now = _Reading(truth, (stay if rise.witness is None else rise).witness if truth else None, version)
        if not truth:
            self._fall()
        elif not was:
            self._rise()
        elif self._terms.fire == "each" and self._told_true and stay in changed:
            self._fire()

    def uninstall(self) -> None:
        """Keep it evaluated no longer."""
        if self._installed:
            self._installed = False
            self._owner.remove(self)

    # --- firing: decided under the lock, told in order when it is released

    def _rise(self) -> None:
        self._rises += 1
        if self._terms.hold is None:
            self._fire()
        else:
            self._hold()

    def _fire(self) -> None:
        self._told_true = True
        self._fired += 1
        self._tell(self._firing(truth=True))
        if self._terms.once:
            self.uninstall()
            self._owner.later(self._close)

    def _fall(self) -> None:
        if self._terms.hold is not None:
            self._owner.later(self._terms.hold.stop)
        if self._told_true:
            self._told_true = False
            self._tell(self._firing(truth=False))

    def _firing(self, *, truth: bool) -> Firing:
        return Firing(self, self._fired, self._owner.version, truth, self.witness)

    def _tell(self, firing: Firing) -> None:
        if firing.truth:
            self._owner.later(partial(self._wake, firing))
        for listening in self._listening.values():
            if firing.truth or listening.falls:
                self._owner.later(partial(self._call, listening, firing))

    def _call(self, listening: _Listening, firing: Firing) -> None:
        if not self._silent and not listening.ended:
            listening.listener(firing)

    def _wake(self, firing: Firing) -> None:
        with self._guard:
            if not self._silent:
                self._last = firing
                self._waiters.answer(firing)

    def _close(self) -> None:
        with self._guard:
            self._closed = True
            self._waiters.fail(ConditionCancelledError(f"{self.text} is cancelled and will not fire again"))

    def _hold(self) -> None:
        hold = self._terms.hold
        if hold is not None:
            self._owner.later(partial(self._start_hold, hold, hold.due(), partial(self._held, self._rises)))

    def _start_hold(self, hold: Hold, due: float, over: Callable[[], None]) -> None:
        if self._installed:
            hold.start(due, over)

    def _held(self, rises: int) -> None:
        """The clock says that it has been true for long enough, unless it has become true anew meanwhile."""
        with self._owner.lock:
            if self._installed and self._now.truth and self._rises == rises:
                self._fire()
        self._owner.deliver()
