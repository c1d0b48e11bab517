"""LocalRepair keeps the end of a broken plan and plans only the way to that end, if it is short."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from itertools import islice

from knowledge_base.errors import InputError
from knowledge_base.language.evaluation.evaluator import holds
from knowledge_base.language.evaluation.world import World
from knowledge_base.language.syntax.expression import And, Atom, Constant, Expression
from planning.cancellable_work import WorkLimit
from planning.domain import PlanningDomain
from planning.execution.progress import PlanProgress
from planning.plan import Plan, PlanStep
from planning.problem.construction import build_problem
from planning.problem.derived import derivation
from planning.strips import Problem
from planning.validation import validate

MOST_LONGER = 2
"""The number of steps by which a repaired plan may be longer than the remaining one."""
_MOST_UNMET = 3
"""The number of unmet conditions up to which an end of a plan is tried."""
_MOST_LEFT_OUT = 2
"""The number of first steps that a repair may replace."""


@dataclass(frozen=True, slots=True)
class LocalRepair:
    """The end of a plan to be kept, and the problem of making it possible again."""

    end: tuple[PlanStep, ...]
    problem: Problem

    def repaired(
        self, first: Plan, before: Sequence[PlanStep], domain: PlanningDomain, world: World, goal: Expression
    ) -> Plan | None:
        """The plan that begins with the solution `first`, if it leads to the goal and is not much longer."""
        plan = Plan((*first.steps, *self.end))
        short = len(plan.steps) <= len(before) + MOST_LONGER
        return plan if short and validate(plan, domain, world, goal).valid else None


def local_repair(
    before: PlanProgress,
    excluded: AbstractSet[PlanStep],
    domain: PlanningDomain,
    world: World,
    goal: Expression,
    patience: WorkLimit | None = None,
) -> LocalRepair | None:
    """Return the repair of a plan that promises the least work; `None` if all need too much.

    Of the ends of the plan the one that is nearest to being possible is kept; the problem is to reach what it needs.

    Args:
        before: the plan, with its done, running and remaining steps.
        excluded: steps that the repair must omit.
        domain: has the steps' conditions and effects.
        world: the present.
        goal: the goal of the plan.
        patience: for how long.

    Raises:
        WorkLimitError: it takes too long.
    """
    derived = derivation(domain)
    closed, left = derived.world(world), before.remaining  # once: the plan may continue meanwhile
    if derived.recursive:  # its conditions belong to another state of the world
        before = before.renewed(derived.domain, derived.expand(goal))
    ends = (left[first:] for first in range(min(_MOST_LEFT_OUT + 1, len(left))))
    known = ((before.steps_of(end), before.needed_by(end)) for end in ends)
    allowed = [(end, needed) for end, needed in known if excluded.isdisjoint(end)]
    truths = _Truths(closed)
    gaps = [(end, needed, truths.unmet(needed)) for end, needed in allowed if needed is not None]
    near = [(end, needed, gap) for end, needed, gap in gaps if len(gap) <= _MOST_UNMET]
    if not near:
        return None
    end, needed, gap = min(near, key=lambda one: len(one[0]) + len(one[2]))
    if not all(map(derived.may_change, gap)):
        return None
    try:
        problem = build_problem(domain, world, And(tuple(needed)), patience=patience)
    except InputError:  # no problem has these conditions as its goal
        return None
    return None if problem.unreachable else LocalRepair(end, problem)


class _Truths:
    """Truth values of conditions, each evaluated once: the ends of a plan share most of their conditions."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._known: dict[int, bool] = {}  # by identity: conditions live as long as the plan that they are about

    def unmet(self, needed: Iterable[Expression]) -> list[Expression]:
        """The conditions that do not hold, at most one more than `_MOST_UNMET`."""
        return list(islice((one for one in needed if not self._holds(one)), _MOST_UNMET + 1))

    def _holds(self, condition: Expression) -> bool:
        found = self._known.get(id(condition))
        if found is None:
            found = self._known[id(condition)] = _true(condition, self._world)
        return found


def _true(condition: Expression, world: World) -> bool:
    if isinstance(condition, Atom) and condition.predicate in world.schema.predicates:
        args = [term.value for term in condition.args if isinstance(term, Constant)]
        if len(args) == len(condition.args) and condition.predicate not in world.schema.computed:
            return world.holds(condition.predicate, tuple(args))  # most are such, and a compiled test does not pay
    try:
        return holds(condition, world)
    except InputError:
        return False
