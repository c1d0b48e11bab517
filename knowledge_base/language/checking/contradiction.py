"""Test whether conditions contradict each other in every world, by their form.

A reported contradiction is certain; conditions without a reported contradiction may still exclude each other. The
analysis covers an atom and its negation, comparisons of one term with constants, and `and`, `or`, `imply` and `not` of
these. A quantified condition counts as one atom; `(not (forall ...))` equals `(exists (... not ...))`.
"""

from __future__ import annotations

import math
import operator as operators
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from knowledge_base.facts import Value
from knowledge_base.language.syntax.expression import (
    And,
    Comparison,
    Constant,
    Exists,
    Expression,
    Forall,
    Imply,
    Not,
    Or,
    Term,
)
from knowledge_base.language.syntax.text import to_text

MOST_CASES = 512
"""Maximum number of cases in which a part of a condition is true.

With more cases, no contradiction is reported.
"""

MOST_TOGETHER = 64
"""Maximum number of literals in one case; with more literals, no contradiction is reported."""

_OPPOSITE = {"=": "!=", "!=": "=", "<": ">=", ">=": "<", ">": "<=", "<=": ">"}
_MIRRORED = {"=": "=", "!=": "!=", "<": ">", ">": "<", "<=": ">=", ">=": "<="}


def contradictory(*conditions: Expression) -> bool:
    """Return whether these conditions are certainly never true together."""
    try:
        return not _cases(_normal(And(conditions), holds=True))
    except _TooManyError:
        return False


def implied(condition: Expression, by: Expression) -> bool:
    """Return whether `condition` is certainly true in every world in which `by` is true."""
    return contradictory(by, Not(condition))


def complete(conditions: Iterable[Expression]) -> bool:
    """Return whether in every world at least one of the conditions is certainly true."""
    return contradictory(*map(Not, conditions))


def subjects(condition: Expression) -> frozenset[str]:
    """Return the subjects of a condition as text: its atoms, and the terms that it compares with constants."""
    return frozenset(literal.about for literal in _literals(_normal(condition, holds=True)))


@dataclass(frozen=True, slots=True)
class _Literal:
    """A comparison that is true or false.

    Attributes:
        about: an atom, or a compared term, as text.
        operator: the operator of the comparison; an atom is compared with a truth value.
        value: the constant on the right side.
    """

    about: str
    operator: str
    value: Value


_Case = tuple[_Literal, ...]


def _normal(e: Expression, *, holds: bool) -> Expression:
    """Return the condition, or its negation if not `holds`, in normal form.

    In the normal form, `not` occurs only in front of atoms and quantifiers, and the only quantifier is `exists`.
    """
    match e:
        case Not(body):
            found = _normal(body, holds=not holds)
        case And(parts) | Or(parts):
            kind = And if isinstance(e, And) is holds else Or
            found = kind(tuple(_normal(part, holds=holds) for part in parts))
        case Imply(premise, conclusion):
            found = _normal(Or((Not(premise), conclusion)), holds=holds)
        case Comparison(operator, left, right):
            found = _order(operator if holds else _OPPOSITE[operator], left, right)
        case Forall(variables, body):
            found = _normal(Exists(variables, Not(body)), holds=not holds)
        case _:
            inner = replace(e, body=_normal(e.body, holds=True)) if isinstance(e, Exists) else e
            found = inner if holds else Not(inner)
    return found


def _order(operator: str, left: Term, right: Term) -> Comparison:
    """Return the comparison with a constant on the right, or with other terms in a fixed order."""
    swapped = isinstance(left, Constant) or (not isinstance(right, Constant) and to_text(right) < to_text(left))
    return Comparison(_MIRRORED[operator], right, left) if swapped else Comparison(operator, left, right)


class _TooManyError(Exception):
    """A condition has more than `MOST_CASES` cases, or a case has more than `MOST_TOGETHER` literals."""


def _cases(e: Expression) -> list[_Case]:
    """Return the cases in which a condition is true, each a conjunction of literals.

    Cases that contradict themselves are omitted.
    """
    match e:
        case And(parts):
            cases: list[_Case] = [()]
            for part in parts:
                others = _cases(part)
                longest = max(map(len, cases), default=0) + max(map(len, others), default=0)
                if len(cases) * len(others) > MOST_CASES or longest > MOST_TOGETHER:
                    raise _TooManyError
                both = ((*case, *other) for case in cases for other in others)
                cases = [case for case in both if _possible(case)]
            return cases
        case Or(parts):
            return [case for part in parts for case in _cases(part)]
        case _:
            return [(_literal(e),)]


def _literals(e: Expression) -> Iterator[_Literal]:
    if isinstance(e, And | Or):
        for part in e.parts:
            yield from _literals(part)
    else:
        yield _literal(e)


def _literal(e: Expression) -> _Literal:
    match e:
        case Comparison(operator, left, Constant(value)):
            return _Literal(to_text(left), operator, value)
        case Comparison("=" | "!=" as operator, left, right):
            return _Literal(f"(= {to_text(left)} {to_text(right)})", "=", operator == "=")
        case Comparison("<" | ">=" as operator, left, right):
            return _Literal(f"(< {to_text(left)} {to_text(right)})", "=", operator == "<")
        case Comparison(operator, left, right):
            return _Literal(f"(> {to_text(left)} {to_text(right)})", "=", operator == ">")
        case Not(body):
            return _Literal(to_text(body), "=", value=False)
        case _:
            return _Literal(to_text(e), "=", value=True)


def _possible(case: _Case) -> bool:
    about: dict[str, list[_Literal]] = {}
    for literal in case:
        about.setdefault(literal.about, []).append(literal)
    return all(map(_some_value, about.values()))


def _some_value(literals: list[_Literal]) -> bool:
    """Return whether some value satisfies all these comparisons."""
    equal = [one.value for one in literals if one.operator == "="]
    if equal:
        return all(_compares(equal[0], one) for one in literals)
    bounds = [(one.operator, one.value) for one in literals if isinstance(one.value, int | float)]
    least = max((value for operator, value in bounds if operator in {">", ">="}), default=-math.inf)
    most = min((value for operator, value in bounds if operator in {"<", "<="}), default=math.inf)
    return least < most or (least == most and all(_compares(least, one) for one in literals))


def _compares(value: Value, literal: _Literal) -> bool:
    other = literal.value
    if literal.operator in {"=", "!="}:
        same = value == other and isinstance(value, bool) is isinstance(other, bool)
        return same is (literal.operator == "=")
    if isinstance(value, str) or isinstance(other, str):
        return False
    return _ORDERS[literal.operator](value, other)


_ORDERS: Mapping[str, Callable[[float, float], bool]] = {
    "<": operators.lt, "<=": operators.le, ">": operators.gt, ">=": operators.ge,
}  # fmt: skip
