"""What of a ground problem can matter (S1.5): what can ever happen, and what can contribute to the goal.

Everything here is exact: there is a plan for what is kept if and only if there is one for the whole, and it
costs the same.
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
        numbering: what they stand for.
        init: literals and bounds that hold.
        goal: literals and bounds that shall hold.
        ways: what may be done.
        left: position of a way -> what is left of it where not all matters; `None` if all of it and of all ways does.
        settled: literals and bounds that hold whenever they are asked for, and are left out.
    """

    numbering: Numbering
    init: Collection[int]
    goal: tuple[int, ...]
    ways: OperatorIndex
    left: Mapping[int, GroundOperator] | None = None
    settled: frozenset[int] = frozenset()


def pruned(task: Task, possible: Collection[int] | bytearray) -> Task:
    """The task with everything left out that cannot matter.

    Left out are ways that can never be taken or cannot contribute to the goal, literals that no kept way or goal
    asks for, and literals and bounds that hold now and can never cease to (they hold whenever asked for).

    Args:
        task: pruned before or not.
        possible: by position, whether a way may be taken (1) or not (0).
    """
    # From one problem to the next mostly other facts hold, but the same is possible, and the same can cease to hold.
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
    """What contributes, and what is left of it without what nobody asks for; mostly the same for the next problem."""

    def __init__(self, ways: OperatorIndex, numbering: Numbering) -> None:
        self._ways, self._numbering = ways, numbering
        self._asked: frozenset[int] = frozenset()
        self._settled: frozenset[int] = frozenset()
        self._left: dict[int, GroundOperator] = {}
        self._last: _Contribution | None = None

    def contribution(self, task: Task, possible: bytes) -> _Contribution:
        """What contributes to the task's goal if these ways are possible."""
        found = None if self._last is None else _still_contributing(self._last, task, possible)
        self._last = found or _contributing(task, possible)
        return self._last

    def of(self, positions: Iterable[int], asked: frozenset[int], settled: frozenset[int]) -> dict[int, GroundOperator]:
        """Of the ways at these positions, those that add something asked for, by position."""
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
    """What contributes to a goal.

    Attributes:
        task, possible: what was asked about.
        wanted: what the goal and the ways ask for, each with the position of the way (-1: the goal) because of which it
            was first found to be wanted; that way adds something that stands before it.
        positions: the ways that add something of it, or change a number that it depends on.
        lasting: what of it can never cease to hold, if it does: no way deletes it or changes its numbers.
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
    """The same where only some ways are not possible any more; `None` if it is not seen at a glance what is left then.

    What was wanted because of such a way has to be wanted because of another one.
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
    """Whether what is settled now, and was not, was not wanted, and nobody can need what is not settled any more."""
    if any(one in wanted for one in task.settled - before):
        return False
    return not any(possible[i] for one in before - task.settled for i in task.ways.users.get(one, ()))


class _Left:
    """What is left of what contributed where some ways are not possible any more."""

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
        """The ways that still contribute."""
        return [i for i in self._before.positions if self._useful[i]]

    def _dropped(self, lost: list[int]) -> set[int]:
        """What nobody wants any more, as the ways that wanted it are lost, or add nothing that is wanted."""
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
        """What is wanted, each with a way that is left; `None` if there is not one for each at a glance."""
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
        """A way that needs it and adds something that was found to be wanted before it."""
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
    """Fluent -> the fluents that amounts assigned to it depend on."""
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
