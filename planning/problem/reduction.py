"""Reduction of a ground problem (S1.5): removal of useless operators and of objects that other objects can replace.

Pruning is exact: the pruned problem has a plan if and only if the original problem has a plan of equal cost.

An object *o*, such as a surface with nothing on it, is removed if a kept object *s* can replace it. No initial fact,
goal or number may contain *o*. For each ground action with *o*, the action with *s* must exist. The action with *s*
must need no more, add no less, delete no more and cost no more; or the action with *o* changes nothing.

Replacing *o* by *s* then turns a plan into a plan without *o*, with one exception. A fact about *o* and the same fact
about *s* may both be required while an action deletes one of them. No fast proof excludes this case. If a slice has no
plan, nothing is proven, and the engine solves the whole problem.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, filterfalse

from planning.model.quantities import fluents
from planning.problem.task import GroundOperator, LazyTable, Numbering, OperatorIndex, Task


def prune(task: Task, possible: Collection[int] | bytearray) -> Task:
    """Return the task without parts that cannot matter.

    Pruning removes operators that are impossible or cannot contribute, and literals that no condition reads. It also
    removes literals and bounds that hold initially and that no operator can falsify.

    Args:
        task: the task; it may already be pruned.
        possible: for each position, whether the operator is reachable (1) or not (0).
    """
    # Successive problems differ mostly in their facts. The key, possible operators and deletable facts, mostly stays
    # equal.
    key = (bytes(possible), task.goal, task.settled)
    kept = task.ways.known("slice" if task.left else "whole", lambda: _RelevantParts(task.ways, task.numbering))
    contribution = task.ways.known(key, lambda: _contributing(task, bytearray(possible)))
    settled = task.settled | contribution.lasting.intersection(task.init)
    left = kept.of(contribution.positions, contribution.wanted - settled, settled)
    goal = tuple([one for one in task.goal if one not in settled])
    present = set(task.init)
    needed = dict.fromkeys([*chain.from_iterable([way.needs for way in left.values()]), *goal])
    return replace(task, init=tuple([one for one in needed if one in present]), goal=goal, left=left, settled=settled)


class _RelevantParts:
    """A cache of the relevant parts of operators, most of which the next problem reuses."""

    def __init__(self, ways: OperatorIndex, numbering: Numbering) -> None:
        self._ways, self._numbering = ways, numbering
        self._asked: frozenset[int] = frozenset()
        self._settled: frozenset[int] = frozenset()
        self._left: dict[int, GroundOperator] = {}

    def of(self, positions: Iterable[int], asked: frozenset[int], settled: frozenset[int]) -> dict[int, GroundOperator]:
        """Return the relevant part of each operator that adds a literal in `asked`; the keys are operator positions."""
        left = self._left
        if left:
            for one in (asked ^ self._asked) | (settled ^ self._settled):
                for i in self._ways.touching.get(one, ()):
                    left.pop(i, None)
        self._asked, self._settled = asked, settled
        for i in positions:
            if i not in left:
                left[i] = _clean(self._ways.all[i], asked, settled, self._numbering)
        return {i: left[i] for i in positions if left[i].adds}


@dataclass(frozen=True, slots=True)
class _Contribution:
    """The literals and operators that contribute to a goal.

    Attributes:
        wanted: the literals and bounds of the goal, and those that contributing operators need.
        positions: the operators that add a wanted literal, or change a number of a wanted bound.
        lasting: the wanted literals that stay true after they become true, because no operator falsifies them.
    """

    wanted: frozenset[int]
    positions: Sequence[int]
    lasting: frozenset[int]


def _contributing(task: Task, open_: bytearray) -> _Contribution:
    """Return the contribution to the task's goal by the operators whose entry in `open_` is 1."""
    ways, adders, wants, settled = task.ways.all, task.ways.adders, task.numbering.wants, task.settled
    inputs = _inputs(ways, task.numbering)
    wanted, agenda = set(task.goal), list(task.goal)
    found: list[int] = []
    while agenda:
        here = agenda.pop()
        if wants or inputs:
            fresh = [one for one in (*wants.get(here, ()), *inputs.get(here, ())) if one not in wanted]
            wanted.update(fresh)
            agenda += fresh
        for i in adders.get(here, ()):
            if open_[i]:
                open_[i] = 0
                found.append(i)
                for need in ways[i].needs:
                    if need not in wanted and need not in settled:
                        wanted.add(need)
                        agenda.append(need)
    made = set[int]().union(*[ways[i].deletes for i in found])
    if task.numbering.fluents:
        made.update(one for i in found for one in ways[i].adds if one in task.numbering.fluents)
    lasting = frozenset(wanted - made)
    if wants:
        lasting = frozenset([one for one in lasting if made.isdisjoint(wants.get(one, ()))])
    return _Contribution(frozenset(wanted), sorted(found), lasting)


def _inputs(ways: Iterable[GroundOperator], numbering: Numbering) -> Mapping[int, Iterable[int]]:
    """Return, for each fluent, the fluents in the amounts that are assigned to it."""
    found: dict[int, set[int]] = {}
    for way in ways if numbering.fluents else ():
        for one in way.assignments:
            found.setdefault(numbering.fluent(one.fluent), set()).update(map(numbering.fluent, fluents(one.amount)))
    return found


