"""Whether a plan leads to its goal, found by carrying it out in thought."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_base.errors import InputError
from knowledge_base.language.evaluation import World, explain
from knowledge_base.language.expression import Expression
from knowledge_base.overlay import Overlay
from planning.domain import PlanningDomain
from planning.plan import Plan


@dataclass(frozen=True, slots=True)
class Validation:
    """Whether a plan leads to the goal.

    Attributes:
        valid: every step is applicable when its turn comes, and the goal holds at the end.
        failing_step: index of the first step that is not; `None` if it is only the goal that fails.
        why: what does not hold, in PDDL; empty if valid.
    """

    valid: bool
    failing_step: int | None = None
    why: str = ""


def validate(plan: Plan, domain: PlanningDomain, world: World, goal: Expression) -> Validation:
    """Execute `plan` in thought from `world`, which stays as it is.

    Steps that name no action of the domain, or no known object, make the plan invalid like any other; so does
    a goal about an object that is not there any more.
    """
    ahead = Overlay(world)
    for index, step in enumerate(plan.steps):
        try:
            why_not = domain.why_not(step, ahead)
            if not why_not.truth:
                return Validation(valid=False, failing_step=index, why=str(why_not.deciding))
            ahead.apply(domain.effects(step, ahead))
        except InputError as error:
            return Validation(valid=False, failing_step=index, why=str(error))
    try:
        reached = explain(goal, ahead)
    except InputError as error:
        return Validation(valid=False, why=str(error))
    return Validation(valid=True) if reached.truth else Validation(valid=False, why=str(reached.deciding))
