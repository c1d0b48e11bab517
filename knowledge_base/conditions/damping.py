"""Damping of conditions: hold time and hysteresis, measured with an injected clock."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

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


class Timer(Protocol):
    """A call that is due later."""

    def cancel(self) -> object:
        """Do not make the call."""
        ...


class TimerClock(Protocol):
    """Gives the time and calls back; both are used from whatever thread commits a change."""

    def now(self) -> float:
        """Seconds from some fixed moment."""
        ...

    def call_later(self, delay_s: float, callback: Callable[[], None]) -> Timer:
        """Call `callback` once when so many seconds have passed."""
        ...


class Hold:
    """A timer that runs while a condition is true.

    `due` is reckoned when the truth changes, under the lock; `start` and `stop` come later, outside the lock
    and in commit order.
    """

    def __init__(self, clock: TimerClock, seconds: float) -> None:
        self._clock = clock
        self._seconds = seconds
        self._timer: Timer | None = None

    def due(self) -> float:
        """When a condition that becomes true now has been true for long enough."""
        return self._clock.now() + self._seconds

    def start(self, due: float, over: Callable[[], None]) -> None:
        """Call `over` when it is that late."""
        self._timer = self._clock.call_later(max(0.0, due - self._clock.now()), over)

    def stop(self) -> None:
        """It has become false, or nobody asks any more."""
        timer, self._timer = self._timer, None
        if timer is not None:
            timer.cancel()


_UP, _DOWN = (">", ">="), ("<", "<=")


def relaxed(e: Expression, margin: float) -> Expression:
    """`e` with the bound of each comparison moved by `margin`, so that it is true more easily.

    `(> (temperature ?t) 60)` becomes `(> (temperature ?t) (- 60 margin))`; under `not` bounds move the other
    way. `=` and `!=` stay.

    Raises:
        InputError: the margin is not a positive number, or there is nothing to move.
    """
    if isinstance(margin, bool) or not isinstance(margin, int | float) or not 0 < margin < math.inf:
        raise InputError(f"hysteresis is a positive number, not {margin!r}")
    found = _relaxed(e, margin)
    if found == e:
        raise InputError("hysteresis is for conditions with '<', '<=', '>' or '>=', and here is none", place=e.place)
    return found


def _relaxed(e: Expression, margin: float) -> Expression:
    """`e` made easier by a positive margin, harder by a negative one."""
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