def _clean(way: GroundOperator, asked: frozenset[int], settled: frozenset[int], numbering: Numbering) -> GroundOperator:
    needs = tuple(filterfalse(settled.__contains__, way.needs))
    return GroundOperator(
        way.step,
        needs,
        tuple(filterfalse(needs.__contains__, filter(asked.__contains__, way.adds))),
        tuple(filter(asked.__contains__, way.deletes)),
        tuple([a for a in way.assignments if numbering.fluent(a.fluent) in asked]) if way.assignments else (),
        way.cost,
        way.number,
    )


def find_redundant(task: Task) -> list[int]:
    """Return the positions of the redundant operators; each of them contains a replaceable object."""
    left, naming = task.left or {}, task.ways.naming
    mentions = _mentions(task, left, _find_fixed_objects(task, left))
    if not mentions:
        return []
    substitutes = [name for name in naming if name not in mentions and not left.keys().isdisjoint(naming[name])]
    exchanges: dict[tuple[str, str], _Exchange] = task.ways.known("exchanges", dict)
    last: dict[str, str] = task.ways.known("replaced", dict)
    gone: set[int] = set()
    for name, listed in mentions.items():
        # The object that replaced `name` in the last problem can usually replace it again.
        for other in [last[name], *substitutes] if last.get(name) in substitutes else substitutes:
            exchange = exchanges.get((name, other))
            if exchange is None:
                exchange = exchanges[name, other] = _Exchange(name, other, task)
            if exchange.covers(listed, left):
                last[name] = other
                gone.update(listed)
                break
    return sorted(gone)


def _find_fixed_objects(task: Task, left: Mapping[int, GroundOperator]) -> set[str]:
    """Return the objects that must not be removed."""
    objects, bounds = task.numbering.objects, task.numbering.bounds
    settled = set[str]().union(*map(objects.__getitem__, (*task.init, *task.goal)))
    for way in left.values() if task.numbering.fluents else ():
        for one in way.assignments:
            settled.update(str(arg) for fluent in (one.fluent, *fluents(one.amount)) for arg in fluent.args)
        settled.update(*[objects[need] for need in way.needs if need in bounds])
    return settled


def _mentions(task: Task, left: Mapping[int, GroundOperator], settled: set[str]) -> Mapping[str, Sequence[int]]:
    """Return, for each removable object, the operators with that object in their step or literals."""
    found: dict[str, dict[int, None]] = {}
    for name, positions in task.ways.naming.items():
        if name not in settled and (here := [i for i in positions if i in left]):
            found[name] = dict.fromkeys(here)
    about = task.ways.known("about", lambda: _about(task))
    for name in about.keys() - settled:
        mine = found.get(name, {})
        for one in about[name]:
            for i in task.ways.touching.get(one, ()):
                way = left.get(i)
                if i not in mine and way and (one in way.needs or one in way.adds or one in way.deletes):
                    mine[i] = None
        if mine:
            found[name] = mine
    return {name: sorted(positions) for name, positions in sorted(found.items())}


def _about(task: Task) -> Mapping[str, Sequence[int]]:
    """Return, for each object, the literals and bounds that contain it."""
    about: dict[str, list[int]] = {}
    for one in task.ways.touching:
        for thing in task.numbering.objects[one]:
            about.setdefault(thing, []).append(one)
    return about


class _Exchange:
    """The replacement of `name` by `other`; keeps the proof for each operator for the next problem."""

    def __init__(self, name: str, other: str, task: Task) -> None:
        self._name, self._other, self._ways = name, other, task.ways
        self._images = task.numbering.images(name, other)
        self._twins: LazyTable[Sequence[int]] = LazyTable(self._of_same_step)
        self._proofs: dict[int, tuple[GroundOperator, int, GroundOperator]] = {}

    def covers(self, positions: Iterable[int], left: Mapping[int, GroundOperator]) -> bool:
        """Return whether, for each of these operators about `name`, an operator about `other` is as good."""
        proofs = self._proofs
        for i in positions:
            proof = proofs.get(i)
            proven = proof is not None and proof[0] is left[i] and left.get(proof[1]) is proof[2]
            if not proven and not self._covers(i, left):
                return False
        return True

    def _covers(self, i: int, left: Mapping[int, GroundOperator]) -> bool:
        way, image = left[i], self._images.__getitem__
        needs, adds, deletes = set(map(image, way.needs)), set(map(image, way.adds)), set(map(image, way.deletes))
        for j in self._twins[i]:
            twin = left.get(j)
            if (
                twin is not None
                and needs.issuperset(twin.needs)
                and adds.issubset((*twin.adds, *twin.needs))
                and deletes.issuperset(twin.deletes)
                and (twin.assignments == way.assignments or set(twin.assignments) == set(way.assignments))
                and (twin.cost or 0) <= (way.cost or 0)
            ):
                self._proofs[i] = (way, j, twin)
                return True
        if adds <= needs:  # the operator adds nothing
            self._proofs[i] = (way, i, way)
            return True
        return False

    def _of_same_step(self, i: int) -> Sequence[int]:
        """Return the operators of the step in which `other` replaces `name`."""
        step = self._ways.all[i].step
        if step is None:
            return self._ways.of_step.get(None, ())
        args = tuple([self._other if arg == self._name else arg for arg in step.args])
        return self._ways.of_step.get((step.action, args), ())
