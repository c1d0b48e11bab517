"""Driver of unified-planning's engines: constructs their problems without PDDL text, and reads their results."""

from __future__ import annotations

import math
import subprocess
from collections.abc import Sequence
from fractions import Fraction
from importlib import import_module
from typing import Any

from unified_planning.engines import PlanGenerationResultStatus, pddl_planner
from unified_planning.engines.results import PlanGenerationResult
from unified_planning.environment import Environment
from unified_planning.model import (
    DurativeAction,
    EndTiming,
    Fluent,
    InstantaneousAction,
    OpenTimeInterval,
    StartTiming,
)
from unified_planning.model import Problem as UpProblem
from unified_planning.model.metrics import MinimizeActionCosts
from unified_planning.plans import TimeTriggeredPlan

from knowledge_base.facts import Fact
from planning.engines.registry import Engine
from planning.engines.request import read
from planning.engines.worker import Answers, Request, Search
from planning.model.ground_action import ActionSpan, GroundAction
from planning.model.problem import Problem
from planning.model.quantities import Assignment, NumericBound, Operation, Quantity


def translated(problem: Problem, *, costs: bool = False, environment: Environment | None = None) -> UpProblem:
    """Return the problem as a problem of unified-planning.

    Args:
        problem: the problem to translate; the action with index i has the name `ai`.
        costs: whether to minimise the cost; only for engines that support costs.
        environment: unified-planning's environment, which keeps all expressions; by default a new one. Fast Downward's
            binding works only in the global environment.
    """
    return _Translation(problem, Environment() if environment is None else environment, costs=costs).result


def ticks(problem: Problem) -> int:
    """Return the time units per second in the translation, because some engines support only integer durations."""
    spans = [action.span for action in problem.actions if action.span is not None]
    return math.lcm(*(_nearly(one).denominator for span in spans for one in (span.least, span.most)))


class _Translation:
    def __init__(self, problem: Problem, environment: Environment, *, costs: bool) -> None:
        self._environment = environment
        self._environment.credits_stream = None
        self._expressions = self._environment.expression_manager
        self._fluents: dict[Fact, Fluent] = {}
        self._numbers: dict[Fact, Fluent] = {}
        self._ticks = ticks(problem)
        self.result = UpProblem("problem", self._environment)
        for fluent, number in problem.numbers.items():
            self.result.set_initial_value(self._number(fluent), _exact(number))
        for one in problem.init:
            self.result.set_initial_value(self._fluent(one), value=True)
        for one in problem.goal:
            self.result.add_goal(self._fluent(one))
        for bound in problem.bounds:
            self.result.add_goal(self._bound(bound))
        actions = [self._action(f"a{number}", action) for number, action in enumerate(problem.actions)]
        self.result.add_actions(actions)
        if costs:
            prices = map(self._expressions.Int, _whole([action.cost for action in problem.actions]))
            priced = dict(zip(actions, prices, strict=True))
            self.result.add_quality_metric(MinimizeActionCosts(priced, environment=self._environment))

    def _fluent(self, one: Fact) -> Fluent:
        if one not in self._fluents:
            self._fluents[one] = Fluent(f"f{len(self._fluents)}", environment=self._environment)
            self.result.add_fluent(self._fluents[one], default_initial_value=False)
        return self._fluents[one]

    def _number(self, one: Fact) -> Fluent:
        if one not in self._numbers:
            real = self._environment.type_manager.RealType()
            self._numbers[one] = Fluent(f"n{len(self._numbers)}", real, environment=self._environment)
            self.result.add_fluent(self._numbers[one], default_initial_value=0)
        return self._numbers[one]

    def _action(self, name: str, action: GroundAction) -> InstantaneousAction | DurativeAction:
        return self._ordinary(name, action) if action.span is None else self._durative(name, action, action.span)

    def _durative(self, name: str, action: GroundAction, span: ActionSpan) -> DurativeAction:
        translation = DurativeAction(name, _env=self._environment)
        least, most = (int(_nearly(one) * self._ticks) for one in (span.least, span.most))
        translation.set_closed_duration_interval(least, most)
        start, end = StartTiming(), EndTiming()
        needed = {start: action.precondition, OpenTimeInterval(start, end): span.over_all, end: span.end}
        for when, facts in needed.items():
            for one in facts:
                translation.add_condition(when, self._fluent(one))
        changed = ((start, action.deletes, action.adds), (end, span.deletes, span.adds))
        for at, deletes, adds in changed:
            for one in deletes:
                translation.add_effect(at, self._fluent(one), value=False)
            for one in adds:
                translation.add_effect(at, self._fluent(one), value=True)
        return translation

    def _ordinary(self, name: str, action: GroundAction) -> InstantaneousAction:
        translation = InstantaneousAction(name, _env=self._environment)
        for one in action.precondition:
            translation.add_precondition(self._fluent(one))
        for bound in action.bounds:
            translation.add_precondition(self._bound(bound))
        for one in action.adds:
            translation.add_effect(self._fluent(one), value=True)
        for one in action.deletes:
            translation.add_effect(self._fluent(one), value=False)
        for assignment in action.assignments:
            self._add_assignment(translation, assignment)
        return translation

    def _add_assignment(self, translation: InstantaneousAction, assignment: Assignment) -> None:
        fluent, amount = self._number(assignment.fluent), self._quantity(assignment.amount)
        if assignment.increase:
            translation.add_increase_effect(fluent, amount)
        else:
            translation.add_effect(fluent, amount)

    def _bound(self, bound: NumericBound) -> Any:
        left, right = self._quantity(bound.left), self._quantity(bound.right)
        comparisons = {
            "=": self._expressions.Equals,
            "<": self._expressions.LT,
            "<=": self._expressions.LE,
            ">": self._expressions.GT,
            ">=": self._expressions.GE,
        }
        return comparisons[bound.operator](left, right)

    def _quantity(self, quantity: Quantity) -> Any:
        make = self._expressions
        match quantity:
            case Fact():
                return make.FluentExp(self._number(quantity))
            case Operation("-", (one,)):
                return make.Minus(0, self._quantity(one))
            case Operation("+", args):
                return make.Plus(*map(self._quantity, args))
            case Operation("*", args):
                return make.Times(*map(self._quantity, args))
            case Operation(name, args):
                combine = make.Minus if name == "-" else make.Div
                result = self._quantity(args[0])
                for arg in args[1:]:
                    result = combine(result, self._quantity(arg))
                return result
            case _:
                return make.Real(_exact(quantity))


