"""A planner that goes on: better plans for a problem that has a plan already."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from planning.plan import PlanFound
    from planning.strips import Problem


@runtime_checkable
class Improving(Protocol):
    """What a `Planner` can offer besides `solve`."""

    def improved(self, problem: Problem) -> AsyncIterator[PlanFound]:
        """Better plans for a problem that `solve` found a plan for, as they come; it ends when no more will.

        It is closed early when the plan ends. A better plan replaces the steps that have not begun.
        """
        ...
