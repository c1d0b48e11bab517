"""Results of a search for a plan."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from planning.execution.outcomes import NoPlanKind
from planning.model.plan import Plan, PlanFound, PlanStep

if TYPE_CHECKING:
    from planning.analysis.validation import Validation
    from planning.execution.plan_progress import PlanProgress
    from planning.execution.planner_call import Improvements
    from planning.ordering.partial_order import PartialOrder


@dataclass(frozen=True, slots=True)
class Found:
    """A plan that leads from the present world to the goal.

    Attributes:
        answer: the outcome of the planner, with the plan.
        kept: the number of last steps that the plan shares with the replaced plan.
        better: the better plans of the planner; the caller must close them.
        order: the partial order of the plan, computed by the validation; `None` for a plan with a schedule.
        progress: the progress of the plan before its first step; `None` before the validation.
        version: the version of the knowledge base on which the plan was validated.
        foreseen: the result of the simulation; `None` before it, and without a foresight.
        overtaken: whether the plan can be executed, but does not lead to the goal, since the world has changed during
            the search. A new plan is then made while the first step runs.
    """

    answer: PlanFound
    kept: int = 0
    better: Improvements | None = None
    order: PartialOrder | None = None
    progress: PlanProgress | None = None
    version: int = -1
    foreseen: Validation | None = None
    overtaken: bool = False

    @property
    def steps(self) -> tuple[PlanStep, ...]:
        """The steps of the plan."""
        return self.answer.plan.steps

    def known_order(self, steps: tuple[PlanStep, ...], version: int) -> PartialOrder | None:
        """Return the partial order if the plan has these steps and was validated on this version; otherwise `None`."""
        return self.order if self.version == version and self.steps == steps else None

    def known_progress(self, steps: tuple[PlanStep, ...], version: int) -> PlanProgress | None:
        """Return the progress if the plan has these steps and was validated on this version; otherwise `None`."""
        return self.progress if self.version == version and self.steps == steps else None

    def with_steps(self, steps: tuple[PlanStep, ...]) -> Found:
        """Return the result with other steps of the plan."""
        return replace(self, answer=replace(self.answer, plan=Plan(steps)), order=None, progress=None)

    @property
    def cost(self) -> float:
        """The cost of the plan as the simulation tells; `math.inf` without one."""
        cost = None if self.foreseen is None else self.foreseen.cost
        return math.inf if cost is None else cost

    @property
    def costliest_step(self) -> PlanStep | None:
        """The step to which the simulation assigns the largest part of the cost."""
        number = None if self.foreseen is None or self.foreseen.cost is None else self.foreseen.costliest_step
        return None if number is None else self.steps[number]

    async def close(self) -> None:
        """Close the generator of better plans."""
        if self.better is not None:
            await self.better.aclose()


@dataclass(frozen=True, slots=True)
class NotFound:
    """Result of a search without a plan.

    Attributes:
        kind: the `kind` of the outcome `no_plan`.
        reason: the explanation, as text.
    """

    kind: NoPlanKind
    reason: str
