"""What is possible when nothing ever becomes false (the delete relaxation), found again with little after a change.

From one problem to the next some facts hold no longer and others do, but as a rule the same can be reached. To see
that, each fact is kept with the way by which it was first reached: all that this way needs was reached before it. What
held and holds no longer is reached again by itself, or by nothing; then those facts have to be reached in another way
which were reached by what has become impossible with it. Where that is not seen at a glance all is worked out anew.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from planning.quantities import NumericBound, helps

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from planning.problem.numbering import Numbering
    from planning.problem.operators import GroundOperator
    from planning.problem.reduction import Task

_GIVEN = -1  # instead of a way: it holds from the beginning
_DEEPEST = 50
_MOST_LOOKS = 3000  # at ways; so many take about as long as working everything out anew


@dataclass(frozen=True, slots=True)
class Reach:
    """What is possible.

    Attributes:
        facts: the literals, bounds and fluents reached, each after those by which it is reached, with the position of
            the way that reaches it.
        taken: by position, whether a way is possible (1) or not (0).
    """

    facts: Mapping[int, int]
    taken: bytearray


def reachable(task: Task) -> Reach:
    """What can hold and happen; a bound counts as possible as soon as a number can change to its good."""
    last: list[Reach] = task.ways.known("reach", list)
    found = _Again(last[0], task).reach() if last and not task.numbering.supports else None
    last[:] = [found or _worked_out(task)]
    return last[0]


def _worked_out(task: Task) -> Reach:
    ways, users, supports = task.ways.all, task.ways.users, task.numbering.supports
    reached, agenda = dict.fromkeys(task.init, _GIVEN), list(task.init)
    missing = list(task.ways.counts)
    taken = bytearray(len(ways))
    ready = [i for i, count in enumerate(missing) if not count]
    while ready or agenda:
        if ready:
            i = ready.pop()
            taken[i] = 1
            for one in ways[i].adds:
                if one not in reached:
                    reached[one] = i
                    agenda.append(one)
                if one in supports:
                    hoped = [bound for bound in supports[one] if bound not in reached]
                    fresh = _helped(hoped, ways[i], task.numbering) if hoped else hoped
                    reached.update(dict.fromkeys(fresh, i))
                    agenda += fresh
        else:
            for i in users.get(agenda.pop(), ()):
                missing[i] -= 1
                if not missing[i]:
                    ready.append(i)
    return Reach(reached, taken)


def _helped(bounds: Iterable[int], way: GroundOperator, numbering: Numbering) -> list[int]:
    """Those bounds that the way may make true."""
    named = [(number, numbering.named(number)) for number in bounds]
    return [
        number
        for number, bound in named
        if isinstance(bound, NumericBound) and any(helps(change, bound) for change in way.assignments)
    ]


@dataclass(slots=True)
class _Again:
    """What was reached, looked at from another beginning.

    Attributes:
        before: what was reached.
        task: what has become of it.
        proven: what is reached from the new beginning alone, with the ways that do it.
        gone: what is not reached any more.
        looks: how many more ways may be looked at.
    """

    before: Reach
    task: Task
    proven: dict[int, int] = field(default_factory=dict)
    gone: set[int] = field(default_factory=set)
    looks: int = _MOST_LOOKS

    def reach(self) -> Reach | None:
        """The same as anew; `None` if that is not seen at a glance."""
        task, before, users = self.task, self.before.facts, self.task.ways.users
        given = set(task.init)
        fresh = [one for one in given if one not in before]
        lost = [one for one, way in before.items() if way == _GIVEN and one not in given]
        if any(one in users for one in fresh) or not all(self._regained(one, given) for one in lost):
            return None
        taken = self._left(given)
        instead = self._instead(taken, given)
        if instead is None:
            return None
        gone, proven = self.gone, self.proven
        kept = {
            one: instead.get(one, way)
            for one, way in before.items() if one not in gone and one not in given and one not in proven
        }  # fmt: skip
        return Reach({**dict.fromkeys(task.init, _GIVEN), **proven, **kept}, taken)

    def _regained(self, lost: int, given: set[int]) -> bool:
        """Whether it is known what becomes of a fact that held before."""
        if lost not in self.task.ways.adders:
            self.gone.add(lost)
            return True
        return self._proves(lost, given, ())

    def _proves(self, fact: int, given: set[int], path: tuple[int, ...]) -> bool:
        """Whether the fact is seen to be reached from what is given and proven; not seen, it may be all the same."""
        if fact in given or fact in self.proven:
            return True
        if fact in path or len(path) == _DEEPEST:
            return False
        open_: list[tuple[int, list[int]]] = []
        for i in self.task.ways.adders.get(fact, ()):
            self.looks -= 1
            lacks = [one for one in self._way(i).needs if one not in given and one not in self.proven]
            if not lacks:
                self.proven[fact] = i
                return True
            open_.append((i, lacks))
        for i, lacks in sorted(open_, key=lambda one: len(one[1])):
            if self.looks < 0:
                return False
            if all(self._proves(one, given, (*path, fact)) for one in lacks):
                self.proven[fact] = i
                return True
        return False

    def _left(self, given: set[int]) -> bytearray:
        """The ways that are possible without what is gone; more is gone if no way is left that would reach it."""
        ways, taken, agenda = self.task.ways, bytearray(self.before.taken), list(self.gone)
        while agenda:
            for i in ways.users.get(agenda.pop(), ()):
                if taken[i]:
                    taken[i] = 0
                    for one in ways.all[i].adds:
                        open_ = one in given or one in self.gone or any(taken[j] for j in ways.adders.get(one, ()))
                        if not open_:
                            self.gone.add(one)
                            agenda.append(one)
        return taken

    def _instead(self, taken: bytearray, given: set[int]) -> dict[int, int] | None:
        """For each fact that was reached in a way that is gone, another one; `None` if there is one without."""
        before, old = self.before.facts, self.before.taken
        instead: dict[int, int] = {}
        hit = [
            one for one, i in before.items()
            if i != _GIVEN and old[i] and not taken[i]
            and one not in given and one not in self.proven and one not in self.gone
        ]  # fmt: skip
        if not hit:
            return instead
        place = {one: n for n, one in enumerate(before)}
        for one in hit:
            for i in self.task.ways.adders.get(one, ()):
                if taken[i] and all(self._earlier(need, place[one], place, given) for need in self._way(i).needs):
                    instead[one] = i
                    break
            else:
                if not self._proves(one, given, ()):
                    return None
        return instead

    def _earlier(self, need: int, than: int, place: Mapping[int, int], given: set[int]) -> bool:
        return need in given or need in self.proven or (need not in self.gone and place.get(need, than) < than)

    def _way(self, i: int) -> GroundOperator:
        return self.task.ways.all[i]
