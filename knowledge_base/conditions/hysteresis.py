"""Hysteresis: the condition that keeps another one true when its numbers have gone back a little."""

from __future__ import annotations

import math
from dataclasses import replace

from knowledge_base.errors import InputError
from knowledge_base.language.expression import (
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
