"""Pruning of a ground problem (S1.5): keep the operators that are possible and can contribute to the goal.

Pruning is exact: the pruned problem has a plan if and only if the whole one has, at the same cost.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING

from planning.problem.operators import GroundOperator, OperatorIndex
from planning.quantities import fluents

if TYPE_CHECKING:
    from collections.abc import Collection, Container, Iterable, Iterator, Mapping, Sequence

    from planning.problem.numbering import Numbering


@dataclass(frozen=True, slots=True)
class Task:
    """A ground problem in numbers.

    Attributes:
        numbering: the facts, bounds and fluents of the numbers.
        init: literals and bounds that hold.
        goal: literals and bounds to reach.
        ways: the ground operators.
        left: position of an operator -> its relevant part; `None` before pruning.
        settled: literals and bounds that pruning removed, since they hold in every reachable state.
    """

    numbering: Numbering
    init: Collection[int]
    goal: tuple[int, ...]
    ways: OperatorIndex
    left: Mapping[int, GroundOperator] | None = None
    settled: frozenset[int] = frozenset()


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
