"""Attributes of events with which the guards of a plot are true."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from dsc.model.states import State
from dsc.model.transitions import Transition
from knowledge_base.language.evaluation.terms import ORDER
from knowledge_base.language.syntax.expression import Comparison, Constant, Term, Variable
from knowledge_base.language.syntax.rewriting import inside

EVENT = "event."
"""Beginning of the variables of a guard that are attributes of its event."""
_MIRRORED = {"<": ">", ">": "<", "<=": ">=", ">=": "<="}


def guard_values(around: Iterable[State]) -> dict[str, dict[str, Any]]:
    """Return for each event of states the attributes with which the comparisons of its first guard are true."""
    found: dict[str, dict[str, Any]] = {}
    for state in around:
        for event, ways in state.on.items():
            for way in ways:
                found[event] = values_in(way) | found.get(event, {})
    return found


def values_in(way: Transition) -> dict[str, Any]:
    """Return the attributes with which the comparisons of a guard with constants are true."""
    compared = [] if way.guard is None else [one for one in inside(way.guard) if isinstance(one, Comparison)]
    values: dict[str, Any] = {}
    for one in compared:
        for left, operator, right in (
            (one.left, one.operator, one.right),
            (one.right, _MIRRORED.get(one.operator, one.operator), one.left),
        ):
            if isinstance(left, Variable) and left.name.startswith(EVENT):
                values.setdefault(left.name.removeprefix(EVENT), _value(operator, right))
    return {name: value for name, value in values.items() if value is not None}


def _value(operator: str, bound: Term) -> Any:
    """Return a value for which the comparison with a bound is true; `None` if the operands may have any type."""
    if not isinstance(bound, Constant):
        return 1 if operator in ORDER else None
    value = bound.value
    if isinstance(value, bool):
        return value is (operator == "=")
    if isinstance(value, str):
        return value if operator == "=" else f"not {value}"
    return value + {">": 1, "!=": 1, "<": -1}.get(operator, 0)
