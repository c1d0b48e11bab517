"""Terms on which a condition fires: edge or each, once, hold time by an injected clock, hysteresis."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, Protocol

from knowledge_base.errors import InputError
from knowledge_base.language.checking.inputs import shown
from knowledge_base.language.syntax.expression import (
    And,
    Arithmetic,
    Comparison,
    Constant,
    Exists,
    Expression,
    Forall,
    Imply,
    Not,
    Or,
)

Fire = Literal["edge", "each"]
FIRE: tuple[Fire, ...] = ("edge", "each")


class Timer(Protocol):
    """A call that is due later."""

    def cancel(self) -> object:
        """Cancel the call."""
        ...


class TimerClock(Protocol):
    """Gives the time and calls back; any thread that commits a change uses both."""

    def now(self) -> float:
        """Seconds from some fixed moment."""
        ...

    def call_later(self, delay_s: float, callback: Callable[[], None]) -> Timer:
        """Call `callback` once after that time."""
        ...


class Hold:
    """A timer that runs while a condition is true.

    `due` is computed when the truth changes, under the lock; `start` and `stop` follow outside the lock, in commit
    order.
    """

    def __init__(self, clock: TimerClock, seconds: float) -> None:
        self._clock = clock
        self._seconds = seconds
        self._timer: Timer | None = None

    def due(self) -> float:
        """Return the time at which a condition that becomes true now fires."""
        return self._clock.now() + self._seconds

    def start(self, due: float, over: Callable[[], None]) -> None:
        """Call `over` at that time."""
        self._timer = self._clock.call_later(max(0.0, due - self._clock.now()), over)

    def stop(self) -> None:
        """Cancel the timer."""
        timer, self._timer = self._timer, None
        if timer is not None:
            timer.cancel()


@dataclass(frozen=True, slots=True)
class Terms:
    """Terms on which a condition fires; see `KnowledgeBase.install`."""

    fire: Fire
    once: bool
    hold: Hold | None


def terms(fire: Fire, *, hold_s: float, once: bool, clock: TimerClock | None) -> Terms:
    """Return the terms on which a condition fires, checked; see `KnowledgeBase.install`.

    Raises:
        InputError: an unknown way to fire, a time that is negative or not finite, or one without a clock.
    """
    if fire not in FIRE:
        message = f"a condition fires at an 'edge' or at 'each' change, not {shown(fire)}"
        raise InputError(message, found=str(fire), valid=FIRE)
    if isinstance(hold_s, bool) or not isinstance(hold_s, int | float) or not 0 <= hold_s < math.inf:
        raise InputError(f"a hold time is a number of seconds, 0 or more, not {shown(hold_s)}")
    if not hold_s:
        return Terms(fire, once, None)
    if clock is None:
        raise InputError(f"to hold for {hold_s} s a condition needs a clock: install(..., clock=...)")
    return Terms(fire, once, Hold(clock, hold_s))


_UP, _DOWN = (">", ">="), ("<", "<=")


def relaxed(e: Expression, margin: float) -> Expression:
    """Return `e` with the bound of each comparison moved by `margin`, so that it is true more easily.

    `(> (temperature ?t) 60)` becomes `(> (temperature ?t) (- 60 margin))`; under `not` bounds move the other way.
    `=` and `!=` stay.

    Raises:
        InputError: the margin is not a positive number, or no comparison has a bound.
    """
    if isinstance(margin, bool) or not isinstance(margin, int | float) or not 0 < margin < math.inf:
        raise InputError(f"hysteresis is a positive number, not {margin!r}")
    found = _relaxed(e, margin)
    if found == e:
        raise InputError("hysteresis is for conditions with '<', '<=', '>' or '>=', and here is none", place=e.place)
    return found


def _relaxed(e: Expression, margin: float) -> Expression:
    """Return `e` made easier by a positive margin, harder by a negative one."""
    match e:
        case Comparison(operator, _, right) if operator in (*_UP, *_DOWN):
            eased = -margin if operator in _UP else margin
            moved = Arithmetic("+" if eased > 0 else "-", (right, Constant(abs(eased))), place=right.place)
            return replace(e, right=moved)
        case Not(body):
            return replace(e, body=_relaxed(body, -margin))
        case And(parts) | Or(parts):
            return replace(e, parts=tuple([_relaxed(p, margin) for p in parts]))
        case Imply(premise, conclusion):
            return replace(e, premise=_relaxed(premise, -margin), conclusion=_relaxed(conclusion, margin))
        case Exists(_, body) | Forall(_, body):
            return replace(e, body=_relaxed(body, margin))
        case _:
            return e
