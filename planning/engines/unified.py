"""Conversion between the problems of unified-planning and the problems of this project.

Both conversions use PDDL text, so that the readers and writers of both projects check each other. The import of
unified-planning takes a second, so other modules import this module only when they need a conversion.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

from unified_planning.exceptions import UPException
from unified_planning.io import PDDLReader, PDDLWriter
from unified_planning.model import Problem as UpProblem
from unified_planning.plans import ActionInstance, PlanKind, SequentialPlan, TimeTriggeredPlan
from unified_planning.plans import Plan as UpPlan

from knowledge_base.errors import InputError
from knowledge_base.pddl import Metric, ProblemText, read_problem
from planning.model.domain import PlanningDomain
from planning.model.plan import Plan, PlanStep, Timing
from planning.problem.operators import TOTAL_COST

if TYPE_CHECKING:
    from knowledge_base import View
    from knowledge_base.language.syntax.expression import Expression


def from_unified(problem: UpProblem) -> tuple[PlanningDomain, ProblemText]:
    """Return a domain, and a problem text with initial state and goal, for a problem of unified-planning.

    Names are in lower case, and differ from the original names where PDDL reserves a word. `plan_to_unified` returns
    plans with the original names.

    Raises:
        InputError: PDDL cannot express a part of the problem.
        UnsupportedConstructError: no engine of this project supports a part of the problem.
    """
    name, (_, *texts) = problem.name or "problem", _write(problem)
    domain = PlanningDomain.parse(texts[0], f"{name} (domain)")
    return domain, read_problem(texts[1], domain.schema, f"{name} (problem)", domain.name)


def plan_to_unified(plan: Plan, problem: UpProblem) -> UpPlan:
    """Return a plan for the problem that `from_unified` has converted, as a plan of unified-planning.

    Raises:
        InputError: a step names no action or object of the problem, or PDDL cannot express a part of the problem.
    """
    writer, *_ = _write(problem)
    steps = [_instance(step, problem, writer) for step in plan.steps]
    if not plan.schedule:
        return SequentialPlan(steps, problem.environment)
    times = [(Fraction(one.start), Fraction(one.duration) if one.duration else None) for one in plan.schedule]
    return TimeTriggeredPlan(
        [(start, step, length) for (start, length), step in zip(times, steps, strict=True)], problem.environment
    )


def plan_from_unified(plan: UpPlan, problem: UpProblem) -> Plan:
    """Return a plan of unified-planning for a problem, with the names that `from_unified` gives them.

    A partially ordered plan becomes a sequence.

    Raises:
        InputError: the plan has another form, or PDDL cannot express a part of the problem.
    """
    writer, *_ = _write(problem)
    if isinstance(plan, TimeTriggeredPlan):
        timed = sorted(plan.timed_actions, key=lambda one: one[0])
        schedule = [Timing(float(start), float(length or 0)) for start, _, length in timed]
        return Plan(tuple([_step(one, writer) for _, one, _ in timed]), tuple(schedule))
    try:
        sequence = plan.convert_to(PlanKind.SEQUENTIAL_PLAN, problem)
    except UPException as error:
        raise InputError(f"a {type(plan).__name__} cannot become a sequence: {error}") from error
    return Plan(tuple([_step(one, writer) for one in sequence.actions]))


def _write(problem: UpProblem) -> tuple[PDDLWriter, str, str]:
    """Return a writer, which maps names, with the text of domain and problem."""
    if not isinstance(problem, UpProblem):
        raise InputError(f"a conversion takes a Problem of unified-planning, not {type(problem).__name__}")
    writer = PDDLWriter(problem)
    try:
        return writer, writer.get_domain(), writer.get_problem()
    except (UPException, NotImplementedError, AssertionError) as error:
        said = str(error) or type(error).__name__
        raise InputError(f"the problem '{problem.name or 'problem'}' cannot be written as PDDL: {said}") from error


def _step(instance: ActionInstance, writer: PDDLWriter) -> PlanStep:
    args = [writer.get_pddl_name(one.object()) for one in instance.actual_parameters]
    return PlanStep(writer.get_pddl_name(instance.action), tuple(args))


def _instance(step: PlanStep, problem: UpProblem, writer: PDDLWriter) -> ActionInstance:
    try:
        action, *args = (writer.get_item_named(name) for name in (step.action, *step.args))
        return ActionInstance(action, [problem.environment.expression_manager.ObjectExp(one) for one in args])
    except (UPException, AssertionError, AttributeError) as error:
        raise InputError(f"{step} is not a step of the problem: {error}", found=str(step)) from error


def to_unified(domain: PlanningDomain, world: View, goal: str | Expression, metric: Metric | None = None) -> UpProblem:
    """Return domain, world and goal as a problem of unified-planning, with types, objects and actions.

    Args:
        domain: the planning domain.
        world: the initial state; its schema must extend the domain's schema.
        goal: the condition that must hold at the end.
        metric: the plan metric; by default the least `(total-cost)` if the domain declares that function.

    Raises:
        InputError: the goal is not a condition, or unified-planning does not support a part of the problem. Examples
            are derived predicates, computed predicates and non-numeric functions.
    """
    declared = domain.schema.functions.get(TOTAL_COST.function)
    if metric is None and declared is not None and not declared.arity:
        metric = Metric("minimize", TOTAL_COST)
    others = [f.name for f in domain.schema.functions.values() if f.result != "number"]
    derived = [axiom.predicate for axiom in domain.axioms]
    for what, names in (("a non-numeric function", others), ("a derived predicate", derived)):
        if names:
            raise InputError(f"unified-planning's reader does not support {what}, such as '{names[0]}'", found=names[0])
    texts = domain.to_pddl(), world.to_pddl(domain.name, goal=goal, metric=metric)
    try:
        return PDDLReader().parse_problem_string(*texts)
    except (UPException, NotImplementedError, AssertionError, SyntaxError) as error:
        said = str(error) or type(error).__name__
        raise InputError(f"unified-planning cannot read the problem: {said}") from error
