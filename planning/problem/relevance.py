"""Relevance for a goal (S1.5): the relevant actions, predicates and functions; exact, like `reduction`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from knowledge_base.language.syntax.effect import Add, Delete, Effect, NumericEffect, effect_conditions, effect_leaves
from knowledge_base.language.syntax.expression import Atom, Call, Constant, Expression, Term, Variable, parts_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator

    from planning.domain import PlanningAction


@dataclass(frozen=True, slots=True)
class Relevant:
    """The relevant part of a domain for a goal.

    Attributes:
        actions: the planning actions that change a predicate or function that a goal or relevant condition reads.
        changing: the predicates that these actions change, and those changed functions that a condition or cost reads.
    """

    actions: tuple[PlanningAction, ...]
    changing: frozenset[str]


def relevant(goal: Expression, metric: Term | None, actions: Iterable[PlanningAction]) -> Relevant:
    """Return the actions that change what the goal or another relevant action reads; `metric` adds none."""
    actions, needed = tuple(actions), frozenset(names_of(goal))
    while True:
        found = tuple(action for action in actions if needed & changed(action.effect))
        more = needed.union(*(_asked(action, needed) for action in found))
        if more == needed:
            break
        needed = more
    leaves = [leaf for action in found for leaf in effect_leaves(action.effect)]
    counted = needed | _counted(metric, leaves)
    return Relevant(
        found,
        frozenset(name_of(one) for one in leaves if not isinstance(one, NumericEffect) or name_of(one) in counted),
    )


def _asked(action: PlanningAction, needed: Collection[str]) -> Iterator[str]:
    """Yield the names that the action reads, without amounts of functions that are not needed."""
    yield from names_of(action.precondition)
    for condition in effect_conditions(action.effect):
        yield from names_of(condition)
    yield from _amounts(effect_leaves(action.effect), needed)


def _amounts(leaves: Iterable[Add | Delete | NumericEffect], of: Collection[str]) -> Iterator[str]:
    """Yield the names in amounts assigned to these functions."""
    for leaf in leaves:
        if isinstance(leaf, NumericEffect) and name_of(leaf) in of:
            yield from names_of(leaf.value)


def _counted(metric: Term | None, leaves: Collection[Add | Delete | NumericEffect]) -> frozenset[str]:
    """Return the functions in the metric, and those in the amounts by which these change."""
    own = frozenset() if metric is None else frozenset(names_of(metric))
    return own.union(_amounts(leaves, own))


def names_of(e: Expression | Term) -> Iterator[str]:
    """Yield the predicates, types and functions in an expression."""
    agenda = [e]
    while agenda:
        one = agenda.pop()
        if isinstance(one, Constant | Variable):
            continue
        if isinstance(one, Atom):
            yield one.predicate
        elif isinstance(one, Call):
            yield one.function
        agenda.extend(reversed(parts_of(one)))


def name_of(leaf: Add | Delete | NumericEffect) -> str:
    """Return the predicate or function of a change."""
    return leaf.call.function if isinstance(leaf, NumericEffect) else leaf.atom.predicate


def changed(effect: Effect) -> frozenset[str]:
    """Return the predicates and functions that an effect changes."""
    return frozenset(map(name_of, effect_leaves(effect)))
