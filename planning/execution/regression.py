"""Regression: the condition that must hold before a step so that another holds after it (Waldinger 1977, Reiter 1991).

Regression rewrites conditions with their quantifiers, without grounding. For example, `(forall (?l - lamp) (on ?l))`
before `(switch-on a)` becomes `(forall (?l - lamp) (or (on ?l) (= ?l a)))`. A new lamp can falsify this condition.
The conditions before a whole plan are the causal links from the present world.
"""

from __future__ import annotations

import operator
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from knowledge_base.errors import InputError
from knowledge_base.language.evaluation.lookups import conjuncts
from knowledge_base.language.syntax.durative import FALSE
from knowledge_base.language.syntax.effect import Add, AllOf, Delete, Effect, ForEach, NumericEffect, When, check_depth
from knowledge_base.language.syntax.expression import (
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
    fresh,
    is_equality,
    substitute,
)
from knowledge_base.language.syntax.rewriting import names_of
from knowledge_base.owner_cache import cache_on_owner
from planning.model.domain import GroundStep, PlanningDomain
from planning.model.plan import PlanStep
from planning.problem.expressions import changed

_CHANGING = {"increase": "+", "decrease": "-", "scale-up": "*", "scale-down": "/"}


class UnregressableError(Exception):
    """Error: an effect changes a number by different amounts for many objects, so regression is not possible."""


@dataclass(frozen=True, slots=True)
class Leaf:
    """One change by an effect, for all values of `variables` for which `condition` held before the effect."""

    variables: tuple[TypedVariable, ...]
    condition: Expression
    change: Add | Delete | NumericEffect


def leaves(effect: Effect) -> tuple[Leaf, ...]:
    """Return the changes of an effect; the parameters must have been substituted."""
    return tuple(_leaves(effect, (), TRUE))


def regressed(e: Expression, changes: Sequence[Leaf]) -> Expression:
    """Return the condition that must hold before these changes so that `e` holds after them.

    A condition that the changes do not concern is returned as it is, since a long plan regresses it many times.

    Raises:
        UnregressableError: there is no such condition for these changes.
    """
    match e:
        case Atom():
            return _atom(e, changes)
        case Not(body):
            before = regressed(body, changes)
            return e if before is body else negation(before)
        case And(parts) | Or(parts):
            join = conjunction if isinstance(e, And) else disjunction
            all_before = [regressed(part, changes) for part in parts]
            return e if all(map(operator.is_, all_before, parts)) else join(all_before)
        case Imply(premise, conclusion):
            return disjunction((negation(regressed(premise, changes)), regressed(conclusion, changes)))
        case Exists(_, body) | Forall(_, body):
            within = regressed(body, changes)
            empty = FALSE if isinstance(e, Exists) else TRUE
            return e if within is body else empty if within == empty else replace(e, body=within)
        case Comparison():
            return _comparison(e, changes)


def conjunction(parts: Iterable[Expression]) -> Expression:
    """Return the simplified conjunction of the conditions: `(not p)` of an equality `p` removes `p` from an `or`.

    A long plan would otherwise nest a condition once for each step.
    """
    kept = dict.fromkeys(inner for part in parts for inner in conjuncts(part))
    if FALSE in kept:
        return FALSE
    different = {one.body for one in kept if isinstance(one, Not) and _is_equality(one.body)}
    for one in kept if different else ():
        if isinstance(one, Or) and not different.isdisjoint(one.parts):
            rest = disjunction(part for part in one.parts if part not in different)
            return conjunction(rest if other is one else other for other in kept)
    return _alone(And(tuple(kept)))


def disjunction(parts: Iterable[Expression]) -> Expression:
    """Return the simplified disjunction of the conditions: an equality `p` removes `(not p)` from an `and`."""
    kept = dict.fromkeys(inner for part in parts for inner in (part.parts if isinstance(part, Or) else (part,)))
    if TRUE in kept:
        return TRUE
    equal = set(filter(_is_equality, kept))
    for one in kept if equal else ():
        if isinstance(one, And) and any(isinstance(part, Not) and part.body in equal for part in one.parts):
            rest = conjunction(part for part in one.parts if not (isinstance(part, Not) and part.body in equal))
            return disjunction(rest if other is one else other for other in kept)
    return _alone(Or(tuple(kept)))


