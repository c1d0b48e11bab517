"""Costs of plan steps, so that plans prefer what succeeds soon (S0.14)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from statistics import fmean
from typing import TYPE_CHECKING

from dsc.dynamic.experience import NO_EXPERIENCE
from knowledge_base.facts import Fact
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.world.overlay import Overlay
from planning.model.plan import PlanStep
from planning.model.problem import Problem
from planning.model.quantities import value_of
from planning.problem.operators import TOTAL_COST

if TYPE_CHECKING:
    from dsc.dynamic.library import Library
    from planning.model.domain import PlanningDomain

_LEAST = 0.1  # seconds; costs are rounded to tenths, since the costs of some engines are integers


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
        self._mean: float | None = None

    def price(self, problem: Problem) -> Problem:
        """Return the problem with the costs of experience; the costs of bookkeeping actions stay.

        The result has all objects, since those that others can replace may be cheaper.
        """
        mean = self._mean_of_actions()
        if mean is None:
            return problem
        if (whole := problem.whole) is not None:
            problem = replace(whole, one_at_a_time=problem.one_at_a_time, timed=problem.timed, wrong=problem.wrong)
        actions = [a if a.step is None else replace(a, cost=self._cost(a.step, mean)) for a in problem.actions]
        return replace(problem, actions=tuple(actions))

    def total(self, steps: Sequence[PlanStep], domain: PlanningDomain, world: World) -> float:
        """Return the cost of steps from `world`; `domain` has its conditions expanded for the present world."""
        if not self._declared:
            mean = self._mean_of_actions()
            return len(steps) if mean is None else sum(self._cost(step, mean) for step in steps)
        ahead = Overlay(world)
        for step in steps:
            ahead.apply(domain.effects(step, ahead))
        spent = Fact(TOTAL_COST.function)
        return value_of(ahead, spent) - value_of(world, spent)

    def _mean_of_actions(self) -> float | None:
        """Return the mean cost of the actions with tries; `None` if no costs follow from experience."""
        if self._experience is not self._library.experience and not self._declared:  # a resumed run receives its own
            self._experience = self._library.experience
            known = [self._experience.seconds_for(action, "") for action in self._actions]
            tried = [seconds for seconds in known if seconds is not None]
            self._mean = fmean(tried) if tried else None
        return self._mean

    def _cost(self, step: PlanStep, mean: float) -> float:
        seconds = self._experience.seconds_for(step.action, str(step))
        return max(round(mean if seconds is None else seconds, 1), _LEAST)
