"""Installed condition: its truth at every version, and the notifications about changes of its truth."""

from __future__ import annotations

from collections.abc import Callable, Container
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from pathlib import Path
from threading import Lock
from types import TracebackType
from typing import Self

from knowledge_base.conditions.damping import Hold, Terms
from knowledge_base.conditions.join import ConditionRow
from knowledge_base.conditions.notification import Notifier, Waiters
from knowledge_base.errors import ConditionCancelledError, InputError
from knowledge_base.facts import Value
from knowledge_base.tracebacks import calling_place

_HERE = str(Path(__file__).parents[1])


@dataclass(frozen=True, slots=True)
class Firing:
    """One firing of a condition, or its change to false, as listeners receive it.

    Attributes:
        condition: the condition that fired or became false.
        number: the number of firings of the condition so far.
        version: the version of the knowledge base at the firing.
        truth: whether the condition is true; false only for listeners that subscribe with `falls`.
        witness: values of the free variables that made the condition true at this version; `None` when it is false.
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
    """A condition that the knowledge base evaluates at every version; `KnowledgeBase.install` creates it.

    Any thread may use the condition. A `with` block cancels the condition at its end.

    Attributes:
        text: the condition with the values of its parameters, for messages.
        number: the number in the order of installation; within a version, conditions fire in this order.
        truth: whether the condition is true at the latest version; a cancelled condition keeps its last truth.
        version: the latest version that changed the truth or the witness.
        origin: the line that has installed the condition; `None` if it is unknown.
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
        rise, _ = rows
        self.rows: tuple[ConditionRow, ...] = rows
        self.text = text
        self.number = number
        self.truth = rise.truth
        self.version = notifier.version
        self.origin = calling_place(_HERE)
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
        """Values of the free variables that make the condition true; `None` when it is false.

        The mapping is empty if the condition has no free variables.
        """
        found = self._witness
        return None if found is None else dict(zip(self._names, found, strict=True))

    @property
    def error(self) -> InputError | None:
        """The error that prevents the evaluation at present, e.g. a division by zero.

        The condition is then false. `None` without an error.
        """
        with self._notifier.lock:
            return next((e for row in self.rows if (e := row.error) is not None), None)

    @property
    def fired(self) -> int:
        """Number of delivered firings."""
        return 0 if self._last is None else self._last.number

    @property
    def cancelled(self) -> bool:
        """Whether the condition is no longer installed."""
        return not self._installed

    def subscribe(self, listener: FiringListener, *, falls: bool = False) -> Callable[[], None]:
        """Call `listener` at every later firing, and with `falls` also when the condition becomes false.

        The calls follow the commit, after the lock is released. Their order is the commit order and, within a version,
        the order of installation. `KnowledgeBase.subscribe` describes the handling of errors. The returned function
        ends the subscription.
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
        """Wait for the next firing and return it.

        With `after`, immediately return the last firing if its number is greater than `after`.

        Raises:
            ConditionCancelledError: the condition is cancelled before or during the wait.
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
        """Remove the condition and discard its undelivered notifications; a second call has no effect."""
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

    # --- called under the lock

    def begin(self) -> None:
        """Start the hold time if the condition is true at its installation."""
        if self.truth:
            self._hold()

    def evaluate(self, version: int, changed: Container[ConditionRow]) -> None:
        """Compare the present truth with the truth before `version`, and notify the listeners of a difference.

        `changed` contains the rows with changed witnesses, among them at least one row of this condition.
        """
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
            self.rows = ()  # the latest cancelled conditions stay for inspection, without their compiled parts

    # --- firing: determined under the lock, delivered in order after its release

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
        self._listening = {}  # a cancelled condition stays for inspection, and its listeners do not

    def _cancelled_error(self) -> ConditionCancelledError:
        return ConditionCancelledError(f"{self.text} is cancelled and will not fire again")

    def _hold(self) -> None:
        hold = self._terms.hold
        if hold is not None:
            self._notifier.queue(partial(self._start_hold, hold, hold.due(), partial(self._fire_held, self._rises)))

    def _start_hold(self, hold: Hold, due: float, over: Callable[[], None]) -> None:
        if self._installed:
            hold.start(due, over)

    def _fire_held(self, rises: int) -> None:
        """Fire at the end of the hold time, unless the condition became false meanwhile."""
        with self._notifier.lock:
            if self._installed and self.truth and self._rises == rises:
                self._fire()
        self._notifier.deliver()