def negation(e: Expression) -> Expression:
    """Return the simplified negation of the condition."""
    if isinstance(e, Not):
        return e.body
    return FALSE if e == TRUE else TRUE if e == FALSE else Not(e)


def _is_equality(e: Expression) -> bool:
    """Return whether the condition consists of equalities of variables and constants, which no world leaves open."""
    if isinstance(e, And):
        return bool(e.parts) and all(map(_is_equality, e.parts))
    return is_equality(e)


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
    """Return the condition that the atom was added, or was true and not deleted; an addition overrides a deletion."""
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
        return _decide(e.operator, e.left, e.right) or e  # a shortcut with the result of the general case
    return disjunction(
        conjunction((before_left, before_right, _make_comparison(e.operator, new_left, new_right)))
        for before_left, new_left in _values(e.left, changes)
        for before_right, new_right in _values(e.right, changes)
    )


def _hit(leaf: Leaf, own: tuple[Term, ...], asked: tuple[Term, ...]) -> Expression:
    """Return the condition under which the change concerns exactly these arguments."""
    taken = frozenset[str]().union(*map(free_variables, asked))
    names = {v.name: Variable(fresh(v.name, taken)) for v in leaf.variables if v.name in taken}
    variables = tuple(replace(v, name=names.get(v.name, v).name) for v in leaf.variables)
    same = (_make_comparison("=", substitute(mine, names), other) for mine, other in zip(own, asked, strict=True))
    matching = conjunction((*same, substitute(leaf.condition, names)))
    return Exists(variables, matching) if variables and matching != FALSE else matching


def _make_comparison(operator: str, left: Term, right: Term) -> Expression:
    return _decide(operator, left, right) or Comparison(operator, left, right)


def _decide(operator: str, left: Term, right: Term) -> Expression | None:
    """Return `TRUE` or `FALSE` if the comparison does not depend on the world or on variables; otherwise `None`."""
    if operator in ("=", "!=") and isinstance(left, Constant) and isinstance(right, Constant):
        return TRUE if (left.value == right.value) is (operator == "=") else FALSE
    return TRUE if operator == "=" and isinstance(left, Variable) and left == right else None


def _values(term: Term, changes: Sequence[Leaf]) -> list[tuple[Expression, Term]]:
    """Return the value of a term after the changes: mutually exclusive conditions, each with a term before them."""
    match term:
        case Call(function, args):
            cases: list[tuple[Expression, Term]] = [(TRUE, term)]
            for leaf in changes:
                if isinstance(leaf.change, NumericEffect) and leaf.change.call.function == function:
                    cases = [new for case in cases for new in _find_assignments(case, leaf, leaf.change, args)]
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


