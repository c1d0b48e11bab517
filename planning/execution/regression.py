"""What must hold before a step so that a condition holds after it: regression (Waldinger 1977, Reiter 1991).

Conditions are rewritten as they stand, quantifiers and all, and not grounded first: `(forall (?l - lamp) (on ?l))`
before `(switch-on a)` is `(forall (?l - lamp) (or (on ?l) (= ?l a)))`, which a lamp that is yet unknown can break.
The parts of what is needed before a whole plan are its causal links from the present.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from knowledge_base.language.effect import Add, AllOf, Delete, Effect, ForEach, NumericEffect, When
from knowledge_base.language.expression import (
    TRUE,
    And,
    Arithmetic,
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
    TypedVariable,
    Variable,
    free_variables,
)
from knowledge_base.language.renaming import fresh, renamed, renamed_term

FALSE = Or(())
_CHANGING = {"increase": "+", "decrease": "-", "scale-up": "*", "scale-down": "/"}


class UnregressableError(Exception):
    """A number changes for many things at once, by an amount of their own: no condition before says as much."""


@dataclass(frozen=True, slots=True)
class Leaf:
    """One change that an effect makes: for all `variables`, where `condition` held before."""

    variables: tuple[TypedVariable, ...]
    condition: Expression
    change: Add | Delete | NumericEffect


def leaves(effect: Effect) -> tuple[Leaf, ...]:
    """The changes that an effect consists of; its parameters must have been filled in."""
    return tuple(_leaves(effect, (), TRUE))


def regressed(e: Expression, changes: Sequence[Leaf]) -> Expression:
    """What must hold before these changes are made so that `e` holds after them.

    Raises:
        UnregressableError: see there.
    """
    match e:
        case Atom():
            return _atom(e, changes)
        case Not(body):
            return negation(regressed(body, changes))
        case And(parts) | Or(parts):
            join = conjunction if isinstance(e, And) else disjunction
            return join(regressed(part, changes) for part in parts)
        case Imply(premise, conclusion):
            return disjunction((negation(regressed(premise, changes)), regressed(conclusion, changes)))
        case Exists(_, body) | Forall(_, body):
            within = regressed(body, changes)
            empty = FALSE if isinstance(e, Exists) else TRUE
            return empty if within == empty else replace(e, body=within)
        case Comparison():
            return _comparison(e, changes)


def conjuncts(e: Expression) -> tuple[Expression, ...]:
    """The parts of a conjunction, nested ones flattened; of `(and)` none."""
    return tuple(inner for part in e.parts for inner in conjuncts(part)) if isinstance(e, And) else (e,)


def conjunction(parts: Iterable[Expression]) -> Expression:
    """All of them, simplified."""
    kept = dict.fromkeys(inner for part in parts for inner in conjuncts(part))
    return FALSE if FALSE in kept else _alone(And(tuple(kept)))


def disjunction(parts: Iterable[Expression]) -> Expression:
    """At least one of them, simplified."""
    kept = dict.fromkeys(inner for part in parts for inner in (part.parts if isinstance(part, Or) else (part,)))
    return TRUE if TRUE in kept else _alone(Or(tuple(kept)))


def negation(e: Expression) -> Expression:
    """The opposite, simplified."""
    if isinstance(e, Not):
        return e.body
    return FALSE if e == TRUE else TRUE if e == FALSE else Not(e)


def _alone(e: And | Or) -> Expression:
    return e.parts[0] if len(e.parts) == 1 else e


def _leaves(effect: Effect, variables: tuple[TypedVariable, ...], condition: Expression) -> Iterator[Leaf]:
    match effect:
        case AllOf(parts):
            for part in parts:
                yield from _leaves(part, variables, condition)
        case ForEach(more, inner):
            yield from _leaves(inner, (*variables, *more), condition)
        case When(needed, inner):
            yield from _leaves(inner, variables, conjunction((condition, needed)))
        case _:
            yield Leaf(variables, condition, effect)


def _atom(atom: Atom, changes: Sequence[Leaf]) -> Expression:
    """It was added, or held and was not deleted (an addition wins over a deletion, as everywhere)."""
    added: list[Expression] = []
    deleted: list[Expression] = []
    for leaf in changes:
        if not isinstance(leaf.change, NumericEffect) and leaf.change.atom.predicate == atom.predicate:
            hit = _hit(leaf, leaf.change.atom.args, atom.args)
            (added if isinstance(leaf.change, Add) else deleted).append(hit)
    if not added and not deleted:
        return atom
    return disjunction((conjunction((atom, negation(disjunction(deleted)))), *added))


def _comparison(e: Comparison, changes: Sequence[Leaf]) -> Expression:
    if isinstance(e.left, Constant | Variable) and isinstance(e.right, Constant | Variable):
        return _decided(e.operator, e.left, e.right) or e  # as that does below, only sooner
    return disjunction(
        conjunction((before_left, before_right, _compared(e.operator, new_left, new_right)))
        for before_left, new_left in _values(e.left, changes)
        for before_right, new_right in _values(e.right, changes)
    )


def _hit(leaf: Leaf, own: tuple[Term, ...], asked: tuple[Term, ...]) -> Expression:
    """When the change is about just these arguments."""
    taken = frozenset[str]().union(*map(free_variables, asked))
    names = {v.name: fresh(v.name, taken) for v in leaf.variables if v.name in taken}
    variables = tuple(replace(v, name=names.get(v.name, v.name)) for v in leaf.variables)
    same = (_compared("=", renamed_term(mine, names), other) for mine, other in zip(own, asked, strict=True))
    matching = conjunction((*same, renamed(leaf.condition, names)))
    return Exists(variables, matching) if variables and matching != FALSE else matching


def _compared(operator: str, left: Term, right: Term) -> Expression:
    return _decided(operator, left, right) or Comparison(operator, left, right)


def _decided(operator: str, left: Term, right: Term) -> Expression | None:
    """`TRUE` or `FALSE` where that does not depend on the world or on variables."""
    if operator in ("=", "!=") and isinstance(left, Constant) and isinstance(right, Constant):
        return TRUE if (left.value == right.value) is (operator == "=") else FALSE
    return TRUE if operator == "=" and isinstance(left, Variable) and left == right else None


def _values(term: Term, changes: Sequence[Leaf]) -> list[tuple[Expression, Term]]:
    """What the term's value after the changes is before them, by cases that exclude each other."""
    match term:
        case Call(function, args):
            cases: list[tuple[Expression, Term]] = [(TRUE, term)]
            for leaf in changes:
                if isinstance(leaf.change, NumericEffect) and leaf.change.call.function == function:
                    cases = [new for case in cases for new in _assigned(case, leaf, leaf.change, args)]
            return cases
        case Arithmetic(_, args):
            combined: list[tuple[Expression, tuple[Term, ...]]] = [(TRUE, ())]
            for arg in args:
                combined = [
                    (conjunction((before, also)), (*values, value))
                    for before, values in combined
                    for also, value in _values(arg, changes)
                ]
            return [(before, replace(term, args=values)) for before, values in combined]
        case _:
            return [(TRUE, term)]


def _assigned(
    case: tuple[Expression, Term], leaf: Leaf, change: NumericEffect, args: tuple[Term, ...]
) -> Iterator[tuple[Expression, Term]]:
    before, value = case
    if free_variables(change.value) & {v.name for v in leaf.variables}:
        raise UnregressableError
    hit = _hit(leaf, change.call.args, args)
    operator = _CHANGING.get(change.operator)
    new = change.value if operator is None else Arithmetic(operator, (value, change.value))
    for condition, result in ((hit, new), (negation(hit), value)):
        needed = conjunction((before, condition))
        if needed != FALSE:
            yield needed, result
