"""Reduction of a ground problem (S1.5): operators that can contribute to the goal, and objects that matter.

Pruning is exact: the pruned problem has a plan if and only if the whole one has, at the same cost.

Object *o* is removed, such as a surface with nothing on it, if a kept object *s* can replace it. No initial fact, goal
or number mentions *o*. For each ground action with *o*, the action with *s* exists. It needs no more, adds no less,
deletes no more and costs no more; or the action changes nothing.

Replacing *o* by *s* then turns a plan into one without *o*, with one exception. A fact about *o* and the same fact
about *s* may both be required while an action deletes one of them. No cheap proof excludes this case. A slice without a
plan therefore proves nothing, and the engine solves the whole problem.
"""

from __future__ import annotations

from collections.abc import Collection, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from knowledge_base.facts import Fact, Value
from planning.problem.task import GroundOperator, Numbering, OperatorIndex, Task
from planning.quantities import NumericBound, fluents


def pruned(task: Task, possible: Collection[int] | bytearray) -> Task:
    """Return the task without parts that cannot matter.

    Pruning removes operators that are impossible or cannot contribute, and literals that no condition reads. It also
    removes literals and bounds that hold now and that no operator can falsify.

    Args:
        task: a pruned or unpruned task.
        possible: by position, whether an operator is reachable (1) or not (0).
    """
    # The next problem differs mostly in its facts; possible operators and deletable facts, the key, stay the same.
    key = (bytes(possible), task.goal, task.settled)
    kept = task.ways.known("slice" if task.left else "whole", lambda: Restriction(task.ways, task.numbering))
    contribution = task.ways.known(key, lambda: kept.contribution(task, bytes(possible)))
    settled = task.settled | contribution.lasting.intersection(task.init)
    asked = frozenset(contribution.wanted) - settled
    left = kept.of(contribution.positions, asked, settled)
    goal = tuple([one for one in task.goal if one not in settled])
    present = set(task.init)
    needed = dict.fromkeys(chain.from_iterable([way.needs for way in left.values()]))
    init = tuple([one for one in (*needed, *(one for one in goal if one not in needed)) if one in present])
    return replace(task, init=init, goal=goal, left=left, settled=settled)


class Restriction:
    """A cache of contributing operators and their relevant parts; the next problem mostly reuses it."""

    def __init__(self, ways: OperatorIndex, numbering: Numbering) -> None:
        self._ways, self._numbering = ways, numbering
        self._asked: frozenset[int] = frozenset()
        self._settled: frozenset[int] = frozenset()
        self._left: dict[int, GroundOperator] = {}
        self._last: _Contribution | None = None

    def contribution(self, task: Task, possible: bytes) -> _Contribution:
        """Return the contribution to the task's goal by these possible operators."""
        found = None if self._last is None else _still_contributing(self._last, task, possible)
        self._last = found or _contributing(task, possible)
        return self._last

    def of(self, positions: Iterable[int], asked: frozenset[int], settled: frozenset[int]) -> dict[int, GroundOperator]:
        """Return by position the relevant parts of the operators that add a literal in `asked`."""
        if self._left:
            for one in (asked ^ self._asked) | (settled ^ self._settled):
                for i in self._ways.touching.get(one, ()):
                    self._left.pop(i, None)
        self._asked, self._settled = asked, settled
        left = self._left
        for i in positions:
            if i not in left:
                left[i] = _clean(self._ways.all[i], asked, settled, self._numbering)
        return {i: left[i] for i in positions if left[i].adds}


@dataclass(frozen=True, slots=True)
class _Contribution:
    """The literals and operators that contribute to a goal.

    Attributes:
        task, possible: the arguments it was computed for.
        wanted: the literals and bounds of the goal and of operators' needs. Each has the position of the operator that
            needs it (-1: the goal); that operator adds an earlier entry.
        positions: the operators that add a wanted literal, or change a number of a wanted bound.
        lasting: the wanted literals that stay true once they hold: no operator deletes them or changes their numbers.
    """

    task: Task
    possible: bytes
    wanted: Mapping[int, int]
    positions: Sequence[int]
    lasting: frozenset[int]


def _contributing(task: Task, possible: bytes) -> _Contribution:
    ways, adders, wants, settled = task.ways.all, task.ways.adders, task.numbering.wants, task.settled
    inputs, open_ = _inputs(ways, task.numbering), bytearray(possible)
    wanted, agenda = dict.fromkeys(task.goal, -1), list(task.goal)
    found: list[int] = []
    while agenda:
        here = agenda.pop()
        if wants or inputs:
            fresh = [one for one in (*wants.get(here, ()), *inputs.get(here, ())) if one not in wanted]
            wanted.update(dict.fromkeys(fresh, -1))
            agenda += fresh
        for i in adders.get(here, ()):
            if open_[i]:
                open_[i] = 0
                found.append(i)
                for need in ways[i].needs:
                    if need not in wanted and need not in settled:
                        wanted[need] = i
                        agenda.append(need)
    return _contribution(task, possible, wanted, sorted(found))