def _exact(number: float) -> Fraction:
    """Return the number as its decimal text has it, e.g. 1/10 for 0.1, which the float only approximates."""
    return Fraction(repr(number))


def _nearly(number: float) -> Fraction:
    """Return the closest fraction with a denominator of at most 1000."""
    return _exact(number).limit_denominator(1000)


def _whole(costs: Sequence[float]) -> list[int]:
    """Return integers in the same proportions, rounded to thousandths, since some engines support no fractions."""
    exact = [_nearly(cost) for cost in costs]
    common = math.lcm(*(cost.denominator for cost in exact))
    return [int(cost * common) for cost in exact]


_NO_MEMORY = ("OutOfMemoryError", "insufficient memory")
"""Java's messages about exhausted memory."""


def searching(engine: Engine) -> Search:
    """Return the search function of the engine with the class `module:name`, for `planning.engines.worker`.

    Raises:
        ImportError: the engine is not installed.
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
    """Return the indices of the plan's actions, or `None` if the engine proved that the problem has no plan.

    Raises:
        MemoryError: the engine reports exhausted memory.
        RuntimeError: the engine ended without a plan, a proof or a report of exhausted memory.
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
    """Return index, start and duration of each action; the times of the plan are in ticks, the result is in seconds."""
    return [
        (int(action.action.name[1:]), float(start / ticks), float((duration or 0) / ticks))
        for start, action, duration in plan.timed_actions
    ]


def _start(timed: Any) -> Any:
    return timed[0]


def _run_in_our_group(
    engine: Any,  # noqa: ARG001
    cmd: list[str],
    output_stream: object = None,  # noqa: ARG001
    timeout: float | None = None,  # noqa: ARG001
) -> tuple[bool, tuple[list[str], list[str]], int]:
    """Replace unified-planning's `run_command`, which starts the program in a separate session.

    In a separate session the program would continue after the end of its search.
    """
    done = subprocess.run(cmd, capture_output=True, stdin=subprocess.DEVNULL, text=True, check=False)  # noqa: S603
    return False, ([done.stdout], [done.stderr]), done.returncode


pddl_planner.run_command = _run_in_our_group
