"""PlanProgress holds the done, running and remaining steps of a plan, and tests whether they lead to the goal."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import Any

from knowledge_base.errors import InputError
from knowledge_base.facts import Fact
from knowledge_base.language.evaluation.evaluator import holds
from knowledge_base.language.evaluation.world import World
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.world.overlay import Overlay
from planning.domain import PlanningDomain
from planning.execution.regression import CausalNeeds
from planning.plan import PlanStep
from planning.problem.costs import TOTAL_COST
from planning.quantities import worth

_MOST_RUNNING = 3
"""The number of running steps up to which each subset of them is tried as done; of more, only none and all."""


def leads_to(steps: Iterable[PlanStep], domain: PlanningDomain, world: World, goal: Expression) -> bool:
    """Whether the steps, taken in this order from `world`, reach the goal; `world` stays unchanged."""
    ahead: Overlay | None = None  # lazily: of a plan's ends, most fail at their first step
    try:
        for step in steps:
            if not domain.applicable(step, ahead or world):
                return False
            ahead = ahead or Overlay(world)
            ahead.apply(domain.effects(step, ahead))
        return holds(goal, ahead or world)
    except InputError:  # an object is missing, or a value cannot be computed
        return False


def shortest_end(
    steps: Sequence[PlanStep], domain: PlanningDomain, world: World, goal: Expression
) -> tuple[PlanStep, ...] | None:
    """The fewest last steps that lead to the goal from `world`; `None` if not even all of them do."""
    ends = (tuple(steps[first:]) for first in range(len(steps), -1, -1))
    return next((end for end in ends if leads_to(end, domain, world, goal)), None)


def thinned(steps: Sequence[PlanStep], domain: PlanningDomain, world: World, goal: Expression) -> tuple[PlanStep, ...]:
    """Return a plan without useless steps: each is omitted, with the steps that need it, if the goal is still reached.

    Action elimination (Nakhost & Müller 2010); the result is a plan whenever `steps` are one.
    """
    kept, number = tuple(steps), 0
    while number < len(kept):
        without = (*kept[:number], *_possible(kept[:number], kept[number + 1 :], domain, world))
        if leads_to(without, domain, world, goal):
            kept = without
        else:
            number += 1
    return kept


def _possible(
    first: Iterable[PlanStep], then: Iterable[PlanStep], domain: PlanningDomain, world: World
) -> Iterator[PlanStep]:
    """The steps of `then` that are applicable after `first`, one after the other."""
    ahead = Overlay(world)
    for step in first:
        ahead.apply(domain.effects(step, ahead))
    for step in then:
        if domain.applicable(step, ahead):
            ahead.apply(domain.effects(step, ahead))
            yield step


def cost_of(steps: Sequence[PlanStep], domain: PlanningDomain, world: World) -> float:
    """Return the `(total-cost)` of the steps, in this order from `world`; their number if it is not declared."""
    if TOTAL_COST.function not in domain.schema.functions:
        return len(steps)
    ahead = Overlay(world)
    for step in steps:
        ahead.apply(domain.effects(step, ahead))
    total = Fact(TOTAL_COST.function)
    return worth(ahead, total) - worth(world, total)


class PlanProgress:
    """The done, running and remaining steps of a plan, by their number from 1.

    A step is done, or omitted by a rule, when a step that must follow it has begun: no plot begins a step too early.

    Args:
        steps: the plan's steps.
        domain: has their conditions and effects, without derived predicates.
        goal: of the plan, in the same way.
        before: pairs of steps of which the first must be done when the second begins; each pair of the
            sequence by default.

    Attributes:
        early: whether another author has caused an effect of a later step, so that steps may be useless.
    """

    def __init__(
        self,
        steps: Sequence[PlanStep],
        domain: PlanningDomain,
        goal: Expression,
        before: AbstractSet[tuple[int, int]] | None = None,
    ) -> None:
        self.steps = tuple(steps)
        self.goal = goal
        self.domain = domain
        self._needs = CausalNeeds(self.steps, domain, goal)
        self._before = before
        self._begun: set[int] = set()
        self._done: set[int] = set()
        self.early = False

    def to_json(self) -> dict[str, Any]:
        """The steps, their order, and the numbers of those that have begun; the done ones follow."""
        before = None if self._before is None else sorted(map(list, self._before))
        steps = [step.to_json() for step in self.steps]
        return {"steps": steps, "before": before, "begun": sorted(self._begun), "early": self.early}

    @classmethod
    def from_json(cls, form: Mapping[str, Any], domain: PlanningDomain, goal: Expression) -> PlanProgress:
        """The inverse of `to_json`, with conditions written for the present state of the world."""
        before = None if form["before"] is None else {(first, second) for first, second in form["before"]}
        progress = cls([PlanStep.from_json(step) for step in form["steps"]], domain, goal, before)
        for number in form["begun"]:
            progress.begin(number)
        progress.early = form["early"]
        return progress

    def renewed(self, domain: PlanningDomain, goal: Expression) -> PlanProgress:
        """The same progress, with conditions written for another state of the world."""
        progress = PlanProgress(self.steps, domain, goal, self._before)
        progress._begun, progress._done = set(self._begun), set(self._done)
        return progress

    def take_in_order(self, before: AbstractSet[tuple[int, int]]) -> None:
        """Add pairs to the order, before the first step begins."""
        self._before = None if self._before is None else self._before | before

    def begin(self, number: int) -> None:
        """Begin a step."""
        self._begun.add(number)
        agenda = [number]
        while agenda:
            later = agenda.pop()
            earlier = self._earlier(later) - self._done
            self._done |= earlier
            agenda += earlier

    def _earlier(self, later: int) -> set[int]:
        if self._before is None:
            return set(range(1, later))
        return {first for first, second in self._before if second == later}

    @property
    def running(self) -> tuple[int, ...]:
        """The steps that have begun, without those that are certainly done."""
        return tuple(sorted(self._begun - self._done))

    @property
    def remaining(self) -> tuple[int, ...]:
        """The steps that are not done, with the running ones, in an executable order."""
        return tuple(number for number in range(1, len(self.steps) + 1) if number not in self._done)

    @property
    def remaining_steps(self) -> tuple[PlanStep, ...]:
        """The steps with the numbers of `remaining`."""
        return self.steps_of(self.remaining)

    def needed(self) -> Mapping[Expression, int] | None:
        """The conditions that must hold now, with the first user of each; `None` if regression cannot write them.

        The effects of a running step may hold already, so that later steps need them too.
        """
        return self._needs.before(self.remaining)

    def needed_by(self, numbers: tuple[int, ...]) -> Mapping[Expression, int] | None:
        """As `needed`, if only the steps with these numbers remained, in this order."""
        return self._needs.before(numbers)

    def steps_of(self, numbers: Iterable[int]) -> tuple[PlanStep, ...]:
        """The steps with these numbers."""
        return tuple(self.steps[number - 1] for number in numbers)

    def needed_later(self) -> Mapping[Expression, int] | None:
        """As `needed`, if all running steps were done."""
        return self._needs.before(self._after(self.running))

    def stands(self, world: World) -> bool:
        """Whether the goal is reached from `world`; each running step counts as not begun or as done."""
        return any(leads_to(steps, self.domain, world, self.goal) for steps in self._ways_on())

    def shortest_end(self, world: World) -> tuple[PlanStep, ...] | None:
        """The fewest last steps that lead to the goal from `world`, with any of the running steps."""
        ends = (shortest_end(steps, self.domain, world, self.goal) for steps in self._ways_on())
        return min((end for end in ends if end is not None), key=len, default=None)

    def coming(self) -> tuple[PlanStep, ...]:
        """The steps that have not begun."""
        return self.steps_of(self._after(self.running))

    def _ways_on(self) -> Iterator[tuple[PlanStep, ...]]:
        """The step sequences that may remain, for each choice of running steps that are done."""
        running = self.running
        sizes = range(len(running) + 1) if len(running) <= _MOST_RUNNING else (0, len(running))
        finished = itertools.chain.from_iterable(itertools.combinations(running, size) for size in sizes)
        return (self.steps_of(self._after(done)) for done in finished)

    def _after(self, done: Iterable[int]) -> tuple[int, ...]:
        gone = set(done)
        return tuple(number for number in self.remaining if number not in gone)
