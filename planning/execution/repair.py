"""What to do when a plan does not go on: the rungs between the rules of a plot and giving up (S1.4, S4.2).

The same failure in the same situation never gets the same answer twice. Every answer is bounded, so that all of them
together are.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

from knowledge_base.language.effect import effect_conditions
from knowledge_base.language.expression import Expression
from knowledge_base.language.identity_cache import IdentityCache
from knowledge_base.view import View
from planning.domain import PlanningDomain
from planning.plan import PlanStep
from planning.problem.relevance import names_of, relevant
from planning.strips import Problem

MOST_RESUMED = 3
"""How often one attempt goes on at the same step without a new plan."""

EXCLUDED_SECONDS = 120.0
"""Seconds of run time for which new plans do without a step that failed again and again."""


class EscalationStep(Enum):
    """What is tried, in this order."""

    RESUME = "the same plan goes on"
    OTHER_CANDIDATE = "the same plan goes on, the step done in another way"
    REPLAN = "a new plan"
    EXCLUDE = "a new plan without the step"
    GIVE_UP = "giving up"


@dataclass(frozen=True, slots=True)
class Failure:
    """A step that ended otherwise than its plan hoped.

    Attributes:
        step: the step.
        why: the outcome, or what did not hold.
        situation: what was so then, as far as it matters for the goal; see `situation`.
    """

    step: PlanStep
    why: str
    situation: str


@dataclass(slots=True)
class Attempt:
    """What has been tried for one goal, over all plans made for it.

    Attributes:
        replans: how many new plans were made because one did not go on.
        failures: how often each failure was met in the same situation.
        resumed: how often a plan went on at a step.
    """

    replans: int = 0
    failures: Counter[Failure] = field(default_factory=Counter)
    resumed: Counter[PlanStep] = field(default_factory=Counter)

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        failures = [[one.step.to_json(), one.why, one.situation, often] for one, often in self.failures.items()]
        resumed = [[step.to_json(), often] for step, often in self.resumed.items()]
        return {"replans": self.replans, "failures": failures, "resumed": resumed}

    @classmethod
    def from_json(cls, form: Mapping[str, Any]) -> Attempt:
        """The inverse of `to_json`."""
        failures = {
            Failure(PlanStep.from_json(step), why, where): often for step, why, where, often in form["failures"]
        }
        resumed = {PlanStep.from_json(step): often for step, often in form["resumed"]}
        return cls(form["replans"], Counter(failures), Counter(resumed))

    def failed(self, failure: Failure, *, stands: bool, others: bool) -> EscalationStep:
        """The answer to a failure, which is counted.

        Args:
            failure: what happened.
            stands: whether the plan still leads to the goal, the step included.
            others: whether there is another way to do the step.
        """
        self.failures[failure] += 1
        if stands and self.resumed[failure.step] < MOST_RESUMED:
            rungs = [
                EscalationStep.RESUME,
                *([EscalationStep.OTHER_CANDIDATE] if others else []),
                EscalationStep.EXCLUDE,
            ]
        else:
            rungs = [EscalationStep.REPLAN, EscalationStep.EXCLUDE]
        tried = self.failures[failure] - 1
        return rungs[tried] if tried < len(rungs) else EscalationStep.GIVE_UP

    def interrupted(self, step: PlanStep | None) -> EscalationStep:
        """The answer when the plan was stopped from outside; `step` is where it could go on."""
        return (
            EscalationStep.RESUME if step is not None and self.resumed[step] < MOST_RESUMED else EscalationStep.REPLAN
        )


def situation(domain: PlanningDomain, world: View, goal: Expression) -> str:
    """A digest of everything in the world that the problem of reaching the goal depends on."""
    names = _asked.find(goal, domain) or _asked.keep(goal, domain, _asked_about(goal, domain))
    facts = sorted(str(fact) for fact in world.facts() if fact.predicate in names)
    numbers = sorted((str(number), value) for number, value in world.values().items() if number.predicate in names)
    told = repr((sorted(world.nodes().items()), facts, numbers))
    return hashlib.blake2b(told.encode(), digest_size=16).hexdigest()


_asked: IdentityCache[Expression, frozenset[str]] = IdentityCache(size=8)


def _asked_about(goal: Expression, domain: PlanningDomain) -> frozenset[str]:
    actions = relevant(goal, None, domain.actions.values()).actions
    asked = [goal, *(action.precondition for action in actions)]
    asked += [condition for action in actions for condition in effect_conditions(action.effect)]
    return frozenset(name for condition in asked for name in names_of(condition))


def without(problem: Problem, steps: Collection[PlanStep]) -> Problem:
    """The problem of reaching the goal without taking any of these steps."""
    if not steps:
        return problem
    allowed = tuple(action for action in problem.actions if action.step not in steps)
    unsliced = problem.unsliced
    timed = None if problem.timed is None else without(problem.timed, steps)
    whole = None if unsliced is None else lambda: without(unsliced(), steps)
    return replace(problem, actions=allowed, unsliced=whole, timed=timed)
