"""Service of the queue of a robot's goals, one after the other."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

from dsc.runs.archive import is_unfinished
from dsc.sequencer.run_end import SUSPENDED
from knowledge_base.errors import InputError, StoreError
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.store import KnowledgeBase
from planning.execution.goals import LATE, GoalQueue, QueuedGoal
from planning.problem.construction import check_goal
from planning.robot.run import Run


class ServingRobot(Protocol):
    """The part of `Robot` that serves goals."""

    knowledge: KnowledgeBase
    store: Path | None

    @property
    def goals(self) -> GoalQueue:
        """See `RobotProgram.goals`."""
        ...

    def start(
        self, goal: str, /, *, seconds: float, replans: int, open_ended: bool, header: Mapping[str, Any]
    ) -> Run[Any]:
        """See `Robot.start`."""
        ...

    def resuming(self) -> Run[Any]:
        """See `Robot.resuming`."""
        ...


async def serve_goals(robot: ServingRobot, *, until_empty: bool, seconds: float, replans: int) -> None:
    """Serve the queue of a robot, see `Robot.serve`."""
    goals, left = robot.goals, robot.goals.list("running")
    resumed = left and robot.store is not None and is_unfinished(robot.store)
    if resumed and not await _serve(robot, left[0], robot.resuming()):
        return
    goals.recover()
    while (queued := goals.first() if until_empty else await goals.next()) is not None:
        try:
            check_goal(parse_condition(queued.goal, "goal"), robot.knowledge)
        except InputError as error:
            goals.end(queued.id, reached=False, reason=str(error))
            continue
        run = robot.start(queued.goal, seconds=seconds, replans=replans, open_ended=True, header={"goal": queued.id})
        if not await _serve(robot, queued, run):
            return


async def _serve(robot: ServingRobot, queued: QueuedGoal, run: Run[Any]) -> bool:
    """Wait for the end of the run of a goal, and keep the end; return `False` for a suspended run."""
    goals = robot.goals
    remaining = goals.begin(queued.id, run.cancel)
    late = None
    if remaining is not None:
        late = asyncio.get_running_loop().call_later(remaining, run.cancel, LATE)
    try:
        end = await run
    except StoreError:  # e.g. an unfinished run that serves no goal: this goal has not begun
        goals.release(queued.id)
        goals.recover()
        raise
    finally:
        if late is not None:
            late.cancel()
    if end.problem == SUSPENDED:
        return False
    goals.end(queued.id, reached=end.reached, reason="reached" if end.reached else end.reason)
    return True
