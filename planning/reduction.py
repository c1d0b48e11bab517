"""What of a ground problem can matter (S1.5): what can ever happen, and what can contribute to the goal.

Everything here is exact: there is a plan for what is kept if and only if there is one for the whole, and it
costs the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from planning.groundwork import Way
from planning.quantities import fluents

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from planning.numbering import Numbering

_Sets = dict[int, set[int]]


@dataclass(frozen=True, slots=True)
class Task:
    """A ground problem in numbers.

    Attributes:
        numbering: what they stand for.
        init: literals and bounds that hold.
        goal: literals and bounds that shall hold.
        ways: what may be done.
    """

    numbering: Numbering
    init: Collection[int]
    goal: tuple[int, ...]
    ways: Sequence[Way]


def reachable(task: Task) -> tuple[set[int], list[Way]]:
    """What can hold, and the ways possible, when nothing ever becomes false (the delete relaxation).

    A bound counts as possible as soon as one of its numbers can change.
    """
    ways, supports = task.ways, task.numbering.supports
    reached, agenda = set(task.init), list(task.init)
    missing = [len(way.needs) for way in ways]
    users: dict[int, list[int]] = {}
    for i, way in enumerate(ways):
        for need in way.needs:
            users.setdefault(need, []).append(i)
    taken = bytearray(len(ways))
    ready = [i for i, count in enumerate(missing) if not count]
    while ready or agenda:
        if not ready:
            for i in users.get(agenda.pop(), ()):
                missing[i] -= 1
                if not missing[i]:
                    ready.append(i)
            continue
        i = ready.pop()
        taken[i] = True
        for one in ways[i].adds:
            if one not in reached:
                fresh = [one, *(bound for bound in supports.get(one, ()) if bound not in reached)]
                reached.update(fresh)
                agenda.extend(fresh)
    return reached, [way for i, way in enumerate(ways) if taken[i]]


def pruned(task: Task, possible: Sequence[Way]) -> Task:
    """The task with everything left out that cannot matter; `possible` are the ways that are `reachable`.

    Left out are ways that can never be taken or cannot contribute to the goal, literals that no kept way or goal
    asks for, and literals and bounds that hold now and can never cease to (they hold whenever asked for).
    """
    wanted, kept = _contributing(task, possible)
    settled = _settled(task, kept)
    asked = wanted - settled
    ways = [clean for way in kept if (clean := _restricted(way, asked, settled, task.numbering)).adds]
    needed = dict.fromkeys([*(need for way in ways for need in way.needs), *task.goal])
    init = tuple([one for one in needed if one in task.init and one not in settled])
    return Task(task.numbering, init, tuple([one for one in task.goal if one not in settled]), ways)


def _contributing(task: Task, possible: Sequence[Way]) -> tuple[set[int], list[Way]]:
    """What is asked for, and the ways that add something of it, or change a number that it depends on."""
    adders: dict[int, list[int]] = {}
    for i, way in enumerate(possible):
        for one in way.adds:
            adders.setdefault(one, []).append(i)
    wants, inputs = task.numbering.wants, _inputs(possible, task.numbering)
    wanted, agenda, found = set(task.goal), list(task.goal), bytearray(len(possible))
    while agenda:
        here = agenda.pop()
        fresh = [one for one in (*wants.get(here, ()), *inputs.get(here, ())) if one not in wanted]
        for i in adders.get(here, ()):
            if not found[i]:
                found[i] = True
                fresh += [need for need in possible[i].needs if need not in wanted]
        wanted.update(fresh)
        agenda.extend(fresh)
    return wanted, [way for i, way in enumerate(possible) if found[i]]


def _inputs(ways: Iterable[Way], numbering: Numbering) -> _Sets:
    """Fluent -> the fluents that amounts assigned to it depend on."""
    found: _Sets = {}
    for way in ways:
        for one in way.assignments:
            found.setdefault(numbering.fluent(one.fluent), set()).update(map(numbering.fluent, fluents(one.amount)))
    return found


def _settled(task: Task, ways: Iterable[Way]) -> set[int]:
    """What holds and can never cease to: no way deletes it or changes a number that it depends on."""
    made: set[int] = set()
    for way in ways:
        made.update(way.adds)
        made.update(way.deletes)
    wants: Mapping[int, Iterable[int]] = task.numbering.wants
    return {one for one in task.init if one not in made and made.isdisjoint(wants.get(one, ()))}


def _restricted(way: Way, asked: set[int], settled: set[int], numbering: Numbering) -> Way:
    needs = tuple([one for one in way.needs if one not in settled])
    return Way(
        way.step,
        needs,
        tuple([one for one in way.adds if one in asked and one not in needs]),
        tuple([one for one in way.deletes if one in asked]),
        tuple([a for a in way.assignments if numbering.fluent(a.fluent) in asked]) if way.assignments else (),
        way.cost,
    )
