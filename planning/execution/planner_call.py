"""Asking one planner, however it behaves: there is an answer within a bound of real time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from knowledge_base.errors import described, text_of
from planning.engines.planner import Improving
from planning.execution.improvements import Improvements
from planning.execution.planner_deadline import LateError, bounded
from planning.plan import EngineFailed, PlanFound, PlanningOutcome, TimedOut

if TYPE_CHECKING:
    import asyncio
    from collections.abc import Awaitable

    from dsc.sequencer.clock import LoopClock
    from planning.engines.planner import Planner
    from planning.strips import Problem

PATIENCE = 90.0
"""Seconds of real time beyond its own for a planner that does not keep to it; starting an engine may take a minute."""

Answer = tuple[PlanningOutcome, Improvements | None]
"""What it says, and what may follow if it goes on; to be closed."""


class Asking:
    """A planner, and the clock of the run that asks it.

    Attributes:
        name: of the planner's class, by which it is blamed.
    """

    def __init__(self, planner: Planner, clock: LoopClock) -> None:
        self._planner = planner
        self._clock = clock
        self.name = type(planner).__name__

    def give_up_at(self, seconds: float) -> asyncio.Timeout:
        """A bound for all asking in a block, in simulated time.

        That is held while anybody searches; a planner that is itself simulated may let it pass, but not for ever.
        """
        return self._clock.timeout_at(self._clock.now() + seconds + PATIENCE if self._clock.simulated else math.inf)

    async def solve(self, problem: Problem, seconds: float, *, going_on: bool = True) -> Answer:
        """The planner's answer, and what may follow if it goes on (not in simulated time, which is the same twice)."""
        if going_on and not self._clock.simulated and isinstance(self._planner, Improving):
            plans = self._planner.plans(problem, seconds)
            better = Improvements(plans, self.name)
            answer = await self._bounded(anext(plans), seconds)
            if isinstance(answer, PlanFound):
                return answer, better
            await better.aclose()
            return answer, None
        return await self._bounded(self._planner.solve(problem, seconds), seconds), None

    async def _bounded(self, answering: Awaitable[object], seconds: float) -> PlanningOutcome:
        """The answer, or that there was none in time or none at all; in real time, whatever the clock says."""
        engine = self.name
        try:
            with self._clock.hold():
                answer = await bounded(answering, seconds + PATIENCE, engine)
        except LateError as late:
            if late.obeyed:
                return TimedOut(engine, seconds)
            return EngineFailed(engine, "no answer in time, and it goes on although it was told to stop")
        except Exception as error:  # noqa: BLE001  whatever a planner does wrong must not end the run
            return EngineFailed(engine, described(error))
        if isinstance(answer, PlanningOutcome):
            return answer
        return EngineFailed(engine, f"no answer: {text_of(answer, repr):.80}")
