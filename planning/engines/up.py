"""Engines reached through unified-planning.

The import alone takes about a second, so only the worker process imports this module.
"""

from __future__ import annotations

import subprocess
from importlib import import_module
from typing import TYPE_CHECKING, Any

from unified_planning.engines import PlanGenerationResultStatus, pddl_planner
from unified_planning.plans import TimeTriggeredPlan

from planning.engines.request import read
from planning.engines.translation import ticks, translated
from planning.strips import Problem

if TYPE_CHECKING:
    from unified_planning.engines.results import PlanGenerationResult
    from unified_planning.model import Problem as UpProblem

    from planning.engines.registry import Engine
    from planning.engines.worker import Answers, Request, Search


_NO_MEMORY = ("OutOfMemoryError", "insufficient memory")
"""What Java says."""


def searching(engine: Engine) -> Search:
    """The search with an engine made by the class `module:name`, for `planning.engines.worker`.

    Raises:
        ImportError: it is not installed.
    """
    module, _, name = engine.made_by.partition(":")
    make = getattr(import_module(module), name)

    def search(request: Request) -> Answers:
        problem = read(request)
        return _found(make(), translated(problem, costs="costs" in engine.features & problem.features), problem)

    return search


def _found(engine: Any, translation: UpProblem, problem: Problem) -> Answers:
    answer = engine.solve(translation)
    if "durations" in problem.features and answer.plan is not None:
        yield {"timed": _timed(answer.plan, ticks(problem))}
    else:
        yield _actions(answer)


def _actions(result: PlanGenerationResult) -> list[int] | None:
    """Indices into the problem's actions, or `None` if it is proven that there is no plan.

    Raises:
        MemoryError: the engine says that it ran out of it.
        RuntimeError: it ended without saying anything of this.
    """
    if isinstance(result.plan, TimeTriggeredPlan):
        timed = sorted(result.plan.timed_actions, key=_start)
        return [int(action.action.name[1:]) for _, action, _ in timed]
    if result.plan is not None:
        return [int(step.action.name[1:]) for step in result.plan.actions]
    if result.status is PlanGenerationResultStatus.UNSOLVABLE_PROVEN:
        return None
    said = " ".join(str(message.message) for message in result.log_messages or ())
    if any(words in said for words in _NO_MEMORY):
        raise MemoryError
    raise RuntimeError(f"it ended with status {result.status.name} {' '.join(said.split())[-200:]}".rstrip())


def _timed(plan: TimeTriggeredPlan, ticks: int) -> list[tuple[int, float, float]]:
    """Index, start and duration, in seconds, of actions whose times are in ticks."""
    return [
        (int(action.action.name[1:]), float(start / ticks), float((duration or 0) / ticks))
        for start, action, duration in plan.timed_actions
    ]


def _start(timed: Any) -> Any:
    return timed[0]


def _run_in_our_group(
    engine: Any, cmd: list[str], output_stream: object = None, timeout: float | None = None  # noqa: ARG001
) -> tuple[bool, tuple[list[str], list[str]], int]:
    """In the place of unified-planning's `run_command`, which would give the program a session of its own.

    There it would outlive the search that it belongs to.
    """
    done = subprocess.run(cmd, capture_output=True, stdin=subprocess.DEVNULL, text=True, check=False)  # noqa: S603
    return False, ([done.stdout], [done.stderr]), done.returncode


pddl_planner.run_command = _run_in_our_group
