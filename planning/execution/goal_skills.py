"""Skills with which the plot `serve_goals` serves a robot's queue of goals, and the query that sets a goal."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.components.ports import query
from dsc.errors import SkillError
from dsc.skills import skill
from knowledge_base.errors import InputError
from planning.execution.goals import LATE, GoalQueue
from planning.execution.outcomes import GoalEnded, GoalOver, GoalPursued, GoalTaken


class GoalSkills(Component):
    """The part of the planning component that takes goals from a queue, watches them and notes their ends.

    Args:
        goals: returns the queue of goals, which one state at a time serves.
    """

    name = "planner"
    concurrent = True

    def __init__(self, goals: Callable[[], GoalQueue]) -> None:
        super().__init__()
        self._goals = goals

    @skill(after_crash="repeat", unlimited=True)
    async def next_goal(self, call: SkillCall) -> GoalTaken:  # noqa: ARG002
        """Wait for the next goal of the queue; a goal whose pursuit was interrupted comes first."""
        goals = self._goals()
        goals.recover()
        taken = await goals.next()
        if taken is None:
            raise SkillError("the robot is closed; it serves no further goal")
        return GoalTaken(goal=taken.goal, number=taken.id)

    @skill(after_crash="repeat", unlimited=True)
    async def watch_goal(self, call: SkillCall, number: int) -> GoalOver:  # noqa: ARG002
        """Note that a goal is running, and end when it is withdrawn or its deadline passes."""
        goals = self._goals()
        if goals.get(number).state not in {"waiting", "running"}:
            return GoalOver(reason=goals.get(number).reason)
        over: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        remaining = goals.begin(number, over.set_result)
        try:
            return GoalOver(reason=await asyncio.wait_for(over, remaining))
        except TimeoutError:
            return GoalOver(reason=LATE)
        finally:
            goals.release(number)

    @skill(after_crash="repeat")
    async def end_goal(self, call: SkillCall, number: int, reached: bool, reason: str) -> GoalEnded:  # noqa: ARG002, FBT001
        """Note the end of a goal; a goal that is withdrawn stays withdrawn."""
        self._goals().end(number, reached=reached, reason=reason)
        return GoalEnded()

    @query
    async def pursue(self, goal: str, priority: float = 0.0) -> GoalPursued:
        """Put a goal in the queue, and wait for its end; the goal is withdrawn if the caller is cancelled.

        If an equal goal waits or runs already, the query waits for that goal: a restarted caller finds its goal again.
        """
        goals = self._goals()
        equal = (one.id for one in goals.list() if one.goal == goal)
        try:
            number = next(equal, None) or goals.put(goal, priority=priority)
        except InputError as error:
            return GoalPursued(reached=False, reason=str(error))
        try:
            ended = await goals.end_of(number)
        except asyncio.CancelledError:
            goals.withdraw(number, "the caller was cancelled")
            raise
        return GoalPursued(reached=ended.state == "reached", reason=ended.reason)


def planner_services() -> GoalSkills:
    """Return a component with the ports that the planning component of a run provides, for checks before a run."""

    def none() -> GoalQueue:
        raise InputError("only a run has a queue of goals")

    return GoalSkills(none)
