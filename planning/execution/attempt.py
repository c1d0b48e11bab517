"""Attempts: the history of failures for one goal, and the choice of the next escalation step (S1.4).

After the rules of the plot have failed, `Attempt` chooses the next escalation step. An equal failure in an equal
situation never has the same answer twice. The number of times that each answer is tried is bounded.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from planning.model.plan import PlanStep

MOST_RESUMED = 3
"""The maximum number of times that an attempt resumes at one step without a new plan."""


class EscalationStep(Enum):
    """The answers to a failed plan, in the order in which they are tried."""

    RESUME = "the same plan goes on"
    OTHER_CANDIDATE = "the same plan goes on, the step done in another way"
    REPLAN = "a new plan"
    EXCLUDE = "a new plan without the step"
    GIVE_UP = "giving up"


@dataclass(frozen=True, slots=True)
class Failure:
    """Failure of a step in a situation.

    Attributes:
        step: the failed step.
        why: the outcome event, or the condition that did not hold.
        situation: a digest of the world at the time of the failure; see `planning.execution.escalation.situation`.
    """

    step: PlanStep
    why: str
    situation: str


@dataclass(slots=True)
class Attempt:
    """History of failures and answers for one goal, over all plans for that goal.

    The history ends when the goal is reached or abandoned. An interruption, e.g. by a handler, does not end it.

    Attributes:
        unmet: the number of false parts of the goal at the last interruption; `None` without one.
        replans: the number of plans that replaced a failed plan.
        failures: the number of occurrences of each failure.
        resumed: the number of times that a plan resumed at each step.
        disturbances: the number of plans that an interruption, or changes by another author, ended since a step was
            last completed.
        outages: the number of skills that failed with `skill_error` since a step was last completed.
    """

    unmet: int | None = None
    replans: int = 0
    disturbances: int = 0
    outages: int = 0
    failures: Counter[Failure] = field(default_factory=Counter)
    resumed: Counter[PlanStep] = field(default_factory=Counter)

    def to_json(self) -> dict[str, Any]:
        """Return the attempt as plain data."""
        failures = [[one.step.to_json(), one.why, one.situation, often] for one, often in self.failures.items()]
        resumed = [[step.to_json(), often] for step, often in self.resumed.items()]
        return {
            "unmet": self.unmet,
            "replans": self.replans,
            "disturbances": self.disturbances,
            "outages": self.outages,
            "failures": failures,
            "resumed": resumed,
        }

    @classmethod
    def from_json(cls, form: Mapping[str, Any]) -> Attempt:
        """Return the attempt that `to_json` wrote as `form`."""
        failures = {
            Failure(PlanStep.from_json(step), why, where): often for step, why, where, often in form["failures"]
        }
        resumed = {PlanStep.from_json(step): often for step, often in form["resumed"]}
        return cls(
            form["unmet"], form["replans"], form["disturbances"], form["outages"], Counter(failures), Counter(resumed)
        )

    def completed(self) -> None:
        """Note that a step was completed."""
        self.disturbances = self.outages = 0

    def failed(self, failure: Failure, *, is_valid: bool, others: bool, outage: bool = False) -> EscalationStep:
        """Count a failure, and return the next escalation step for it.

        Args:
            failure: the failed step, the reason and the situation.
            is_valid: whether the plan, with the failed step, still leads to the goal.
            others: whether another candidate implements the failed step.
            outage: whether the device has failed and not the step, so that further plans may succeed later.
        """
        self.failures[failure] += 1
        if is_valid and self.resumed[failure.step] < MOST_RESUMED:
            answers = [
                EscalationStep.RESUME,
                *([EscalationStep.OTHER_CANDIDATE] if others else []),
                EscalationStep.EXCLUDE,
            ]
        else:
            answers = [EscalationStep.REPLAN, EscalationStep.EXCLUDE]
        tried = self.failures[failure] - 1
        if tried < len(answers):
            return answers[tried]
        return EscalationStep.REPLAN if outage else EscalationStep.GIVE_UP

    def interrupted(self, step: PlanStep | None) -> EscalationStep:
        """Return the escalation step for a plan that its monitor stopped; the plan could resume at `step`, if any."""
        return (
            EscalationStep.RESUME if step is not None and self.resumed[step] < MOST_RESUMED else EscalationStep.REPLAN
        )

    def replan(self, budget: int, *, disturbed: bool) -> bool:
        """Count a replan, or a disturbance by another author, and return whether `budget` allows it."""
        count = self.disturbances if disturbed else self.replans
        if count >= budget:
            return False
        self.replans += not disturbed
        self.disturbances += disturbed
        return True
