"""A cache of planning outcomes by problem."""

from __future__ import annotations

import time
from collections import OrderedDict
from contextlib import aclosing
from dataclasses import replace
from typing import TYPE_CHECKING

from planning.plan import PlanFound, PlanningOutcome, ProvenUnsolvable

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Hashable

    from planning.engines.planner import PlannerProcess
    from planning.engines.race import PlannerRace
    from planning.strips import Problem

LARGEST = 64
"""Number of cached problems; one of 50 items has about 3,000 ground actions."""


class CachingPlanner:
    """A planner that answers immediately if the same problem comes again.

    Two problems are the same if their facts, goal, numbers and ground actions are equal by value. A cached plan is
    therefore as valid as a new one; its caller validates each plan against the present world. Plans and proofs are
    cached, failures and timeouts are not.

    Args:
        planner: solves problems that are not cached.
        largest: number of problems; the least recently used is evicted first.
    """

    def __init__(self, planner: PlannerProcess | PlannerRace, largest: int = LARGEST) -> None:
        self._planner = planner
        self._largest = largest
        self._known: OrderedDict[Hashable, PlanFound | ProvenUnsolvable] = OrderedDict()

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        """Return the outcome; a cached plan has `from_cache` and takes no time."""
        async with aclosing(self.plans(problem, seconds)) as plans:
            return await anext(plans)

    async def plans(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """Yield the planner's outcomes and cache the best; a cached outcome is the only one."""
        started, key = time.monotonic(), _key(problem)
        known = self._known.get(key)
        if known is not None:
            self._known.move_to_end(key)
            yield _recalled(known, time.monotonic() - started)
            return
        async with aclosing(self._planner.plans(problem, seconds)) as plans:
            async for outcome in plans:
                self._remember(key, outcome)
                yield outcome

    async def close(self) -> None:
        """End the planner's processes."""
        self.kill()

    def kill(self) -> None:
        """End the planner's processes; needs no event loop."""
        self._planner.kill()

    def _remember(self, key: Hashable, outcome: PlanningOutcome) -> None:
        if isinstance(outcome, PlanFound | ProvenUnsolvable):
            self._known[key] = outcome
            self._known.move_to_end(key)
            if len(self._known) > self._largest:
                self._known.popitem(last=False)


def _recalled(known: PlanFound | ProvenUnsolvable, seconds: float) -> PlanFound | ProvenUnsolvable:
    known = replace(known, failures=())
    return replace(known, from_cache=True, seconds=seconds, translated=0.0) if isinstance(known, PlanFound) else known


def _key(problem: Problem) -> Hashable:
    """Return the key of a problem; the order of facts does not matter."""
    numbers = frozenset(problem.numbers.items())
    goal = (frozenset(problem.goal), frozenset(problem.bounds))
    timed = None if problem.timed is None else _key(problem.timed)
    return (problem.domain, frozenset(problem.init), numbers, goal, problem.actions, problem.unreachable, timed)
