"""Leaving out objects that another one can stand in for (S1.5), such as surfaces nothing lies on.

An object *o* is left out when it occurs in no initial fact, no goal and no number, and some object *s* that is
kept can take its place everywhere: for each ground action that mentions *o*, the action with *s* in the place
of *o* exists as well, needs no more, adds no less, deletes no more and costs no more (or changes nothing). Then
replacing *o* by *s* in a plan gives a plan without *o*, except where a fact about *o* and the same fact about *s*
must hold at the same time and one of them is deleted. There is no cheap proof that this cannot be, so a slice
without a plan says nothing, and the problem is tried as a whole.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from knowledge_base.facts import Fact, Value
from planning.plan import PlanStep
from planning.quantities import Bound, fluents

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from planning.groundwork import Way
    from planning.numbering import Numbering
    from planning.reduction import Task

_Mentions = dict[str, dict[int, None]]


def spared(task: Task) -> list[Way]:
    """The ways that are left when all objects are left out that others can stand in for."""
    settled = set(_settled(task))
    mentions = _mentions(task, settled)
    by_step: dict[PlanStep | None, list[Way]] = {}
    for way in task.ways:
        by_step.setdefault(way.step, []).append(way)
    stand_ins = _stand_ins(task, settled)
    left_out = [
        [task.ways[i] for i in numbers]
        for name, numbers in mentions.items()
        if any(
            all(_covered(task.ways[i], name, other, task.numbering, by_step) for i in numbers) for other in stand_ins
        )
    ]
    gone = {id(way) for ways in left_out for way in ways}
    return [way for way in task.ways if id(way) not in gone]


def _settled(task: Task) -> Iterator[Value]:
    """The objects that must stay."""
    for number in (*task.init, *task.goal):
        yield from _things(task.numbering.named(number))
    for way in task.ways:
        for one in way.assignments:
            for fluent in (one.fluent, *fluents(one.amount)):
                yield from fluent.args
        for need in way.needs if task.numbering.supports else ():  # there are no bounds without
            if isinstance(bound := task.numbering.named(need), Bound):
                yield from _things(bound)


def _things(one: Fact | Bound) -> Iterator[Value]:
    for fact in (one,) if isinstance(one, Fact) else one.fluents():
        yield from fact.args


def _stand_ins(task: Task, settled: set[Value]) -> list[str]:
    """The objects that stay, as far as ways are about them; in an order that depends on the task alone."""
    named = dict.fromkeys(arg for way in task.ways if way.step for arg in way.step.args)
    return [name for name in named if name in settled]


def _mentions(task: Task, settled: set[Value]) -> _Mentions:
    """Open object -> the numbers of the ways that mention it."""
    about: dict[int, list[str]] = {}
    found: _Mentions = {}
    for i, way in enumerate(task.ways):
        for arg in way.step.args if way.step else ():
            if arg not in settled:
                found.setdefault(arg, {})[i] = None
        for number in (*way.needs, *way.adds, *way.deletes):
            named = about.get(number)
            if named is None:
                things = _things(task.numbering.named(number))
                named = about[number] = [str(thing) for thing in things if thing not in settled]
            for name in named:
                found.setdefault(name, {})[i] = None
    return found


def _covered(
    way: Way, name: str, other: str, numbering: Numbering, by_step: Mapping[PlanStep | None, Sequence[Way]]
) -> bool:
    """Whether a way with `other` in the place of `name` is as good."""
    rename = numbering.renaming(name, other)
    needs = set(map(rename, way.needs))
    adds = set(map(rename, way.adds))
    if adds <= needs:
        return True
    deletes = set(map(rename, way.deletes))
    return any(
        needs.issuperset(real.needs)
        and adds <= {*real.adds, *real.needs}
        and deletes.issuperset(real.deletes)
        and set(real.assignments) == set(way.assignments)
        and (real.cost or 0) <= (way.cost or 0)
        for real in by_step.get(_renamed(way.step, name, other), ())
    )


def _renamed(step: PlanStep | None, name: str, other: str) -> PlanStep | None:
    return step and PlanStep(step.action, tuple([other if arg == name else arg for arg in step.args]))
