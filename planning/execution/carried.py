"""A plan on its way, as the planning component remembers it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator

    from knowledge_base.language.expression import Expression
    from planning.execution.course import Course
    from planning.execution.repair import Attempt
    from planning.ordering.order import PartialOrder
    from planning.plan import PlanningOutcome, PlanStep


@dataclass(slots=True)
class Carried:
    """A plan that has a plot, and is or was carried out.

    Attributes:
        name: its plot's.
        goal: what was asked for.
        course: how far it is.
        order: which of its steps wait for which.
        attempt: what has been tried for its goal.
        holder, seconds, replans: of the dynamic state that it is for.
        better: what comes of a planner that goes on after it.
        following: steps that take its place; if their plan began with the step at work, once that has ended.
        following_name: what the plot of these steps will be called; `None` if they are steps of this very plan.
        following_kept: how many steps of this plan they end with.
        begun: is told when a step begins, while the plan is watched.
        stopped: who watched it ended it; otherwise a step did.
    """

    name: str
    goal: Expression
    course: Course
    order: PartialOrder
    attempt: Attempt
    holder: str
    seconds: float
    replans: int
    better: AsyncGenerator[PlanningOutcome, None] | None = None
    following: tuple[PlanStep, ...] | None = None
    following_name: str | None = None
    following_kept: int = 0
    begun: Callable[[int], None] | None = None
    stopped: bool = False
