"""Attempt chooses the escalation step for a failed plan, after the rules of a plot and before `gave_up` (S1.4, S4.2).

The same failure in the same situation never gets the same answer twice. Each answer and their number are bounded.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from knowledge_base.language.syntax.effect import effect_conditions
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.language.syntax.identity_cache import IdentityCache
from knowledge_base.view import View
from planning.domain import PlanningDomain
from planning.plan import PlanStep
from planning.problem.relevance import names_of, relevant

MOST_RESUMED = 3
"""The number of times that one attempt resumes at the same step without a new plan."""


class EscalationStep(Enum):
    """The answers to a failed plan, in the order in which they are tried."""

    RESUME = "the same plan goes on"
    OTHER_CANDIDATE = "the same plan goes on, the step done in another way"
    REPLAN = "a new plan"
    EXCLUDE = "a new plan without the step"
    GIVE_UP = "giving up"


@dataclass(frozen=True, slots=True)
class Failure:
    """A step that failed.

    Attributes:
        step: the step.
        why: the outcome, or the condition that did not hold.
        situation: digest of the world then; see `situation`.
    """

    step: PlanStep
    why: str
    situation: str


@dataclass(slots=True)
class Attempt:
    """The answers given so far on the way to one goal, over all plans for it.

    Attributes:
        replans: the number of plans that replaced a failed one.
        failures: the number of times that each failure occurred in the same situation.
        resumed: the number of times that a plan resumed at a step.
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
        """Count a failure and return the answer to it.

        Args:
            failure: the failed step and its reason.
            stands: whether the plan still leads to the goal, the step included.
            others: whether another candidate implements the step.
        """
        self.failures[failure] += 1
        if stands and self.resumed[failure.step] < MOST_RESUMED:
            answers = [
                EscalationStep.RESUME,
                *([EscalationStep.OTHER_CANDIDATE] if others else []),
                EscalationStep.EXCLUDE,
            ]
        else:
            answers = [EscalationStep.REPLAN, EscalationStep.EXCLUDE]
        tried = self.failures[failure] - 1
        return answers[tried] if tried < len(answers) else EscalationStep.GIVE_UP

    def interrupted(self, step: PlanStep | None) -> EscalationStep:
        """Return the answer for a plan that its monitor stopped; `step` is the one at which it could resume."""
        return (
            EscalationStep.RESUME if step is not None and self.resumed[step] < MOST_RESUMED else EscalationStep.REPLAN
        )


def situation(domain: PlanningDomain, world: View, goal: Expression) -> str:
    """Return a digest of the part of the world that the problem of reaching the goal depends on."""
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
