"""Driver of Kairos: a ground problem as PDDL with numbers or durations, planned in this process."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import kairos

from knowledge_base.facts import Fact
from planning.engines.registry import Engine
from planning.engines.request import read
from planning.engines.worker import Answers, Request, Search
from planning.model.ground_action import ActionSpan, GroundAction
from planning.model.problem import Problem
from planning.model.quantities import Assignment, NumericBound, Quantity, fluents

_ONE_RESULT = {"anytime": False, "threads": 1, "seed": 0, "timeout": 1e6}
"""Options for the first plan; one thread and a fixed seed make the plans of equal problems equal.

The caller ends a search that takes too long; without `timeout`, Kairos ends after 30 s.
"""


def searching(engine: Engine) -> Search:  # noqa: ARG001  Kairos has one configuration
    """Return the search function for `planning.engines.worker`."""

    def search(request: Request) -> Answers:
        return _answers(read(request))

    return search


def _answers(problem: Problem) -> Answers:
    text = _Text(problem)
    domain = kairos.parse_domain(text.domain())
    result = kairos.Planner().solve(kairos.parse_problem(text.problem(), domain), **_ONE_RESULT)
    if result.plan is not None and result.status == kairos.Status.SOLVED:
        yield _answer(result.plan.steps, timed="durations" in problem.features)
    elif result.status == kairos.Status.UNSOLVABLE:
        yield None
    else:
        why = " ".join(str(one.message) for one in result.diagnostics)
        if result.status == kairos.Status.OUT_OF_MEMORY or "bad_alloc" in why:  # the limit of the worker is the first
            raise MemoryError
        raise RuntimeError(f"it ended with status {result.status.name} {' '.join(why.split())[-200:]}".rstrip())


def _answer(steps: Iterable[Any], *, timed: bool) -> Any:
    """Return a plan as the worker answers it: the numbers of the actions, with durations also their times."""
    if timed:
        return {"timed": [[_number(step), float(step.time), float(step.duration or 0.0)] for step in steps]}
    return [_number(step) for step in steps]


def _number(step: Any) -> int:
    """Return the index of the action with the name `ai`."""
    return int(str(step.name)[1:])


class _Text:
    """PDDL of a ground problem: facts `f0`, numbers `n0` and actions `a0` without parameters."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        facts = [*problem.init, *problem.goal, *(fact for action in problem.actions for fact in action.facts())]
        self._facts = {fact: f"(f{number})" for number, fact in enumerate(dict.fromkeys(facts))}
        self._numbers = {fluent: f"(n{number})" for number, fluent in enumerate(dict.fromkeys(_fluents(problem)))}

    def domain(self) -> str:
        """Return the domain."""
        actions = [self._action(f"a{number}", action) for number, action in enumerate(self._problem.actions)]
        predicates, functions = " ".join(self._facts.values()), " ".join(self._numbers.values())
        numbers = f"(:functions {functions})" if functions else ""
        wanted = "(:requirements :strips :numeric-fluents :durative-actions :duration-inequalities)"
        return "\n".join([f"(define (domain d) {wanted}", f"(:predicates {predicates})", numbers, *actions, ")"])

    def problem(self) -> str:
        """Return the problem."""
        values = (f"(= {name} {_figure(self._problem.numbers.get(one, 0.0))})" for one, name in self._numbers.items())
        init = " ".join([*map(self._facts.__getitem__, self._problem.init), *values])
        goal = " ".join([*map(self._facts.__getitem__, self._problem.goal), *map(self._bound, self._problem.bounds)])
        return f"(define (problem p) (:domain d) (:init {init}) (:goal (and {goal})))"

    def _action(self, name: str, action: GroundAction) -> str:
        if action.span is not None:
            return self._durative(name, action, action.span)
        needs = " ".join([*map(self._facts.__getitem__, action.precondition), *map(self._bound, action.bounds)])
        effects = [*self._changes(action.adds, action.deletes), *map(self._assignment, action.assignments)]
        return f"(:action {name} :parameters () :precondition (and {needs}) :effect (and {' '.join(effects)}))"

    def _durative(self, name: str, action: GroundAction, span: ActionSpan) -> str:
        length = f"(and (>= ?duration {_figure(span.least)}) (<= ?duration {_figure(span.most)}))"
        conditions = (
            ("at start", action.precondition, action.bounds),
            ("over all", span.over_all, span.lasting_bounds),
            ("at end", span.end, span.end_bounds),
        )
        changes = (
            ("at start", action.adds, action.deletes, action.assignments),
            ("at end", span.adds, span.deletes, span.assignments),
        )
        needs = [
            f"({when} {condition})"
            for when, facts, bounds in conditions
            for condition in (*map(self._facts.__getitem__, facts), *map(self._bound, bounds))
        ]
        effects = [
            f"({when} {change})"
            for when, adds, deletes, assignments in changes
            for change in (*self._changes(adds, deletes), *map(self._assignment, assignments))
        ]
        what = f":condition (and {' '.join(needs)}) :effect (and {' '.join(effects)})"
        return f"(:durative-action {name} :parameters () :duration {length} {what})"

    def _changes(self, adds: Iterable[Fact], deletes: Iterable[Fact]) -> Iterator[str]:
        yield from (self._facts[fact] for fact in adds)
        yield from (f"(not {self._facts[fact]})" for fact in deletes)

    def _assignment(self, one: Assignment) -> str:
        operator = "increase" if one.increase else "assign"
        return f"({operator} {self._numbers[one.fluent]} {self._quantity(one.amount)})"

    def _bound(self, bound: NumericBound) -> str:
        return f"({bound.operator} {self._quantity(bound.left)} {self._quantity(bound.right)})"

    def _quantity(self, quantity: Quantity) -> str:
        if isinstance(quantity, Fact):
            return self._numbers[quantity]
        if isinstance(quantity, int | float):
            return _figure(quantity)
        return f"({quantity.operator} {' '.join(map(self._quantity, quantity.args))})"


def _fluents(problem: Problem) -> Iterator[Fact]:
    """Yield the numeric fluents of a problem, some repeatedly."""
    yield from problem.numbers
    spans = [action.span for action in problem.actions if action.span is not None]
    bounds = [bound for span in spans for bound in (*span.lasting_bounds, *span.end_bounds)]
    for bound in (*problem.bounds, *(bound for action in problem.actions for bound in action.bounds), *bounds):
        yield from bound.fluents()
    parts: list[GroundAction | ActionSpan] = [*problem.actions, *spans]
    for one in (change for part in parts for change in part.assignments):
        yield one.fluent
        yield from fluents(one.amount)


def _figure(number: float) -> str:
    """Return a number without an exponent, which PDDL does not have."""
    text = f"{number:.12f}".rstrip("0").rstrip(".")
    return text if text not in {"", "-0"} else "0"
