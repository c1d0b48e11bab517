"""From numbers back to the facts of a `Problem`; ground actions that were made before are used again."""

from __future__ import annotations

from typing import TYPE_CHECKING

from planning.quantities import Bound, fluents, worth
from planning.strips import GroundAction, Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from knowledge_base.facts import Fact
    from knowledge_base.language.evaluation import World
    from planning.posing.numbering import Numbering
    from planning.posing.reduction import Task
    from planning.posing.ways import Way

_MOST_KEPT = 20_000  # ground actions; a problem of 50 items has 3,000


class Assembly:
    """Makes problems of tasks that share a numbering and whose ways have the same numbers."""

    def __init__(self, numbering: Numbering) -> None:
        self._numbering = numbering
        self._made: dict[int, tuple[Way, GroundAction]] = {}  # by identity

    def problem(
        self, domain: str, task: Task, things: Mapping[str, str], world: World | None, notes: tuple[str, ...]
    ) -> Problem:
        """The problem that the task stands for.

        Args:
            domain: its name.
            task: what is left of the problem in numbers.
            things: all things with their types.
            world: where numeric fluents have their values; none is needed if there are no fluents.
            notes: for people.
        """
        init, _ = self._split(task.init)
        goal, bounds = self._split(task.goal)
        ways = task.ways.all if task.left is None else task.left.values()
        known = self._made.get
        actions = tuple([found[1] if (found := known(id(way))) else self._action(way) for way in ways])
        mentioned = dict.fromkeys([arg for action in actions if action.step for arg in action.step.args])
        mentioned.update(dict.fromkeys(str(value) for fact in (*init, *goal) for value in fact.args))
        objects = {one: things[one] for one in mentioned if one in things}
        asked = _fluents(actions, bounds) if self._numbering.fluents else ()
        numbers = {} if world is None else {one: worth(world, one) for one in asked}
        return Problem(domain, objects, init, goal, actions, numbers=numbers, bounds=bounds, notes=notes)

    def _action(self, way: Way) -> GroundAction:
        if len(self._made) >= _MOST_KEPT:
            self._made.clear()
        action = self._make(way)
        self._made[id(way)] = way, action
        return action

    def _make(self, way: Way) -> GroundAction:
        numbering = self._numbering
        needs, bounds = self._split(way.needs)
        adds = tuple([numbering.fact(one) for one in way.adds if one not in numbering.fluents])
        deletes = tuple(map(numbering.fact, way.deletes))
        cost = 0.0 if way.cost is None else way.cost
        return GroundAction(way.step, needs, adds, deletes, cost, bounds, way.assignments)

    def _split(self, numbers: Iterable[int]) -> tuple[tuple[Fact, ...], tuple[Bound, ...]]:
        """Facts in positive normal form, and bounds."""
        facts: list[Fact] = []
        bounds: list[Bound] = []
        for number in numbers:
            one = self._numbering.named(number)
            if isinstance(one, Bound):
                bounds.append(one)
            else:
                facts.append(self._numbering.fact(number))
        return tuple(facts), tuple(bounds)


def _fluents(actions: Iterable[GroundAction], goal: Iterable[Bound]) -> dict[Fact, None]:
    """All numeric fluents that matter."""
    found = dict.fromkeys(fluent for bound in goal for fluent in bound.fluents())
    for action in actions:
        found.update((fluent, None) for bound in action.bounds for fluent in bound.fluents())
        for one in action.assignments:
            found.update(dict.fromkeys((one.fluent, *fluents(one.amount))))
    return found
