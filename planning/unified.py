"""Conversion between unified-planning's problems and those of this project.

Both directions go through PDDL text: each side tests its reader and writer against the standard. The import of
unified-planning takes a second, so other modules import this one only on use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from unified_planning.exceptions import UPException
from unified_planning.io import PDDLReader, PDDLWriter
from unified_planning.model import Problem as UpProblem

from knowledge_base.errors import InputError
from knowledge_base.pddl import Metric, ProblemText, read_problem
from planning.domain import PlanningDomain
from planning.problem.operators import TOTAL_COST

if TYPE_CHECKING:
    from knowledge_base import View
    from knowledge_base.language.syntax.expression import Expression


def from_unified(problem: UpProblem) -> tuple[PlanningDomain, ProblemText]:
    """Return a problem of unified-planning as a domain, and its initial state and goal.

    Names come from its PDDL writer: in lower case, and changed where PDDL reserves a word.

    Raises:
        InputError: PDDL cannot express a part of it.
        UnsupportedConstructError: no engine here supports a part of it.
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
    """Return world, goal and domain as a problem of unified-planning, with types, objects and actions.

    Args:
        domain: the planning actions.
        world: the present; its schema extends the domain's.
        goal: the condition to reach.
        metric: the plan metric; by default the least `(total-cost)`, if the domain declares it.

    Raises:
        InputError: the goal is not a condition, or unified-planning cannot read a part, such as derived or computed
            predicates and functions that are not numeric.
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
