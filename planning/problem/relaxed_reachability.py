"""Relaxed reachability: the facts and operators that are possible without deletes, updated after a change.

The next problem starts from other facts, but mostly reaches equal facts. Each reached fact is kept with the operator
that reached it first; all needs of that operator were reached before the fact. If a fact no longer holds initially, it
is proven again or removed. If an operator becomes impossible, each fact that it reached needs another operator. If a
limited number of tests cannot decide, the search starts from the beginning.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from planning.model.quantities import helps
from planning.problem.task import GroundOperator, Numbering, Task

_GIVEN = -1  # replaces the position of an operator if the fact holds initially
_DEEPEST = 50
_MOST_LOOKS = 3000  # tested operators; more tests take longer than a new search


@dataclass(frozen=True, slots=True)
class Reach:
    """The facts and operators that are reachable without deletes.

    Attributes:
        facts: the reached literals, bounds and fluents, each with the position of the operator that reached it. The
            needs of that operator come earlier.
        taken: for each position, whether the operator is possible (1) or not (0).
    """

    facts: Mapping[int, int]
    taken: bytearray


def reachable(task: Task) -> Reach:
    """Return the set reachable without deletes; a bound is possible if a number can change in its direction."""
    last: list[Reach] = task.ways.known("reach", list)
    found = _Again(last[0], task).reach() if last and not task.numbering.supports else None
    last[:] = [found or _computed_reach(task)]
    return last[0]


def _computed_reach(task: Task) -> Reach:
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
                    fresh = _find_helped(hoped, ways[i], task.numbering) if hoped else hoped
                    reached.update(dict.fromkeys(fresh, i))
                    agenda += fresh
        else:
            for i in users.get(agenda.pop(), ()):
                missing[i] -= 1
                if not missing[i]:
                    ready.append(i)
    return Reach(reached, taken)


def _find_helped(bounds: Iterable[int], way: GroundOperator, numbering: Numbering) -> list[int]:
    """Return the bounds that the operator may make true."""
    return [
        number for number in bounds if any(helps(change, numbering.bounds[number]) for change in way.assignments)
    ]  # fmt: skip


@dataclass(slots=True)
class _Again:
    """The update of the reachable set of an earlier task.

    Attributes:
        before: the result for the earlier task.
        task: the task with other initial facts.
        proven: the facts that follow from the new initial facts, each with its operator.
        gone: the facts that are no longer reachable.
        looks: the number of operators that may still be tested.
    """

    before: Reach
    task: Task
    proven: dict[int, int] = field(default_factory=dict)
    gone: set[int] = field(default_factory=set)
    looks: int = _MOST_LOOKS

    def reach(self) -> Reach | None:
        """Return the result of a new search; `None` if a limited number of tests cannot decide."""
        task, before, users = self.task, self.before.facts, self.task.ways.users
        given = set(task.init)
        fresh = [one for one in given if one not in before]
        lost = [one for one, way in before.items() if way == _GIVEN and one not in given]
        if any(one in users for one in fresh) or not all(self._is_regained(one, given) for one in lost):
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

    def _is_regained(self, lost: int, given: set[int]) -> bool:
        """Return whether a fact that no longer holds initially is proven or certainly unreachable."""
        if lost not in self.task.ways.adders:
            self.gone.add(lost)
            return True
        return self._proves(lost, given, ())

    def _proves(self, fact: int, given: set[int], path: tuple[int, ...]) -> bool:
        """Return whether initial and proven facts prove this fact; after `False` the fact may still be reachable."""
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
        """Return the operators that are possible without the facts in `gone`; add facts without operators to `gone`."""
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
        """Return another operator for each fact whose operator became impossible; `None` if a fact has none."""
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
