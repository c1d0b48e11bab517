"""Purposes of plan steps: the conditions that a step establishes, their users, and the goals that it serves."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_base.language.evaluation.world import World
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.language.syntax.text import to_text
from planning.domain import PlanningDomain
from planning.ordering.partial_order import CausalLink, PartialOrder, deordered
from planning.ordering.timed_links import linked
from planning.plan import Plan, PlanStep


@dataclass(frozen=True, slots=True)
class Purpose:
    """The purpose of a step in a plan.

    Attributes:
        number: the step's number, counted from 1.
        step: the step.
        provides: the conditions that it establishes, each with the later step that needs it; `None` is the goal.
        serves: the conditions of the goal that it contributes to, directly or through later steps.
    """

    number: int
    step: PlanStep
    provides: tuple[tuple[Expression, int | None], ...]
    serves: tuple[Expression, ...]

    def __str__(self) -> str:
        """Text such as `3 (pick-up cup1 table): (holding cup1) for step 4; serves (tidy cup1)`."""
        if not self.provides:
            return f"{self.number} {self.step}: nothing needs what it does"
        users: dict[str, list[str]] = {}
        for fact, user in self.provides:
            users.setdefault("the goal" if user is None else f"step {user}", []).append(to_text(fact))
        said = "; ".join(f"{' '.join(facts)} for {user}" for user, facts in users.items())
        direct = {fact for fact, user in self.provides if user is None}
        further = [to_text(fact) for fact in self.serves if fact not in direct]
        return f"{self.number} {self.step}: {said}" + (f"; serves {' '.join(further)}" if further else "")


def why(order: PartialOrder, number: int) -> Purpose:
    """Return the purpose of step `number`, from its causal links."""
    goal = len(order.steps) + 1
    own = [link for link in order.links if link.provider == number]
    provides = tuple((link.fact, None if link.user == goal else link.user) for link in own)
    return Purpose(number, order.steps[number - 1], provides, _served(order.links, number, goal))


def purposes(plan: Plan, domain: PlanningDomain, world: World, goal: Expression) -> tuple[Purpose, ...]:
    """Return the purpose of each step in the plan.

    Raises:
        InputError: the plan does not lead to the goal.
    """
    order = (linked if plan.schedule else deordered)(plan, domain, world, goal)
    return tuple(why(order, number) for number in range(1, len(plan.steps) + 1))


def _served(links: tuple[CausalLink, ...], number: int, goal: int) -> tuple[Expression, ...]:
    reached, before = {number}, 0
    while before != len(reached):  # along a time line, a later step may provide for an earlier one
        before = len(reached)
        reached |= {link.user for link in links if link.provider in reached}
    return tuple(dict.fromkeys(link.fact for link in links if link.provider in reached and link.user == goal))
