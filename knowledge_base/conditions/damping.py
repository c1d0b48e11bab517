"""Terms on which a condition fires: edge or each, once, a hold time measured by an injected clock, hysteresis."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, Protocol

from knowledge_base.errors import InputError
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
from knowledge_base.user_objects import shown

Fire = Literal["edge", "each"]
FIRE: tuple[Fire, ...] = ("edge", "each")


class Timer(Protocol):
    """A scheduled call that has not been made yet."""

    def cancel(self) -> object:
        """Cancel the call."""
        ...


class TimerClock(Protocol):
    """A clock that schedules calls; every thread that commits a change may use it."""

    def now(self) -> float:
        """Return the time in seconds since a fixed time."""
        ...

    def call_later(self, delay_s: float, callback: Callable[[], None]) -> Timer:
        """Call `callback` once, after `delay_s` seconds."""
        ...


class Hold:
    """A timer for the time during which a condition is true.

    `due` is computed under the lock when the truth changes. `start` and `stop` are called after the lock is released,
    in commit order.
    """

    def __init__(self, clock: TimerClock, seconds: float) -> None:
        self._clock = clock
        self._seconds = seconds
        self._timer: Timer | None = None

    def due(self) -> float:
        """Return the time at which a condition that becomes true now will fire."""
        return self._clock.now() + self._seconds

    def start(self, due: float, over: Callable[[], None]) -> None:
        """Schedule the call of `over` at the time `due`."""
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
    """Return the checked terms on which a condition fires; see `KnowledgeBase.install`.

    Raises:
        InputError: an unknown value of `fire`; a hold time that is negative, not finite, or without a clock.
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
    """Return `e` with the bound of each comparison moved by `margin`, so that the condition is true more easily.

    `(> (temperature ?t) 60)` becomes `(> (temperature ?t) (- 60 margin))`; under `not`, bounds move in the other
    direction. `=` and `!=` are unchanged.

    Raises:
        InputError: the margin is not a positive number, or the condition has no comparison with `<`, `<=`, `>` or `>=`.
    """
    if isinstance(margin, bool) or not isinstance(margin, int | float) or not 0 < margin < math.inf:
        raise InputError(f"hysteresis is a positive number, not {margin!r}")
    found = _relax(e, margin)
    if found == e:
        raise InputError("hysteresis is for conditions with '<', '<=', '>' or '>=', and here is none", place=e.place)
    return found


def _relax(e: Expression, margin: float) -> Expression:
    """Return `e` with each bound moved: a positive margin makes `e` easier to satisfy, a negative margin harder."""
    match e:
        case Comparison(operator, _, right) if operator in (*_UP, *_DOWN):
            eased = -margin if operator in _UP else margin
            moved = Arithmetic("+" if eased > 0 else "-", (right, Constant(abs(eased))), place=right.place)
            return replace(e, right=moved)
        case Not(body):
            return replace(e, body=_relax(body, -margin))
        case And(parts) | Or(parts):
            return replace(e, parts=tuple([_relax(p, margin) for p in parts]))
        case Imply(premise, conclusion):
            return replace(e, premise=_relax(premise, -margin), conclusion=_relax(conclusion, margin))
        case Exists(_, body) | Forall(_, body):
            return replace(e, body=_relax(body, margin))
        case _:
            return e