def _find_assignments(
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


class CausalNeeds:
    """The causal links from the present world to the steps of a plan, computed by regression.

    Args:
        steps: the steps of the plan, numbered from 1.
        domain: the planning domain.
        goal: the goal of the plan; it counts as the user after the last step.

    Raises:
        InputError: the domain lacks the action of a step.
    """

    def __init__(self, steps: Sequence[PlanStep], domain: PlanningDomain, goal: Expression) -> None:
        self._steps = [_Regressing.of(domain.ground(step)) for step in steps]
        self._names: dict[int, frozenset[str]] = {}  # by identity; `_found` keeps all conditions alive
        wanted = dict.fromkeys(conjuncts(goal), len(steps) + 1)
        self._found: dict[tuple[int, ...], _Found | None] = {(): _Found(wanted, tuple(filter(_is_open, wanted)))}

    def before(self, left: tuple[int, ...]) -> Mapping[Expression, int] | None:
        """Return the conditions that hold now exactly if the steps with these numbers, in this order, lead to the goal.

        Each condition has the number of the first step that needs it. The number of the goal is the number of
        steps plus one. The result is `None` if regression is not possible, see `UnregressableError`.
        """
        known = next(cut for cut in range(len(left) + 1) if left[cut:] in self._found)
        for cut in range(known - 1, -1, -1):  # a loop, since recursion would be too deep for a long plan
            self._found[left[cut:]] = self._prepend(left[cut], self._found[left[cut + 1 :]])
        found = self._found[left]
        return None if found is None else MappingProxyType(found.needed)

    def _prepend(self, number: int, after: _Found | None) -> _Found | None:
        if after is None:
            return None
        step = self._steps[number - 1]
        own = dict.fromkeys(step.needed, number)
        brought, touched = self._split_needs(step, after)
        rest = dict(after.needed)
        for condition in brought:
            del rest[condition]
        users = [rest.pop(condition) for condition in touched]
        needed = {**own, **rest, **own}
        fresh: list[Expression] = []
        try:
            for condition, user in zip(touched, users, strict=True):
                for part in conjuncts(regressed(condition, step.changes)):
                    check_depth(part)
                    before = len(needed)
                    needed.setdefault(part, user)  # hashed only once, since a condition may be long
                    if len(needed) > before and _is_open(part):
                        fresh.append(part)
        except (UnregressableError, InputError, RecursionError):  # or a condition that no query can read
            return None
        gone = set(map(id, touched))
        kept = [one for one in after.open if id(one) not in gone]
        if step.open:
            kept = [*step.open, *(one for one in kept if one not in own)]
        return _Found(needed, (*kept, *fresh))

    def _split_needs(self, step: _Regressing, after: _Found) -> tuple[list[Expression], list[Expression]]:
        """Return the later needs that the step always causes, and the later needs that the step may change.

        Both are usually few; all other needs stay unchanged.
        """
        plain, changed_here = step.plain, step.changed
        if plain is None:  # changes that depend on the world may affect each condition with one of their predicates
            return [], [one for one in after.needed if not changed_here.isdisjoint(self._about(one))]
        touched = [one for one in after.open if not changed_here.isdisjoint(self._about(one))]
        if not after.needed.keys().isdisjoint(plain.deletes):
            hit = {*plain.deletes, *touched}
            touched = [one for one in after.needed if one in hit]  # in the order of the needs
        return [atom for atom in plain.adds if atom in after.needed], touched

    def _about(self, condition: Expression) -> frozenset[str]:
        """Return the predicates and functions that the condition reads."""
        found = self._names.get(id(condition))
        if found is None:
            found = self._names[id(condition)] = frozenset(names_of(condition))
        return found


@dataclass(frozen=True, slots=True)
class _Found:
    """The needs before some steps, with the first user of each, and the needs that are not ground facts, in order."""

    needed: Mapping[Expression, int]
    open: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class _Regressing:
    """The parts of a step that regression uses.

    Attributes:
        needed: the conditions of the step, as an ordered set.
        open: the conditions that are not ground facts.
        changes: the changes by the step's effect.
        changed: the predicates and functions that the step changes.
        plain: the facts that the step adds and deletes in every world; `None` if there are other changes.
    """

    needed: Mapping[Expression, None]
    open: tuple[Expression, ...]
    changes: tuple[Leaf, ...]
    changed: frozenset[str]
    plain: _Plain | None

    @staticmethod
    @cache_on_owner
    def of(step: GroundStep) -> _Regressing:
        """Return the parts of a step; kept on it, since successive plans share most steps."""
        needed, changes = dict.fromkeys(conjuncts(step.typed)), leaves(step.effect)
        open_ = tuple(filter(_is_open, needed))
        return _Regressing(needed, open_, changes, changed(step.effect), _plain(changes))


@dataclass(frozen=True, slots=True)
class _Plain:
    """The ground facts that a step adds and deletes in every world."""

    adds: tuple[Expression, ...]
    deletes: tuple[Expression, ...]


def _plain(changes: Iterable[Leaf]) -> _Plain | None:
    """Return the changes that the step causes in every world; `None` if it may cause others."""
    adds: dict[Expression, None] = {}
    deletes: dict[Expression, None] = {}
    for one in changes:
        if one.variables or one.condition != TRUE or isinstance(one.change, NumericEffect) or _is_open(one.change.atom):
            return None
        (adds if isinstance(one.change, Add) else deletes)[one.change.atom] = None
    return _Plain(
        tuple(adds), tuple([atom for atom in deletes if atom not in adds])
    )  # an addition overrides a deletion


def _is_open(e: Expression) -> bool:
    """Return whether the condition is not a ground fact."""
    return not isinstance(e, Atom) or not all(isinstance(term, Constant) for term in e.args)
