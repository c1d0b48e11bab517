"""Support for tests of programs that plan: a planner with seeded faults.

The faults are a failure, a planner that hangs, a crash and a wrong plan. No other module imports this module.
"""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import Awaitable, Callable
from dataclasses import replace

from dsc.sequencer.clock import released
from dsc.testing.faults import Fault, Faults, InjectedError
from planning.engines.planner import Planner
from planning.model.plan import EngineFailed, Plan, PlanFound, PlanningOutcome
from planning.model.problem import Problem

_ENGINE = "faulty"
_FAULTS = (Fault.PLANNER_FAILS, Fault.PLANNER_HANGS, Fault.PLANNER_DIES, Fault.PLANNER_LIES)


async def _nothing(_: str) -> None:
    pass


class FaultyPlanner:
    """A `Planner` with faults. Equal problems have equal faults, so that a resumed run meets a fault again.

    The faults:

    - The planner reports a failure.
    - The planner hangs until its caller cancels it, in simulated time if the run is simulated.
    - The planner raises an error.
    - The planner returns a wrong plan, which lacks the last step.

    Args:
        planner: the planner that finds the plans.
        faults: selects the problems that have a fault.
        reached: called with `while planning` before each search, see `Crashes.reached`.
    """

    def __init__(self, planner: Planner, faults: Faults, reached: Callable[[str], Awaitable[None]] = _nothing) -> None:
        self._planner = planner
        self._faults = faults
        self._reached = reached

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        """Return the outcome of the planner, or the effect of the fault that was drawn for the problem."""
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
