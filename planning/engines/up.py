"""Engines reached through unified-planning; its problem is built straight from ours, without PDDL text.

The import alone takes about a second, so only the worker process imports this module.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from unified_planning.engines import PlanGenerationResultStatus
from unified_planning.environment import Environment
from unified_planning.model import Fluent, InstantaneousAction
from unified_planning.model import Problem as UpProblem
from up_pyperplan.engine import EngineImpl  # type: ignore[import-untyped]

if TYPE_CHECKING:
    from knowledge_base.facts import Fact
    from planning.strips import GroundAction, Problem


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
    result = Pyperplan().solve(_Translation(problem).translated)
    if result.plan is not None:
        return [int(step.action.name[1:]) for step in result.plan.actions]
    if result.status in _EXHAUSTED:
        return None
    raise RuntimeError(f"the engine ended with status {result.status.name}")


class _Translation:
    """The problem with facts as fluents (`f0`, ...) and actions (`a0`, ...), all without parameters.

    Names are numbers in the problem, so that nothing depends on what objects are called. A fresh
    environment each time: unified-planning keeps every expression of an environment for ever.
    """

    def __init__(self, problem: Problem) -> None:
        self._environment = Environment()
        self._environment.credits_stream = None
        self._fluents: dict[Fact, Fluent] = {}
        self.translated = UpProblem("problem", self._environment)
        for one in problem.init:
            self.translated.set_initial_value(self._fluent(one), value=True)
        for one in problem.goal:
            self.translated.add_goal(self._fluent(one))
        for number, action in enumerate(problem.actions):
            self.translated.add_action(self._action(f"a{number}", action))

    def _fluent(self, one: Fact) -> Fluent:
        if one not in self._fluents:
            self._fluents[one] = Fluent(f"f{len(self._fluents)}", environment=self._environment)
            self.translated.add_fluent(self._fluents[one], default_initial_value=False)
        return self._fluents[one]

    def _action(self, name: str, action: GroundAction) -> InstantaneousAction:
        translated = InstantaneousAction(name, _env=self._environment)
        for one in action.precondition:
            translated.add_precondition(self._fluent(one))
        for one in action.adds:
            translated.add_effect(self._fluent(one), value=True)
        for one in action.deletes:
            translated.add_effect(self._fluent(one), value=False)
        return translated
