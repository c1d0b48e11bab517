"""Time from a failure to the first action of the new plan, part by part, in a run with the real component.

A robot clears a table. Its first stacking fails, and the two items turn out not to fit: the plan is void, and local
repair is impossible. The measured time is that from the skill's outcome to the call of the next skill.

For this process it is processor time, so that other load hardly counts; a clock around each function measures its part.
For the engine's process it is the processor time of the translation ("translate"), then the real time of the search.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import set_table

from dsc import ActionPlot, Component, Outcome, SkillCall, skill
from knowledge_base.facts import Delta, fact
from knowledge_base.language.syntax.text import to_text
from planning import PlanStep, Robot
from planning.engines import planner as asking
from planning.engines.race import PlannerRace
from planning.execution import escalation, plotting, search
from planning.model.domain import PlanningAction
from planning.model.plan import PlanFound, PlanningOutcome
from planning.model.problem import Problem
from planning.robot.garbage import settled

PARTS = (
    "mend", "pose", "write", "translate", "engine", "validate, de-order", "generate", "bind, dispatch and the rest",
)  # fmt: skip
OURS = tuple(part for part in PARTS if part != "engine")
_HERE = tuple(part for part in OURS if part != "translate")  # the engine's process translates
_WRAPPED = (
    (search, "local_repair", "mend"), (search, "build_problem", "pose"), (search, "deordered", "validate, de-order"),
    (asking, "write_problem", "write"),
    (escalation, "deordered", "validate, de-order"), (plotting, "deordered", "validate, de-order"),
    (plotting, "laid_out", "generate"), (plotting, "plot_of", "generate"),
)  # fmt: skip


def measured(items: int) -> dict[str, float]:
    """Return milliseconds by part, of the second failure, when everything is warm."""
    domain, world = set_table.domain(), set_table.world(items)
    planner = _Clocked()
    robot = _Robot(domain, world, planner)
    with _clocked(planner.spent), settled():  # as `dsc run --real-time` does
        plots = [_plot(action) for action in domain.actions.values()]
        program = Robot(domain, plots, [robot], world, planner=planner, clock="real")
        program.achieve(to_text(set_table.GOAL))
    planner.race.kill()
    if robot.found is None:
        raise SystemExit(f"no plan for {items} items stacks anything twice")
    return robot.found


class _Clocked:
    """A race that adds up the engine's times."""

    def __init__(self) -> None:
        self.race = PlannerRace()
        self.spent: dict[str, float] = defaultdict(float)

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        outcome = await self.race.solve(problem, seconds)
        if isinstance(outcome, PlanFound):
            self.spent["translate"] += outcome.translated
            self.spent["engine"] += outcome.seconds - outcome.translated
        return outcome


class Did(Outcome):
    """The event `did`."""


class Failed(Outcome):
    """The event `failed`."""


class _Robot(Component):
    """Finishes each step immediately; stacking fails the first and second time."""

    name = "robot"

    def __init__(self, domain: Any, world: Any, planner: _Clocked) -> None:
        super().__init__()
        self._domain, self._world, self._planner = domain, world, planner
        self._failed, self._since = 0, 0.0
        self.found: dict[str, float] | None = None

    @skill
    async def act(
        self,
        call: SkillCall,  # noqa: ARG002
        action: str,
        a: str = "",
        b: str = "",
        c: str = "",
        d: str = "",
        e: str = "",
    ) -> Did | Failed:
        now = time.process_time()
        if self._since and self._failed == 2 and self.found is None:
            self._note(now - self._since)
        step = PlanStep(action, tuple(filter(None, (a, b, c, d, e))))
        if action == "stack" and self._failed < 2:
            self._failed += 1
            self._planner.spent.clear()
            self._since = time.process_time()
            return Failed(observed=Delta(removed=(fact("fits", *step.args[:2]),)))
        return Did(observed=self._domain.effects(step, self._world))

    def _note(self, seconds: float) -> None:
        spent = {part: self._planner.spent.get(part, 0.0) for part in PARTS}
        spent[PARTS[-1]] = seconds - sum(spent[part] for part in _HERE)
        self.found = {part: 1000 * one for part, one in spent.items()}


def _plot(action: PlanningAction) -> ActionPlot:
    """Return the action's plot, with one call of the robot's skill."""
    given = dict(zip("abcde", (f"?{parameter.name}" for parameter in action.parameters), strict=False))
    act = {
        "entry": {"trigger": "robot.act", "with": {"action": action.name, **given}},
        "on": {"did": "done", "failed": {"to": "ended", "emit": "failed"}},
    }
    return ActionPlot.model_validate({
        "plot": action.name, "implements": action.name, "emits": {"failed": {}},
        "parameters": {parameter.name: (parameter.types or ("object",))[0] for parameter in action.parameters},
        "states": {"act": act, "done": {"final": True}, "ended": {"final": True}},
    })  # fmt: skip


@contextmanager
def _clocked(spent: dict[str, float]) -> Iterator[None]:
    """Measure each function of `_WRAPPED`; a nested call counts for the outer one."""
    before = [(module, name, getattr(module, name)) for module, name, _ in _WRAPPED]
    inside = [False]

    def clocked(function: Callable[..., Any], part: str) -> Callable[..., Any]:
        def run(*args: Any, **named: Any) -> Any:
            if inside[0]:
                return function(*args, **named)
            inside[0], started = True, time.thread_time()
            try:
                return function(*args, **named)
            finally:
                inside[0] = False
                spent[part] += time.thread_time() - started

        return run

    for (module, name, part), (_, _, function) in zip(_WRAPPED, before, strict=True):
        setattr(module, name, clocked(function, part))
    try:
        yield
    finally:
        for module, name, function in before:
            setattr(module, name, function)