def _contribution(task: Task, possible: bytes, wanted: Mapping[int, int], found: Sequence[int]) -> _Contribution:
    ways, wants = task.ways.all, task.numbering.wants
    made = set[int]().union(*[ways[i].deletes for i in found])
    if task.numbering.fluents:
        made.update(one for i in found for one in ways[i].adds if one in task.numbering.fluents)
    lasting = frozenset(wanted.keys() - made)
    if wants:
        lasting = frozenset([one for one in lasting if made.isdisjoint(wants.get(one, ()))])
    return _Contribution(task, possible, wanted, found, lasting)


def _still_contributing(before: _Contribution, task: Task, possible: bytes) -> _Contribution | None:
    """Return the contribution after some operators became impossible; `None` if a quick test cannot decide.

    Each literal wanted by an impossible operator needs another operator that wants it.
    """
    if task.numbering.fluents or task.goal != before.task.goal or task.ways is not before.task.ways:
        return None
    if int.from_bytes(possible) & ~int.from_bytes(before.possible):
        return None
    if not _settled_alike(before.task.settled, task, before.wanted, possible):
        return None
    left = _Left(before, task, possible)
    wanted = left.wanted()
    return None if wanted is None else _contribution(task, possible, wanted, left.positions)


def _settled_alike(before: frozenset[int], task: Task, wanted: Container[int], possible: bytes) -> bool:
    """Return whether newly settled literals were not wanted, and no possible operator needs a no longer settled one."""
    if any(one in wanted for one in task.settled - before):
        return False
    return not any(possible[i] for one in before - task.settled for i in task.ways.users.get(one, ()))


class _Left:
    """The rest of a contribution after some of its operators became impossible."""

    def __init__(self, before: _Contribution, task: Task, possible: bytes) -> None:
        self._before, self._task = before, task
        self._useful = bytearray(len(possible))
        lost = []
        for i in before.positions:
            if possible[i]:
                self._useful[i] = 1
            else:
                lost.append(i)
        self._unwanted = self._dropped(lost)

    @property
    def positions(self) -> list[int]:
        """The operators that still contribute."""
        return [i for i in self._before.positions if self._useful[i]]

    def _dropped(self, lost: list[int]) -> set[int]:
        """Return the literals no longer wanted: their operators are lost, or add nothing wanted."""
        ways, goal, dropped, agenda = self._task.ways, set(self._task.goal), set[int](), list(lost)
        while agenda:
            for need in ways.all[agenda.pop()].needs:
                if need in goal or need in dropped or need not in self._before.wanted or self._is_needed(need):
                    continue
                dropped.add(need)
                for i in ways.adders.get(need, ()):
                    if self._useful[i] and not any(self._is_wanted(one, dropped) for one in self._brought(i)):
                        self._useful[i] = 0
                        agenda.append(i)
        return dropped

    def wanted(self) -> dict[int, int] | None:
        """Return each wanted literal with a remaining operator; `None` if a quick test finds none for one."""
        before, useful, unwanted = self._before.wanted, self._useful, self._unwanted
        orphans = [one for one, i in before.items() if i >= 0 and not useful[i] and one not in unwanted]
        place = {one: n for n, one in enumerate(before)} if orphans else {}
        others: dict[int, int] = {}
        for one in orphans:
            parent = self._parent(one, place)
            if parent is None:
                return None
            others[one] = parent
        return {one: others.get(one, i) for one, i in before.items() if one not in unwanted}

    def _parent(self, one: int, place: Mapping[int, int]) -> int | None:
        """Return an operator that needs the literal and adds one that was wanted before it."""
        here = place[one]
        for i in self._task.ways.users.get(one, ()):
            if self._useful[i]:
                brought = (add for add in self._brought(i) if add not in self._unwanted)
                if any(place.get(add, here) < here for add in brought):
                    return i
        return None

    def _is_needed(self, one: int) -> bool:
        return any(self._useful[i] for i in self._task.ways.users.get(one, ()))

    def _is_wanted(self, one: int, dropped: Container[int]) -> bool:
        return one in self._before.wanted and one not in dropped

    def _brought(self, i: int) -> Iterator[int]:
        way = self._task.ways.all[i]
        return (one for one in way.adds if one not in way.needs)


def _inputs(ways: Iterable[GroundOperator], numbering: Numbering) -> Mapping[int, Iterable[int]]:
    """Return a mapping from each fluent to the fluents in amounts assigned to it."""
    found: dict[int, set[int]] = {}
    for way in ways if numbering.fluents else ():
        for one in way.assignments:
            found.setdefault(numbering.fluent(one.fluent), set()).update(map(numbering.fluent, fluents(one.amount)))
    return found


def _clean(way: GroundOperator, asked: frozenset[int], settled: frozenset[int], numbering: Numbering) -> GroundOperator:
    needs = tuple([one for one in way.needs if one not in settled])
    return GroundOperator(
        way.step,
        needs,
        tuple([one for one in way.adds if one in asked and one not in needs]),
        tuple([one for one in way.deletes if one in asked]),
        tuple([a for a in way.assignments if numbering.fluent(a.fluent) in asked]) if way.assignments else (),
        way.cost,
        way.number,
    )


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
