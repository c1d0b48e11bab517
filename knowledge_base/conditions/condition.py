"""An installed condition: its truth at every version, and the notifications when it changes."""

from __future__ import annotations

from collections.abc import Callable, Container
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from threading import Lock
from types import TracebackType
from typing import Self

from knowledge_base.conditions.damping import Hold, Terms
from knowledge_base.conditions.join import ConditionRow
from knowledge_base.conditions.notification import Notifier, Waiters
from knowledge_base.errors import ConditionCancelledError, InputError
from knowledge_base.facts import Value


@dataclass(frozen=True, slots=True)
class Firing:
    """A firing of a condition, or the end of its truth, as listeners receive it.

    Attributes:
        condition: the condition.
        number: the number of its firings so far.
        version: the version of the knowledge base.
        truth: whether it is true; false only for listeners that receive falls.
        witness: values of its free variables that made it true then; `None` when it is not.
    """

    condition: Condition
    number: int
    version: int
    truth: bool
    witness: dict[str, Value] | None


FiringListener = Callable[[Firing], None]


@dataclass(slots=True)
class _Listening:
    listener: FiringListener
    falls: bool
    ended: bool = field(default=False)


class Condition:
    """A condition that the knowledge base keeps evaluated; made by `KnowledgeBase.install`.

    Any thread may use it. As a context manager it is cancelled at the end of the block.

    Attributes:
        text: the condition with its parameters filled in, for messages.
        number: its number in the order of installation, which is the order of firing within a version.
        truth: whether it is true at the latest version; a cancelled condition keeps its last truth.
        version: the version that last changed its truth or its witness.
    """

    def __init__(
        self,
        text: str,
        rows: tuple[ConditionRow, ConditionRow],
        names: tuple[str, ...],
        terms: Terms,
        number: int,
        notifier: Notifier,
        remove: Callable[[Condition], None],
    ) -> None:
        rise, _ = self.rows = rows
        self.text = text
        self.number = number
        self.truth = rise.truth
        self.version = notifier.version
        self._witness = rise.witness
        self._names = names
        self._terms = terms
        self._notifier = notifier
        self._remove = remove
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
    def witness(self) -> dict[str, Value] | None:
        """Values of its free variables that make it true (`{}` if it has none); `None` when it is false."""
        found = self._witness
        return None if found is None else dict(zip(self._names, found, strict=True))

    @property
    def error(self) -> InputError | None:
        """The error that prevents its evaluation at present, e.g. a division by zero; it then counts as false."""
        with self._notifier.lock:
            return next((e for row in self.rows if (e := row.error) is not None), None)

    @property
    def fired(self) -> int:
        """Number of its firings that were delivered."""
        return 0 if self._last is None else self._last.number

    @property
    def cancelled(self) -> bool:
        """Whether it is no longer installed."""
        return not self._installed

    def subscribe(self, listener: FiringListener, *, falls: bool = False) -> Callable[[], None]:
        """Call `listener` at every firing from now on, with `falls` also when it becomes false.

        Calls follow the commit, outside the lock, in commit order and, within a version, in the order of installation.
        `KnowledgeBase.subscribe` describes errors of listeners. The function returned ends the subscription.
        """
        with self._notifier.lock:
            key = next(self._keys)
            self._listening[key] = listening = _Listening(listener, falls)

        def unsubscribe() -> None:
            with self._notifier.lock:
                listening.ended = True
                self._listening.pop(key, None)

        return unsubscribe

    async def wait(self, after: int | None = None) -> Firing:
        """Return the next firing; with `after`, the last one if its number is greater.

        Raises:
            ConditionCancelledError: it is cancelled, before or during the wait.
        """
        with self._guard:
            if after is not None and self._last is not None and self._last.number > after:
                return self._last
            if self._closed:
                raise self._cancelled_error()
            future = self._waiters.join()
        try:
            return await future
        finally:
            with self._guard:
                self._waiters.leave(future)

    def cancel(self) -> None:
        """Remove it and drop its undelivered notifications; cancelling it again has no effect."""
        self._silent = True
        with self._notifier.lock:
            self._uninstall()
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

    # --- under the lock

    def begin(self) -> None:
        """Start the hold time of a condition that is true when it is installed."""
        if self.truth:
            self._hold()

    def judge(self, version: int, changed: Container[ConditionRow]) -> None:
        """Compare its truth with the one before `version`, which `changed` the witnesses of at least one row."""
        rise, stay = self.rows
        was, self.truth = self.truth, rise.truth or (self.truth and stay.truth)
        if not (self.truth or was):
            return
        found = rise.witness
        self._witness = stay.witness if found is None and self.truth else found
        self.version = version
        if not self.truth:
            self._fall()
        elif was:
            if self._terms.fire == "each" and self._told_true and stay in changed:
                self._fire()
        else:
            self._rises += 1
            if self._terms.hold is None:
                self._fire()
            else:
                self._hold()

    def _uninstall(self) -> None:
        if self._installed:
            self._installed = False
            self._remove(self)

    # --- firing: decided under the lock, delivered in order when it is released

    def _fire(self) -> None:
        self._told_true = True
        self._fired += 1
        self._tell()
        if self._terms.once:
            self._uninstall()
            self._notifier.queue(self._close)

    def _fall(self) -> None:
        if self._terms.hold is not None:
            self._notifier.queue(self._terms.hold.stop)
        if self._told_true:
            self._told_true = False
            self._tell()

    def _tell(self) -> None:
        firing = Firing(self, self._fired, self._notifier.version, self.truth, self.witness)
        if firing.truth:
            self._notifier.queue(partial(self._wake, firing))
        for listening in self._listening.values():
            if firing.truth or listening.falls:
                self._notifier.queue(partial(self._call, listening, firing))

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
            self._waiters.answer(self._cancelled_error())

    def _cancelled_error(self) -> ConditionCancelledError:
        return ConditionCancelledError(f"{self.text} is cancelled and will not fire again")

    def _hold(self) -> None:
        hold = self._terms.hold
        if hold is not None:
            self._notifier.queue(partial(self._start_hold, hold, hold.due(), partial(self._held, self._rises)))

    def _start_hold(self, hold: Hold, due: float, over: Callable[[], None]) -> None:
        if self._installed:
            hold.start(due, over)

    def _held(self, rises: int) -> None:
        """Fire at the end of the hold time, unless the condition became false meanwhile."""
        with self._notifier.lock:
            if self._installed and self.truth and self._rises == rises:
                self._fire()
        self._notifier.deliver()
