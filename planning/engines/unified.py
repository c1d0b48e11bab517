"""Conversion between the problems of unified-planning and the problems of this project.

Both conversions use PDDL text, so that the readers and writers of both projects check each other. The import of
unified-planning takes a second, so other modules import this module only when they need a conversion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from unified_planning.exceptions import UPException
from unified_planning.io import PDDLReader, PDDLWriter
from unified_planning.model import Problem as UpProblem

from knowledge_base.errors import InputError
from knowledge_base.pddl import Metric, ProblemText, read_problem
from planning.model.domain import PlanningDomain
from planning.problem.operators import TOTAL_COST

if TYPE_CHECKING:
    from knowledge_base import View
    from knowledge_base.language.syntax.expression import Expression


def from_unified(problem: UpProblem) -> tuple[PlanningDomain, ProblemText]:
    """Return a domain, and a problem text with initial state and goal, for a problem of unified-planning.

    Names are in lower case, and differ from the original names where PDDL reserves a word.

    Raises:
        InputError: PDDL cannot express a part of the problem.
        UnsupportedConstructError: no engine of this project supports a part of the problem.
    """
    if not isinstance(problem, UpProblem):
        raise InputError(f"from_unified takes a Problem of unified-planning, not {type(problem).__name__}")
    name = problem.name or "problem"
    try:
        writer = PDDLWriter(problem)
        texts = writer.get_domain(), writer.get_problem()
    except (UPException, NotImplementedError, AssertionError) as error:
        said = str(error) or type(error).__name__
        raise InputError(f"the problem '{name}' cannot be written as PDDL: {said}") from error
    domain = PlanningDomain.parse(texts[0], f"{name} (domain)")
    return domain, read_problem(texts[1], domain.schema, f"{name} (problem)", domain.name)


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
