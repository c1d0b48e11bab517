"""Whether a plan leads to its goal, found by carrying it out in thought."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from knowledge_base.errors import InputError
from knowledge_base.language.evaluation import World, explain, holds
from knowledge_base.language.expression import Expression
from knowledge_base.overlay import Overlay
from planning.plan import Plan
from planning.posing.derived import derivation

if TYPE_CHECKING:
    from planning.domain import PlanningDomain
    from planning.plan import PlanStep


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
    derived = derivation(domain)
    ahead = Overlay(derived.world(world))
    for index, step in enumerate(plan.steps):
        why_not = _obstacle(step, derived.domain, ahead)
        if why_not is not None:
            return Validation(valid=False, failing_step=index, why=why_not)
    try:
        wanted = derived.expand(goal)
        reached = holds(wanted, ahead)
        return Validation(reached, why="" if reached else str(explain(wanted, ahead).deciding))
    except InputError as error:
        return Validation(valid=False, why=str(error))


def _obstacle(step: PlanStep, domain: PlanningDomain, ahead: Overlay) -> str | None:
    """Take the step, or say why that cannot be."""
    try:
        if not domain.applicable(step, ahead):
            return str(domain.why_not(step, ahead).deciding)
        ahead.apply(domain.effects(step, ahead))
    except InputError as error:
        return str(error)
    return None
