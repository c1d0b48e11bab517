"""Plans for the goals in an editor's texts, each made in another process and kept until a text changes."""

from __future__ import annotations

import asyncio
from collections.abc import Hashable, Mapping, Sequence
from pathlib import Path
from typing import Any

from dsc.editing.disk import Disk
from dsc.editing.goals import Goal, unknown_values
from dsc.editing.project_command import ProjectCommand
from dsc.editing.projects import Project
from knowledge_base.errors import InputError

PLAN_S, START_S = 5.0, 20.0
"""Time limits in seconds: of the search for a plan, and of the robot's code before and after it."""
_ENDINGS = frozenset({".py", ".yaml", ".yml", ".pddl"})
_PASSING = frozenset({"not_planned", "timed_out", "engine_failed"})


class Plans:
    """The plans of an editor's goals.

    Args:
        command: a command that plans a goal, as `planning.cli.goal_planning` does.
        seconds: time limit of the search for a plan.
    """

    def __init__(self, command: Sequence[str], seconds: float = PLAN_S) -> None:
        self._command = ProjectCommand(command, seconds + START_S, "planning")
        self._seconds = seconds
        self._kept: dict[Hashable, tuple[Hashable, asyncio.Task[dict[str, Any]]]] = {}

    async def plan(self, file: Path, goal: Goal, project: Project | None, texts: Mapping[Path, str]) -> dict[str, Any]:
        """Return the plan of a goal, with `outcome`, `steps`, and the `text` for users.

        Args:
            file: the file of the goal.
            goal: the goal.
            project: the project around the file.
            texts: the unsaved texts by file.
        """
        reason = unknown_values(goal.condition) if goal.condition else ""
        if project is None:
            reason = "no robot is found around this file, and so no initial world"
        if reason or project is None:
            return {"outcome": "not_planned", "steps": [], "text": reason}
        subject = ("condition", goal.condition) if goal.condition else ("problem", str(file))
        key, version = (project, subject), _version(project, texts)
        before, task = self._kept.get(key, (None, None))
        if task is None or before != version or _is_passing(task):
            if task is not None:
                task.cancel()
            task = asyncio.ensure_future(self._ask(project, texts, *subject))
            self._kept[key] = version, task
        return await asyncio.shield(task)  # another question may wait for the same plan

    async def stop(self) -> None:
        """Cancel the plans in progress."""
        tasks = [task for _, task in self._kept.values() if not task.done()]
        for task in tasks:
            task.cancel()
        if tasks:
            await asyncio.wait(tasks)

    async def _ask(self, project: Project, texts: Mapping[Path, str], kind: str, subject: str) -> dict[str, Any]:
        try:
            arguments = (project.target, kind, subject, f"{self._seconds:g}")
            answer: dict[str, Any] = await self._command.run(project.root, texts, *arguments)
        except InputError as error:
            return {"outcome": "not_planned", "steps": [], "text": str(error)}
        return answer


def _is_passing(task: asyncio.Task[dict[str, Any]]) -> bool:
    """Return whether the same question may have another answer: the process was too slow, or has failed."""
    return task.cancelled() or (task.done() and task.result()["outcome"] in _PASSING)


def _version(project: Project, texts: Mapping[Path, str]) -> Hashable:
    """Return a value that changes with the unsaved texts, and with the files of a project."""
    saved = frozenset(
        (file, file.stat().st_mtime_ns) for file in Disk().files_in(project.root, _ENDINGS) if file.is_file()
    )
    return saved, frozenset(texts.items())
