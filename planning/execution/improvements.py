"""What comes of a planner that goes on after its first plan; it can be closed whatever the planner does."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Self

from knowledge_base.errors import described
from planning.execution import planner_deadline

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator

    from planning.plan import PlanningOutcome


class Improvements:
    """An asynchronous iterator, to be closed.

    Args:
        better: what the planner gives (`Improving.plans`).
        name: of the planner, to be blamed.
    """

    def __init__(self, better: AsyncGenerator[PlanningOutcome, None], name: str) -> None:
        self._better = better
        self._name = name

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> PlanningOutcome:
        return await planner_deadline.bounded(anext(self._better), math.inf, self._name)

    async def aclose(self) -> None:
        """No better plan is of use any more."""
        try:
            await planner_deadline.bounded(self._better.aclose(), planner_deadline.STOPPING, self._name)
        except planner_deadline.LateError:  # it has been blamed if it did not obey
            return
        except Exception as error:  # noqa: BLE001  whatever a planner does wrong must not end the run
            planner_deadline.blame(self._name, f"it cannot be closed: {described(error)}")
