"""Removal of objects that another object can replace (S1.5), such as surfaces with nothing on them.

Object *o* is removed if no initial fact, goal or number mentions it and a kept object *s* can replace it. For each
ground action with *o*, the action with *s* must exist. It needs no more, adds no less, deletes no more and costs no
more; or the action changes nothing.

Replacing *o* by *s* then turns a plan into one without *o*, with one exception. A fact about *o* and the same fact
about *s* may both be required while an action deletes one of them. No cheap proof excludes this case. A slice without a
plan therefore proves nothing, and the engine solves the whole problem.
"""

from __future__ import annotations

from itertools import chain
from typing import TYPE_CHECKING

from knowledge_base.facts import Fact, Value
from planning.quantities import NumericBound, fluents

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from planning.problem.operators import GroundOperator
    from planning.problem.reduction import Task


def spared(task: Task) -> list[int]:
    """Return the positions of the operators that are redundant, since each mentions a replaceable object."""
    left = task.left or {}
    settled = frozenset(map(str, _settled(task, left)))
    mentions = _mentions(task, left, settled)
    if not mentions:
        return []
    naming = task.ways.naming
    stand_ins = [name for name in naming if name not in mentions and any(i in left for i in naming[name])]
    before: dict[str, _Exchange] = task.ways.known("exchanges", dict)
    gone: set[int] = set()
    for name, listed in mentions.items():
        # The same object mostly replaces it again.
        known = [before[name]] if name in before and before[name].other in stand_ins else []
        exchanges = chain(known, (_Exchange(name, other, task) for other in stand_ins))
        exchange = next((one for one in exchanges if one.covers(listed, left)), None)
        if exchange is not None:
            before[name] = exchange
            gone.update(listed)
    return sorted(gone)


def _mentions(task: Task, left: Mapping[int, GroundOperator], settled: frozenset[str]) -> Mapping[str, Sequence[int]]:
    """Return a mapping from each removable object to the operators with it in their step or literals."""
    found: dict[str, dict[int, None]] = {}
    for name, positions in task.ways.naming.items():
        if name not in settled and (here := [i for i in positions if i in left]):
            found[name] = dict.fromkeys(here)
    about = task.ways.known("about", lambda: _about(task))
    for name in about.keys() - settled:
        mine = found.get(name, {})
        for one in about[name]:
            for i in task.ways.touching.get(one, ()):
                if i not in mine and i in left and _touches(left[i], one):
                    mine[i] = None
        if mine:
            found[name] = mine
    return {name: sorted(positions) for name, positions in sorted(found.items())}


def _touches(way: GroundOperator, one: int) -> bool:
    return one in way.needs or one in way.adds or one in way.deletes


def _about(task: Task) -> Mapping[str, Sequence[int]]:
    """Return a mapping from each object to the literals and bounds about it."""
    about: dict[str, list[int]] = {}
    for one in task.ways.touching:
        for thing in {str(thing) for thing in _things(task.numbering.named(one))}:
            about.setdefault(thing, []).append(one)
    return about


def _settled(task: Task, left: Mapping[int, GroundOperator]) -> Iterator[Value]:
    """Yield the objects that must stay."""
    for number in (*task.init, *task.goal):
        yield from _things(task.numbering.named(number))
    for way in left.values() if task.numbering.fluents else ():
        for one in way.assignments:
            for fluent in (one.fluent, *fluents(one.amount)):
                yield from fluent.args
        for need in way.needs:
            if isinstance(bound := task.numbering.named(need), NumericBound):
                yield from _things(bound)


def _things(one: Fact | NumericBound) -> Iterator[Value]:
    for fact in (one,) if isinstance(one, Fact) else one.fluents():
        yield from fact.args


class _Exchange:
    """The replacement of `name` by `other`, with the operator that covered each one, for the next problem."""

    def __init__(self, name: str, other: str, task: Task) -> None:
        self.other = other
        self._name = name
        self._images = task.numbering.images(name, other)
        self._of_step = task.ways.of_step
        self._proofs: dict[int, tuple[GroundOperator, int, GroundOperator]] = {}

    def covers(self, positions: Iterable[int], left: Mapping[int, GroundOperator]) -> bool:
        """Return whether an operator about `other` is as good as each of these operators, which mention `name`."""
        proofs = self._proofs
        for i in positions:
            proof = proofs.get(i)
            proven = proof is not None and proof[0] is left[i] and left.get(proof[1]) is proof[2]
            if not proven and not self._covers(i, left):
                return False
        return True

    def _covers(self, i: int, left: Mapping[int, GroundOperator]) -> bool:
        way, images = left[i], self._images
        needs = tuple([images[one] for one in way.needs])
        adds = tuple([images[one] for one in way.adds])
        deletes = tuple([images[one] for one in way.deletes])
        for j, real in self._reals(way, left):
            if (
                (needs == real.needs or set(needs).issuperset(real.needs))
                and (adds == real.adds or set(adds) <= {*real.adds, *real.needs})
                and (deletes == real.deletes or set(deletes).issuperset(real.deletes))
                and set(real.assignments) == set(way.assignments)
                and (real.cost or 0) <= (way.cost or 0)
            ):
                self._proofs[i] = (way, j, real)
                return True
        if set(adds) <= set(needs):  # the operator adds nothing
            self._proofs[i] = (way, i, way)
            return True
        return False

    def _reals(self, way: GroundOperator, left: Mapping[int, GroundOperator]) -> Iterator[tuple[int, GroundOperator]]:
        there = None
        if way.step is not None:
            args = tuple([self.other if arg == self._name else arg for arg in way.step.args])
            there = way.step.action, args
        return ((j, left[j]) for j in self._of_step.get(there, ()) if j in left)
