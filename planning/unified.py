"""unified-planning's problems as ours, and ours as theirs, for all that else is written for that library.

Both ways lead through PDDL text: the reader and writer of each side are held to the standard by their own tests.
The import of unified-planning takes a second, so nothing imports this module before somebody asks for it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from unified_planning.exceptions import UPException
from unified_planning.io import PDDLReader, PDDLWriter
from unified_planning.model import Problem as UpProblem

from knowledge_base.errors import InputError
from knowledge_base.pddl import Metric, ProblemText, read_problem
from planning.domain import PlanningDomain
from planning.problem.costs import TOTAL_COST

if TYPE_CHECKING:
    from knowledge_base import View
    from knowledge_base.language.expression import Expression


def from_unified(problem: UpProblem) -> tuple[PlanningDomain, ProblemText]:
    """A problem of unified-planning as a domain, and its first state and goal.

    Names are those that its PDDL writer gives: in lower case, and others where PDDL has a word already.

    Raises:
        InputError: it has something that PDDL cannot say.
        UnsupportedConstructError: or something that nothing here can plan with.
    """
    if not isinstance(problem, UpProblem):
        raise InputError(f"a problem of unified-planning that PDDL can say is a Problem, not {type(problem).__name__}")
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
    """What is known and wanted as a problem of unified-planning, with types, things and actions as they are.

    Args:
        domain: what may be done.
        world: what is known; it says what `domain` lets one say.
        goal: what is wanted.
        metric: what the best plan is; by default the least `(total-cost)`, if the domain declares it.

    Raises:
        InputError: the goal is none, or unified-planning cannot read something of it, such as derived or computed
            predicates and functions that are no numbers.
    """
    declared = domain.schema.functions.get(TOTAL_COST.function)
    if metric is None and declared is not None and not declared.arity:
        metric = Metric("minimize", TOTAL_COST)
    others = [f.name for f in domain.schema.functions.values() if f.result != "number"]
    derived = [axiom.predicate for axiom in domain.axioms]
    for what, names in (("function that is no number", others), ("derived predicate", derived)):
        if names:
            raise InputError(f"unified-planning's reader knows no {what}, as '{names[0]}' is", found=names[0])
    texts = domain.to_pddl(), world.to_pddl(domain.name, goal=goal, metric=metric)
    try:
        return PDDLReader().parse_problem_string(*texts)
    except (UPException, NotImplementedError, AssertionError, SyntaxError) as error:
        said = str(error) or type(error).__name__
        raise InputError(f"unified-planning cannot read the problem: {said}") from error
