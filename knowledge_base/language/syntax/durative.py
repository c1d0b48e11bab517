"""Durative actions as values (PDDL 2.1, Fox & Long 2003).

Without concurrency, a durative action is an ordinary action. Its precondition is the condition that lets the action run
alone; its effect is the change from its start to its end.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from knowledge_base.language.syntax.effect import NO_EFFECT, Add, AllOf, Delete, Effect, NumericEffect, When
from knowledge_base.language.syntax.expression import (
    TRUE,
    And,
    Atom,
    Call,
    Comparison,
    Constant,
    Exists,
    Expression,
    Forall,
    Imply,
    Not,
    Or,
    Term,
    free_variables,
)

FALSE = Or(())
"""`(or)`, the condition that is never true."""


@dataclass(frozen=True, slots=True)
class Duration:
    """The duration of an action in seconds, between two terms; a fixed duration has equal terms.

    For an action without an upper bound, `most` is the constant infinity.
    """

    least: Term
    most: Term

    @property
    def fixed(self) -> bool:
        """Whether the duration is fixed."""
        return self.least == self.most


@dataclass(frozen=True, slots=True)
class DurativeParts:
    """The conditions and effects of a durative action, by time.

    Attributes:
        start, end: the condition at the start, and the condition just before the end.
        over_all: the condition for the time between the start and the end.
        start_effect, end_effect: the change at the start, and the change at the end.
    """

    start: Expression = TRUE
    over_all: Expression = TRUE
    end: Expression = TRUE
    start_effect: Effect = NO_EFFECT
    end_effect: Effect = NO_EFFECT

    @property
    def precondition(self) -> Expression:
        """The condition before the action under which the action can start and end without other actions.

        The result contains the condition at the start. From the other conditions, the result contains the parts whose
        truth the start effect does not decide. The effect decides a part with the same predicate and the same
        variables.
        """
        later = [_after(e, self.start_effect, frozenset()) for e in (self.over_all, self.end)]
        return _conjunction([part for e in (self.start, *later) for part in _conjuncts(e)])

    @property
    def effect(self) -> Effect:
        """The net changes from the start to the end of the action, if no other action runs meanwhile."""
        undone = tuple(leaf.atom for leaf in _unconditional(self.end_effect) if isinstance(leaf, Delete))
        settled = set(_find_settled(self.end_effect))
        kept = (_unless(part, undone) for part in _parts(self.start_effect) if _find_changed(part) not in settled)
        parts = (*kept, *_parts(self.end_effect))
        return parts[0] if len(parts) == 1 else AllOf(parts)


def _conjuncts(e: Expression) -> tuple[Expression, ...]:
    return e.parts if isinstance(e, And) else (e,)


def _conjunction(parts: list[Expression]) -> Expression:
    kept = tuple(dict.fromkeys(parts))
    return kept[0] if len(kept) == 1 else And(kept)


def _after(e: Expression, effect: Effect, bound: frozenset[str]) -> Expression:
    """Return the condition before `effect` that makes `e` true after it (regression, by comparison of texts)."""
    match e:
        case Atom():
            said = {isinstance(leaf, Add) for leaf in _unconditional(effect) if _atom(leaf) == e}
            known = said and not bound & free_variables(e)
            return (TRUE if True in said else FALSE) if known else e
        case Not(body):
            inner = _after(body, effect, bound)
            opposite = TRUE if inner == FALSE else FALSE if inner == TRUE else None
            return Not(inner, place=e.place) if opposite is None else opposite
        case And(parts) | Or(parts):
            remaining = dict.fromkeys(_after(part, effect, bound) for part in parts)
            decided, neutral = (FALSE, TRUE) if isinstance(e, And) else (TRUE, FALSE)
            kept = tuple(part for part in remaining if part != neutral)
            return decided if decided in remaining else type(e)(kept, place=e.place)
        case Imply(premise, conclusion):
            return _after(Or((Not(premise), conclusion), place=e.place), effect, bound)
        case Exists(variables, body) | Forall(variables, body):
            return type(e)(variables, _after(body, effect, bound | {v.name for v in variables}), place=e.place)
        case Comparison():
            return e


def _parts(effect: Effect) -> Iterator[Effect]:
    if isinstance(effect, AllOf):
        for part in effect.parts:
            yield from _parts(part)
    else:
        yield effect


def _unconditional(effect: Effect) -> Iterator[Effect]:
    return (part for part in _parts(effect) if isinstance(part, Add | Delete | NumericEffect))


def _find_settled(effect: Effect) -> Iterator[Atom | Call | None]:
    """Yield the atoms and functions whose values after the effect do not depend on their values before."""
    for part in _unconditional(effect):
        if not isinstance(part, NumericEffect) or part.operator == "assign":
            yield _find_changed(part)


def _find_changed(part: Effect) -> Atom | Call | None:
    return part.call if isinstance(part, NumericEffect) else _atom(part)


def _atom(leaf: Effect) -> Atom | None:
    return leaf.atom if isinstance(leaf, Add | Delete) else None


def _unless(part: Effect, undone: tuple[Atom, ...]) -> Effect:
    """Return `part`, restricted so that it does not add a fact that the end effect deletes.

    Two atoms with different variables can denote the same fact.
    """
    if not isinstance(part, Add):
        return part
    same = [_same(part.atom, other) for other in undone]
    apart = tuple(Not(And(pairs)) for pairs in same if pairs is not None)
    return When(_conjunction(list(apart)), part) if apart else part


def _same(atom: Atom, other: Atom) -> tuple[Expression, ...] | None:
    """Return the equations under which both atoms denote one fact; `None` if they never denote one fact."""
    if atom.predicate != other.predicate or len(atom.args) != len(other.args):
        return None
    pairs = [(a, b) for a, b in zip(atom.args, other.args, strict=True) if a != b]
    if any(isinstance(a, Constant) and isinstance(b, Constant) for a, b in pairs):
        return None
    return tuple(Comparison("=", a, b) for a, b in pairs)
