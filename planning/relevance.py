"""What matters for a goal (S1.5): predicates and actions first, then ground actions and facts.

Everything here is exact: there is a plan for what is kept if and only if there is one for the whole.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from knowledge_base.language.effect import Add, AllOf, Assign, Delete, Effect, ForEach, When
from knowledge_base.language.expression import Atom, Expression, Term, parts_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Sequence

    from knowledge_base.facts import Fact
    from planning.domain import PlanningAction
    from planning.strips import GroundAction


def relevant_actions(goal: Expression, actions: Iterable[PlanningAction]) -> tuple[PlanningAction, ...]:
    """The actions that change a predicate which the goal, or another relevant action, asks about."""
    needed = set(predicates_of(goal))
    found: dict[str, PlanningAction] = {}
    waiting = list(actions)
    while fresh := [a for a in waiting if needed & set(changed_predicates(a.effect))]:
        waiting = [a for a in waiting if a not in fresh]
        for action in fresh:
            found[action.name] = action
            needed.update(predicates_of(action.precondition))
            needed.update(p for c in effect_conditions(action.effect) for p in predicates_of(c))
    return tuple(a for a in actions if a.name in found)


def predicates_of(e: Expression | Term) -> Iterator[str]:
    """The predicates (and types) an expression asks about."""
    if isinstance(e, Atom):
        yield e.predicate
    for part in parts_of(e):
        yield from predicates_of(part)


def effect_leaves(effect: Effect) -> Iterator[Add | Delete | Assign]:
    """The changes an effect consists of."""
    match effect:
        case AllOf(parts):
            for part in parts:
                yield from effect_leaves(part)
        case ForEach(_, body) | When(_, body):
            yield from effect_leaves(body)
        case _:
            yield effect


def effect_conditions(effect: Effect) -> Iterator[Expression]:
    """The conditions of all conditional effects."""
    match effect:
        case AllOf(parts):
            for part in parts:
                yield from effect_conditions(part)
        case ForEach(_, body):
            yield from effect_conditions(body)
        case When(condition, body):
            yield condition
            yield from effect_conditions(body)


def changed_predicates(effect: Effect) -> Iterator[str]:
    """The predicates an effect adds or deletes."""
    for leaf in effect_leaves(effect):
        if not isinstance(leaf, Assign):
            yield leaf.atom.predicate


def reachable(init: Iterable[Fact], actions: Sequence[GroundAction]) -> tuple[set[Fact], list[GroundAction]]:
    """Facts and actions that are possible when nothing ever becomes false (the delete relaxation)."""
    facts, agenda, applicable = set(init), list(init), set()
    missing = [len(a.precondition) for a in actions]
    users: dict[Fact, list[int]] = {}
    for number, action in enumerate(actions):
        for fact in action.precondition:
            users.setdefault(fact, []).append(number)
    ready = [number for number, count in enumerate(missing) if count == 0]
    while ready or agenda:
        if not ready:
            for number in users.get(agenda.pop(), ()):
                missing[number] -= 1
                if missing[number] == 0:
                    ready.append(number)
            continue
        number = ready.pop()
        applicable.add(number)
        fresh = [fact for fact in actions[number].adds if fact not in facts]
        facts.update(fresh)
        agenda.extend(fresh)
    return facts, [actions[number] for number in sorted(applicable)]


def pruned(
    init: Collection[Fact], goal: tuple[Fact, ...], actions: Sequence[GroundAction]
) -> tuple[tuple[Fact, ...], tuple[Fact, ...], tuple[GroundAction, ...]]:
    """Initial facts, goal and actions with everything left out that cannot matter.

    Left out are actions that can never be taken or cannot contribute to the goal, facts that no kept action
    or goal asks for, and facts that hold now and can never be deleted (they hold whenever asked for).
    """
    init = dict.fromkeys(init)
    _, possible = reachable(init, actions)
    kept = _contributing(goal, possible)
    deletable = {fact for action in kept for fact in action.deletes}
    settled = {fact for fact in init if fact not in deletable}
    asked = {fact for action in kept for fact in action.precondition}.union(goal) - settled
    clean = [_restricted(action, asked, settled) for action in kept]
    return (
        tuple(fact for fact in init if fact in asked),
        tuple(fact for fact in dict.fromkeys(goal) if fact not in settled),
        tuple(action for action in clean if action.adds),
    )


def _contributing(goal: Iterable[Fact], actions: Sequence[GroundAction]) -> list[GroundAction]:
    """The actions that add something the goal, or another contributing action, asks for."""
    adders: dict[Fact, list[int]] = {}
    for number, action in enumerate(actions):
        for fact in action.adds:
            adders.setdefault(fact, []).append(number)
    wanted, agenda, found = set(goal), list(goal), set()
    while agenda:
        for number in adders.get(agenda.pop(), ()):
            if number not in found:
                found.add(number)
                fresh = [fact for fact in actions[number].precondition if fact not in wanted]
                wanted.update(fresh)
                agenda.extend(fresh)
    return [actions[number] for number in sorted(found)]


def _restricted(action: GroundAction, asked: Collection[Fact], settled: Collection[Fact]) -> GroundAction:
    precondition = tuple(fact for fact in action.precondition if fact not in settled)
    return replace(
        action,
        precondition=precondition,
        adds=tuple(fact for fact in action.adds if fact in asked and fact not in precondition),
        deletes=tuple(fact for fact in action.deletes if fact in asked),
    )
