"""Plans that were found before, for the same problem again."""

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
"""Problems that are remembered; one of 50 items has about 3,000 ground actions."""


class CachingPlanner:
    """A planner that answers at once when it is asked the same problem again.

    The same is what has the same facts, goal, numbers and ground actions by value, so that a remembered plan is as
    valid as on the first day; that it leads to the goal in the world as it is then is validated by whoever
    executes it, as for a new one. Plans and proofs are remembered, failures and running out of time are not.

    Args:
        planner: asked for what is not known.
        largest: number of problems; the one that was not asked for longest is forgotten first.
    """

    def __init__(self, planner: PlannerProcess | PlannerRace, largest: int = LARGEST) -> None:
        self._planner = planner
        self._largest = largest
        self._known: OrderedDict[Hashable, PlanFound | ProvenUnsolvable] = OrderedDict()

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        """The plan, `from_cache` if it was known, and then after no time."""
        async with aclosing(self.plans(problem, seconds)) as plans:
            return await anext(plans)

    async def plans(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """As the planner's, the best that was found remembered; what is known is the only one."""
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
        """As `close`, without a loop."""
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
    """What determines the answer: the order in which facts were told does not."""
    numbers = frozenset(problem.numbers.items())
    goal = (frozenset(problem.goal), frozenset(problem.bounds))
    timed = None if problem.timed is None else _key(problem.timed)
    return (problem.domain, frozenset(problem.init), numbers, goal, problem.actions, problem.unreachable, timed)
