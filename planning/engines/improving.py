"""A planner that goes on: a plan at once, and better ones later."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator

    from planning.plan import PlanningOutcome
    from planning.strips import Problem


@runtime_checkable
class Improving(Protocol):
    """What a `Planner` can offer besides `solve`; asked for in real time only, since no two such runs are the same."""

    def plans(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """First what `solve` says, then each better plan that is found within the `seconds` of real time.

        It is closed when no better plan is of use any more, which ends the search.
        """
        ...
