"""Assembly of a problem of facts and ground actions from a task in numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from planning.quantities import NumericBound, fluents, worth
from planning.strips import GroundAction, Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from knowledge_base.facts import Fact
    from knowledge_base.language.evaluation.world import World
    from planning.problem.numbering import Numbering
    from planning.problem.operators import GroundOperator
    from planning.problem.reduction import Task


_MOST_KEPT = 20_000  # ground actions; a problem of 50 items has 3,000


class Assembly:
    """Makes problems from tasks that share a numbering and ground operators."""

    def __init__(self, numbering: Numbering) -> None:
        self._numbering = numbering
        self._made: dict[int, tuple[GroundOperator, GroundAction]] = {}  # by identity

    def problem(
        self, domain: str, task: Task, things: Mapping[str, str], world: World | None, notes: tuple[str, ...]
    ) -> Problem:
        """Return the `Problem` of the task.

        Args:
            domain: the name of the domain.
            task: the pruned task, in numbers.
            things: all objects with their types.
            world: the source of the values of numeric fluents; `None` if the task has no fluents.
            notes: remarks for readers.
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

    def _action(self, way: GroundOperator) -> GroundAction:
        if len(self._made) >= _MOST_KEPT:
            self._made.clear()
        action = self._make(way)
        self._made[id(way)] = way, action
        return action

    def _make(self, way: GroundOperator) -> GroundAction:
        numbering = self._numbering
        needs, bounds = self._split(way.needs)
        adds = tuple([numbering.fact(one) for one in way.adds if one not in numbering.fluents])
        deletes = tuple(map(numbering.fact, way.deletes))
        cost = 0.0 if way.cost is None else way.cost
        return GroundAction(way.step, needs, adds, deletes, cost, bounds, way.assignments)

    def _split(self, numbers: Iterable[int]) -> tuple[tuple[Fact, ...], tuple[NumericBound, ...]]:
        """Return facts in positive normal form, and bounds."""
        facts: list[Fact] = []
        bounds: list[NumericBound] = []
        for number in numbers:
            one = self._numbering.named(number)
            if isinstance(one, NumericBound):
                bounds.append(one)
            else:
                facts.append(self._numbering.fact(number))
        return tuple(facts), tuple(bounds)


def _fluents(actions: Iterable[GroundAction], goal: Iterable[NumericBound]) -> dict[Fact, None]:
    """Return the numeric fluents of bounds and assignments, as a set in order."""
    found = dict.fromkeys(fluent for bound in goal for fluent in bound.fluents())
    for action in actions:
        found.update((fluent, None) for bound in action.bounds for fluent in bound.fluents())
        for one in action.assignments:
            found.update(dict.fromkeys((one.fluent, *fluents(one.amount))))
    return found
