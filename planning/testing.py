"""Tests of programs that plan: a planner with seeded faults that fails, hangs, crashes or lies.

No other module imports it.
"""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import Awaitable, Callable
from dataclasses import replace

from dsc.sequencer.clock import released
from dsc.testing.faults import Fault, Faults, InjectedError
from planning.engines.planner import Planner
from planning.plan import EngineFailed, Plan, PlanFound, PlanningOutcome
from planning.strips import Problem

_ENGINE = "faulty"
_FAULTS = (Fault.PLANNER_FAILS, Fault.PLANNER_HANGS, Fault.PLANNER_DIES, Fault.PLANNER_LIES)


async def _nothing(_: str) -> None:
    pass


class FaultyPlanner:
    """A `Planner` with faults; each problem always gets the same fault, so that a resumed run meets it again.

    The faults:

    - It reports a failure.
    - It hangs until its caller cancels it, in simulated time if the run is simulated.
    - It raises an error.
    - It lies: its plan lacks the last step.

    Args:
        planner: finds the plans.
        faults: selects the problems with a fault.
        reached: called with `while planning`, see `Crashes.reached`.
    """

    def __init__(self, planner: Planner, faults: Faults, reached: Callable[[str], Awaitable[None]] = _nothing) -> None:
        self._planner = planner
        self._faults = faults
        self._reached = reached

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        """Return the planner's outcome, or that of the fault drawn for the problem."""
        await self._reached("while planning")
        fault = self._faults.draw(_subject(problem), _FAULTS)
        if fault is Fault.PLANNER_FAILS:
            return EngineFailed(_ENGINE, "it was to fail")
        if fault is Fault.PLANNER_HANGS:
            with released():
                await asyncio.get_running_loop().create_future()
        if fault is Fault.PLANNER_DIES:
            raise InjectedError("it was to die")
        outcome = await self._planner.solve(problem, seconds)
        if fault is Fault.PLANNER_LIES and isinstance(outcome, PlanFound) and not outcome.plan.schedule:
            return replace(outcome, plan=Plan(outcome.plan.steps[:-1]))
        return outcome


def _subject(problem: Problem) -> str:
    facts = [sorted(map(str, part)) for part in (problem.init, problem.goal)]
    text = f"{facts} {sorted((str(name), value) for name, value in problem.numbers.items())} {len(problem.actions)}"
    return f"problem {hashlib.blake2b(text.encode(), digest_size=8).hexdigest()}"
