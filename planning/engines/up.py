"""Engines reached through unified-planning.

The import alone takes about a second, so only the worker process imports this module.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from unified_planning.engines import PlanGenerationResultStatus
from up_pyperplan.engine import EngineImpl  # type: ignore[import-untyped]

from planning.engines.translation import translated

if TYPE_CHECKING:
    from unified_planning.environment import Environment
    from unified_planning.model import InstantaneousAction

    from planning.strips import Problem


# Greedy best-first search visits every state, except those that h_FF finds hopeless even without deletions:
# an exhausted search is a proof. The binding calls it incomplete because it compares a function with names.
_EXHAUSTED = (
    PlanGenerationResultStatus.UNSOLVABLE_PROVEN,
    PlanGenerationResultStatus.UNSOLVABLE_INCOMPLETELY,
)


class Pyperplan(EngineImpl):  # type: ignore[misc]  # the package has no types
    """pyperplan, with greedy best-first search and h_FF, giving the same plan for the same problem.

    The binding keeps an action's effects in sets ordered by memory address, and pyperplan breaks ties by
    that order; here they are in the order of their names. (String hashes must be fixed, too: PYTHONHASHSEED.)
    """

    def __init__(self) -> None:
        super().__init__(search="gbf", heuristic="hff")

    def _convert_action(self, action: InstantaneousAction, environment: Environment) -> Any:
        converted = super()._convert_action(action, environment)
        for name in ("addlist", "dellist"):
            atoms = sorted(getattr(converted.effect, name), key=_by_name)
            setattr(converted.effect, name, dict.fromkeys(atoms))
        return converted


def _by_name(atom: Any) -> str:
    return str(atom.name)


def solve(problem: Problem) -> list[int] | None:
    """Indices into `problem.actions` that lead to the goal, or `None` if that is proven impossible.

    Raises:
        RuntimeError: the engine ended without saying either.
    """
    result = Pyperplan().solve(translated(problem))
    if result.plan is not None:
        return [int(step.action.name[1:]) for step in result.plan.actions]
    if result.status in _EXHAUSTED:
        return None
    raise RuntimeError(f"the engine ended with status {result.status.name}")
