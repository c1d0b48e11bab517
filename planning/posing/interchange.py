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
from planning.posing.ways import Way, Ways
from planning.quantities import Bound, fluents

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from planning.plan import PlanStep
    from planning.posing.numbering import Numbering
    from planning.posing.reduction import Task

_Key = tuple[str, tuple[str, ...]] | None


def spared(task: Task) -> Ways | None:
    """The ways that are left without the objects that others can stand in for; `None` if there are no such objects."""
    settled = frozenset(_settled(task))
    return task.ways.known(settled, lambda: _spared(task, settled))


def _spared(task: Task, settled: frozenset[Value]) -> Ways | None:
    ways = task.ways.all
    mentions = _mentions(task, settled)
    if not mentions:
        return None
    by_step: dict[_Key, list[Way]] = {}
    for way in ways:
        by_step.setdefault(_key(way.step), []).append(way)
    named = dict.fromkeys([arg for way in ways if way.step for arg in way.step.args])
    stand_ins = [name for name in named if name not in mentions]
    gone: set[int] = set()
    for name, listed in mentions.items():
        if any(_Exchange(name, other, task.numbering, by_step).covers(ways[i] for i in listed) for other in stand_ins):
            gone.update(listed)
    return Ways([way for i, way in enumerate(ways) if i not in gone]) if gone else None


def _mentions(task: Task, settled: frozenset[Value]) -> Mapping[str, Iterable[int]]:
    """Object that need not stay -> positions of the ways that mention it, in their step or in literals."""
    ways = task.ways.all
    about: dict[int, list[str]] = {}
    for one in set[int]().union(*[part for way in ways for part in (way.needs, way.adds, way.deletes)]):
        about[one] = [str(thing) for thing in _things(task.numbering.named(one)) if thing not in settled]
    telling = {one for one, names in about.items() if names}
    found: dict[str, dict[int, None]] = {}
    for i, way in enumerate(ways):
        for name in way.step.args if way.step else ():
            if name not in settled:
                found.setdefault(name, {})[i] = None
        for part in (way.needs, way.adds, way.deletes):
            if not telling.isdisjoint(part):
                for name in [name for one in part for name in about[one]]:
                    found.setdefault(name, {})[i] = None
    return found


def _settled(task: Task) -> Iterator[Value]:
    """The objects that must stay."""
    for number in (*task.init, *task.goal):
        yield from _things(task.numbering.named(number))
    for way in task.ways.all if task.numbering.fluents else ():
        for one in way.assignments:
            for fluent in (one.fluent, *fluents(one.amount)):
                yield from fluent.args
        for need in way.needs:
            if isinstance(bound := task.numbering.named(need), Bound):
                yield from _things(bound)


def _things(one: Fact | Bound) -> Iterator[Value]:
    for fact in (one,) if isinstance(one, Fact) else one.fluents():
        yield from fact.args


class _Exchange:
    """`other` in the place of `name`."""

    def __init__(self, name: str, other: str, numbering: Numbering, by_step: Mapping[_Key, Sequence[Way]]) -> None:
        self._name, self._other = name, other
        self._images = numbering.images(name, other)
        self._by_step = by_step

    def covers(self, ways: Iterable[Way]) -> bool:
        """Whether for each of the ways, all that mention `name`, there is one about `other` that is as good."""
        return all(map(self._covers, ways))

    def _covers(self, way: Way) -> bool:
        images = self._images
        needs = tuple([images[one] for one in way.needs])
        adds = tuple([images[one] for one in way.adds])
        deletes = tuple([images[one] for one in way.deletes])
        return any(
            (needs == real.needs or set(needs).issuperset(real.needs))
            and (adds == real.adds or set(adds) <= {*real.adds, *real.needs})
            and (deletes == real.deletes or set(deletes).issuperset(real.deletes))
            and set(real.assignments) == set(way.assignments)
            and (real.cost or 0) <= (way.cost or 0)
            for real in self._by_step.get(self._key(way), ())
        ) or set(adds) <= set(needs)

    def _key(self, way: Way) -> _Key:
        if way.step is None:
            return None
        return way.step.action, tuple([self._other if arg == self._name else arg for arg in way.step.args])


def _key(step: PlanStep | None) -> _Key:
    return None if step is None else (step.action, step.args)  # hashed much faster than the step
