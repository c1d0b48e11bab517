"""What of a ground problem can matter (S1.5): what can ever happen, and what can contribute to the goal.

Everything here is exact: there is a plan for what is kept if and only if there is one for the whole, and it
costs the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING

from planning.posing.ways import Way, Ways
from planning.quantities import Bound, fluents, helps

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from planning.posing.numbering import Numbering


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
    ways: Ways
    left: Mapping[int, Way] | None = None
    settled: frozenset[int] = frozenset()


@dataclass(frozen=True, slots=True)
class Reach:
    """What is possible when nothing ever becomes false (the delete relaxation).

    Attributes:
        facts: the literals, bounds and fluents reached.
        taken: by position, whether a way is possible (1) or not (0).
    """

    facts: set[int]
    taken: bytearray


def reachable(task: Task) -> Reach:
    """What can hold and happen; a bound counts as possible as soon as a number can change to its good."""
    ways, users, supports = task.ways.all, task.ways.users, task.numbering.supports
    reached, agenda = set(task.init), list(task.init)
    missing = list(task.ways.counts)
    taken = bytearray(len(ways))
    ready = [i for i, count in enumerate(missing) if not count]
    while ready or agenda:
        if ready:
            i = ready.pop()
            taken[i] = 1
            for one in ways[i].adds:
                if one not in reached:
                    reached.add(one)
                    agenda.append(one)
                if one in supports:
                    hoped = [bound for bound in supports[one] if bound not in reached]
                    fresh = _helped(hoped, ways[i], task.numbering) if hoped else hoped
                    reached.update(fresh)
                    agenda += fresh
        else:
            for i in users.get(agenda.pop(), ()):
                missing[i] -= 1
                if not missing[i]:
                    ready.append(i)
    return Reach(reached, taken)


def _helped(bounds: Iterable[int], way: Way, numbering: Numbering) -> list[int]:
    """Those bounds that the way may make true."""
    named = [(number, numbering.named(number)) for number in bounds]
    return [
        number
        for number, bound in named
        if isinstance(bound, Bound) and any(helps(change, bound) for change in way.assignments)
    ]


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
    contribution = task.ways.known(key, lambda: _contributing(task, bytearray(possible)))
    settled = task.settled | contribution.lasting.intersection(task.init)
    asked = contribution.wanted - settled
    kept = task.ways.known("slice" if task.left else "whole", lambda: Restriction(task.ways, task.numbering))
    left = kept.of(contribution.positions, asked, settled)
    goal = tuple([one for one in task.goal if one not in settled])
    present = set(task.init)
    needed = dict.fromkeys(chain.from_iterable([way.needs for way in left.values()]))
    init = tuple([one for one in (*needed, *(one for one in goal if one not in needed)) if one in present])
    return replace(task, init=init, goal=goal, left=left, settled=settled)


class Restriction:
    """What is left of ways without what nobody asks for; from one problem to the next mostly the same."""

    def __init__(self, ways: Ways, numbering: Numbering) -> None:
        self._ways, self._numbering = ways, numbering
        self._asked: frozenset[int] = frozenset()
        self._settled: frozenset[int] = frozenset()
        self._left: dict[int, Way] = {}

    def of(self, positions: Iterable[int], asked: frozenset[int], settled: frozenset[int]) -> dict[int, Way]:
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
        wanted: what the goal and the ways ask for.
        positions: the ways that add something of it, or change a number that it depends on.
        lasting: what of it can never cease to hold, if it does: no way deletes it or changes its numbers.
    """

    wanted: frozenset[int]
    positions: Sequence[int]
    lasting: frozenset[int]


def _contributing(task: Task, open_: bytearray) -> _Contribution:
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
    found.sort()
    made = set[int]().union(*[ways[i].deletes for i in found])
    if task.numbering.fluents:
        made.update(one for i in found for one in ways[i].adds if one in task.numbering.fluents)
    lasting = frozenset([one for one in wanted if one not in made and made.isdisjoint(wants.get(one, ()))])
    return _Contribution(frozenset(wanted), found, lasting)


def _inputs(ways: Iterable[Way], numbering: Numbering) -> Mapping[int, Iterable[int]]:
    """Fluent -> the fluents that amounts assigned to it depend on."""
    found: dict[int, set[int]] = {}
    for way in ways if numbering.fluents else ():
        for one in way.assignments:
            found.setdefault(numbering.fluent(one.fluent), set()).update(map(numbering.fluent, fluents(one.amount)))
    return found


def _clean(way: Way, asked: frozenset[int], settled: frozenset[int], numbering: Numbering) -> Way:
    needs = tuple([one for one in way.needs if one not in settled])
    return Way(
        way.step,
        needs,
        tuple([one for one in way.adds if one in asked and one not in needs]),
        tuple([one for one in way.deletes if one in asked]),
        tuple([a for a in way.assignments if numbering.fluent(a.fluent) in asked]) if way.assignments else (),
        way.cost,
        way.number,
    )
