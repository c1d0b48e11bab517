"""Costs of plan steps, so that plans prefer what succeeds soon (S0.14)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from statistics import fmean
from typing import TYPE_CHECKING

from dsc.dynamic.experience import NO_EXPERIENCE, Experience
from knowledge_base.facts import Fact
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.world.overlay import Overlay
from planning.model.ground_action import GroundAction
from planning.model.plan import PlanStep
from planning.model.problem import Problem
from planning.model.quantities import value_of
from planning.problem.operators import TOTAL_COST

if TYPE_CHECKING:
    from dsc.dynamic.library import Library
    from planning.model.domain import PlanningDomain

_DIGITS = 1  # tenths of seconds, since the costs of some engines are integers


class StepCosts:
    """The costs of the plan steps of a run.

    If the domain declares `(total-cost)`, its actions have their costs. Otherwise, the cost of a step is its expected
    time until success by the experience of the run, in seconds; without tries of steps, each step costs 1. A step whose
    action lacks tries costs the mean of the other actions.

    Args:
        domain: the planning domain.
        library: the plots of the run, with its experience.
    """

    def __init__(self, domain: PlanningDomain, library: Library) -> None:
        self._declared = TOTAL_COST.function in domain.schema.functions
        self._actions = tuple(domain.actions)
        self._library = library
        self._experience = NO_EXPERIENCE
        self._unknown: float | None = None
        self._seconds: dict[PlanStep, float] = {}

    def price(self, problem: Problem) -> Problem:
        """Return the problem with the costs of experience; the costs of bookkeeping actions stay.

        The result has all objects, since those that others can replace may be cheaper.
        """
        if self._current() is None:
            return problem
        if (whole := problem.whole) is not None:
            problem = replace(whole, one_at_a_time=problem.one_at_a_time, timed=problem.timed, wrong=problem.wrong)
        return replace(problem, actions=tuple(map(self._price_action, problem.actions)))

    def sum(self, steps: Sequence[PlanStep], domain: PlanningDomain, world: World) -> float:
        """Return the cost of steps from `world`; `domain` has its conditions expanded for the present world."""
        if not self._declared:
            return len(steps) if self._current() is None else sum(map(self._of, steps))
        ahead = Overlay(world)
        for step in steps:
            ahead.apply(domain.effects(step, ahead))
        total = Fact(TOTAL_COST.function)
        return value_of(ahead, total) - value_of(world, total)

    def _current(self) -> Experience | None:
        """Return the experience from which costs follow, or `None`."""
        if self._declared:
            return None
        if self._experience is not self._library.experience:  # a resumed run receives its own
            self._experience = self._library.experience
            known = [self._experience.seconds_for(action, "") for action in self._actions]
            tried = [seconds for seconds in known if seconds is not None]
            self._unknown = fmean(tried) if tried else None
            self._seconds = {}
        return None if self._unknown is None else self._experience

    def _of(self, step: PlanStep) -> float:
        if step not in self._seconds:
            seconds = self._experience.seconds_for(step.action, str(step)) or self._unknown or 1.0
            self._seconds[step] = max(round(seconds, _DIGITS), 10**-_DIGITS)
        return self._seconds[step]

    def _price_action(self, action: GroundAction) -> GroundAction:
        return action if action.step is None else replace(action, cost=self._of(action.step))
