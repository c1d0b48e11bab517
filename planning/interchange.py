"""Leaving out objects that another one can stand in for (S1.5), such as surfaces nothing lies on.

An object *o* is left out when it occurs in no initial fact and no goal, and some object *s* that is kept
can take its place everywhere: for each ground action that mentions *o*, the action with *s* in the place
of *o* exists as well, needs no more, adds no less and deletes no more (or changes nothing). Then replacing
*o* by *s* in a plan gives a plan without *o*, except where a fact about *o* and the same fact about *s* must
hold at the same time and one of them is deleted. There is no cheap proof that this cannot be, so a slice
without a plan says nothing, and the problem is tried as a whole.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from knowledge_base.facts import Fact, Value
from planning.plan import PlanStep
from planning.strips import GroundAction

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence


def spared(
    init: Iterable[Fact], goal: Iterable[Fact], actions: Sequence[GroundAction], candidates: Iterable[str]
) -> frozenset[str]:
    """Those of `candidates` that others can stand in for."""
    settled = {value for fact in (*init, *goal) for value in fact.args}
    mentioning = _by_object(actions)
    by_step: dict[PlanStep | None, list[GroundAction]] = {}
    for action in actions:
        by_step.setdefault(action.step, []).append(action)
    open_objects = [name for name in candidates if name in mentioning and name not in settled]
    stand_ins = [name for name in mentioning if name in settled]
    return frozenset(
        name
        for name in open_objects
        if any(_replaceable(name, other, mentioning[name], by_step) for other in stand_ins)
    )


def without(actions: Iterable[GroundAction], objects: frozenset[str]) -> list[GroundAction]:
    """The actions that do not mention the objects."""
    return [action for action in actions if not (objects & _mentioned(action))]


def _by_object(actions: Iterable[GroundAction]) -> Mapping[Value, list[GroundAction]]:
    found: dict[Value, list[GroundAction]] = {}
    for action in actions:
        for value in sorted(_mentioned(action), key=str):
            found.setdefault(value, []).append(action)
    return found


def _mentioned(action: GroundAction) -> set[Value]:
    in_facts = {value for fact in action.facts() for value in fact.args}
    return in_facts.union(action.step.args if action.step else ())


def _replaceable(
    name: str,
    other: Value,
    actions: Iterable[GroundAction],
    by_step: Mapping[PlanStep | None, Sequence[GroundAction]],
) -> bool:
    return all(_covered(_renamed(action, name, other), by_step) for action in actions)


def _covered(image: GroundAction, by_step: Mapping[PlanStep | None, Sequence[GroundAction]]) -> bool:
    if set(image.adds) <= set(image.precondition):
        return True
    return any(
        set(real.precondition) <= set(image.precondition)
        and set(image.adds) <= set(real.adds) | set(real.precondition)
        and set(real.deletes) <= set(image.deletes)
        for real in by_step.get(image.step, ())
    )


def _renamed(action: GroundAction, name: str, other: Value) -> GroundAction:
    def rename(facts: tuple[Fact, ...]) -> tuple[Fact, ...]:
        return tuple(Fact(f.predicate, tuple(other if v == name else v for v in f.args)) for f in facts)

    step = action.step
    if step is not None:
        step = PlanStep(step.action, tuple(str(other) if arg == name else arg for arg in step.args))
    return GroundAction(step, rename(action.precondition), rename(action.adds), rename(action.deletes))
