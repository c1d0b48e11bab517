"""What of a ground problem can matter (S1.5): what can ever happen, and what can contribute to the goal.

Everything here is exact: there is a plan for what is kept if and only if there is one for the whole, and it
costs the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from planning.quantities import fluents
from planning.ways import Way, Ways

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from planning.numbering import Numbering


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
    ways: Ways


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
    """What can hold and happen; a bound counts as possible as soon as one of its numbers can change."""
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
                    fresh = [one, *(bound for bound in supports.get(one, ()) if bound not in reached)]
                    reached.update(fresh)
                    agenda += fresh
        else:
            for i in users.get(agenda.pop(), ()):
                missing[i] -= 1
                if not missing[i]:
                    ready.append(i)
    return Reach(reached, taken)


def pruned(task: Task, reach: Reach) -> Task:
    """The task with everything left out that cannot matter.

    Left out are ways that can never be taken or cannot contribute to the goal, literals that no kept way or goal
    asks for, and literals and bounds that hold now and can never cease to (they hold whenever asked for).
    """
    wanted, kept = _contributing(task, reach)
    settled = _settled(task, kept)
    asked = wanted - settled
    ways = [clean for way in kept if (clean := _restricted(way, asked, settled, task.numbering)).adds]
    needed = dict.fromkeys([need for way in ways for need in way.needs])
    needed.update(dict.fromkeys(task.goal))
    init = tuple([one for one in needed if one in task.init and one not in settled])
    return Task(task.numbering, init, tuple([one for one in task.goal if one not in settled]), Ways(ways))


def _contributing(task: Task, reach: Reach) -> tuple[set[int], list[Way]]:
    """What is asked for, and the ways that add something of it, or change a number that it depends on."""
    ways, adders, wants = task.ways.all, task.ways.adders, task.numbering.wants
    open_, inputs = bytearray(reach.taken), _inputs(ways, task.numbering)
    wanted, agenda = set(task.goal), list(task.goal)
    found: list[int] = []
    while agenda:
        here = agenda.pop()
        fresh = [one for one in (*wants.get(here, ()), *inputs.get(here, ())) if one not in wanted]
        wanted.update(fresh)
        agenda += fresh
        for i in adders.get(here, ()):
            if open_[i]:
                open_[i] = 0
                found.append(i)
                for need in ways[i].needs:
                    if need not in wanted:
                        wanted.add(need)
                        agenda.append(need)
    return wanted, [ways[i] for i in sorted(found)]


def _inputs(ways: Iterable[Way], numbering: Numbering) -> Mapping[int, Iterable[int]]:
    """Fluent -> the fluents that amounts assigned to it depend on."""
    found: dict[int, set[int]] = {}
    for way in ways if numbering.fluents else ():
        for one in way.assignments:
            found.setdefault(numbering.fluent(one.fluent), set()).update(map(numbering.fluent, fluents(one.amount)))
    return found


def _settled(task: Task, ways: Sequence[Way]) -> set[int]:
    """What holds and can never cease to: no way deletes it or changes a number that it depends on."""
    made: set[int] = set()
    for way in ways:
        made.update(way.deletes)
    if task.numbering.fluents:
        made.update(one for way in ways for one in way.adds)
    wants = task.numbering.wants
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
        way.number,
    )
