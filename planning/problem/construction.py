"""Posing a problem: the slice of the world and of the domain that matters for a goal, ready for an engine.

The steps of it: choose the relevant actions; ground them along what is reachable, evaluating what cannot
change; turn a disjunctive goal into bookkeeping actions after the last real one; leave out what cannot matter;
leave out objects that others can stand in for; make negative conditions positive.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from knowledge_base.facts import Fact
from knowledge_base.language.check import check
from knowledge_base.language.evaluation import holds
from knowledge_base.language.expression import Expression, Term
from knowledge_base.language.identity_cache import IdentityCache
from knowledge_base.language.printer import to_text
from planning.cancellable_work import WorkLimit
from planning.problem.conditions import Every, Grounder, Leaf, Literal, Residual, Some
from planning.problem.constructs import refuse_unforeseeable
from planning.problem.costs import ignored, metric_of
from planning.problem.derived import derivation
from planning.problem.grounding import Variant
from planning.problem.numbering import Assembly
from planning.problem.operators import OperatorCache, OperatorIndex, numbered, things_of
from planning.problem.reduction import Task, pruned
from planning.problem.relaxed_reachability import reachable
from planning.problem.relevance import Relevant, names_of, relevant
from planning.problem.symmetry import spared
from planning.problem.temporal import build_temporal_problem, durative
from planning.quantities import NumericBound
from planning.strips import Problem
from planning.unsupported import UnsupportedActionError, UnsupportedGoalError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from knowledge_base.language.evaluation import World
    from knowledge_base.pddl.problem_text import Metric
    from planning.domain import PlanningDomain
    from planning.problem.numbering import Numbering

# Names with blanks, which no declared name can clash with.
_ACTING, _FINISHED = Literal(Fact("still acting")), Literal(Fact("finished acting"))
_ONE_OF = "one of"
_MOST_KEPT = 8  # goals of different kinds, each with its ground actions


def build_problem(
    domain: PlanningDomain,
    world: World,
    goal: Expression,
    metric: Metric | None = None,
    *,
    durations: bool = False,
    patience: WorkLimit | None = None,
) -> Problem:
    """The problem of reaching `goal` from `world`, which stays as it is.

    What the next problem of the same domain needs again is kept; see `ProblemBuilder`.

    Args:
        domain: the planning actions.
        world: the present.
        goal: what shall hold.
        metric: what makes a plan better than another; to minimize `(total-cost)` if the domain declares that.
        durations: whether there is somebody to ask who plans with durations: `timed` of the problem is for him.
        patience: for how long; for ever if left out.

    Raises:
        InputError: the goal has a free variable, or names something that is not declared or not known.
        UnsupportedGoalError: the goal states a fact about a number that actions change, or asks for a derived
            predicate that cannot be planned with, or for what no engine can foresee (`unforeseeable`).
        UnsupportedActionError: so does an action that matters, or it has too many alternatives.
        OutOfPatienceError: it takes too long, as it may where many objects can be chosen for many parameters.
    """
    builder = _builders.find(domain, None) or _builders.keep(domain, None, ProblemBuilder(domain))
    return builder.build_problem(world, goal, metric, durations=durations, patience=patience)


def check_goal(goal: Expression, world: World) -> None:
    """Raise an `InputError` unless the goal says something about the things of this world."""
    check(goal, world.schema, objects=things_of(world))


@dataclass(frozen=True, slots=True)
class GroundedProblem:
    """A problem before anything that cannot contribute is left out.

    Attributes:
        relevant: what of the domain matters.
        wanted: what is left of the goal; `False` if it can never hold.
        task: the ground problem; `None` if the goal can never hold.
        assembly: makes a `Problem` of the task.
    """

    relevant: Relevant
    wanted: Residual
    task: Task | None = None
    assembly: Assembly | None = None


class ProblemBuilder:
    """Poses one problem after the other for a domain, and keeps what the next one needs again.

    The problem is the same as that of a new builder, only sooner. May be used by several threads.
    """

    def __init__(self, domain: PlanningDomain) -> None:
        self._derivation = derivation(domain)
        self._domain = self._derivation.domain
        self._kept: dict[tuple[tuple[str, ...], frozenset[str], Term | None], tuple[OperatorCache, Assembly]] = {}
        self._matters: dict[tuple[frozenset[str], Term | None], Relevant] = {}
        self._lock = threading.Lock()

    def build_problem(
        self,
        world: World,
        goal: Expression,
        metric: Metric | None = None,
        *,
        durations: bool = False,
        patience: WorkLimit | None = None,
    ) -> Problem:
        """See `planning.problem.construction.pose`."""
        check_goal(goal, world)
        world, wanted = self._derivation.world(world), self._derivation.expand(goal)
        if holds(wanted, world):
            return self._nothing()
        patience = patience or WorkLimit()
        problem = self._one_at_a_time(world, goal, metric, patience)
        if not durative(self._domain, wanted):
            return problem
        timed = (
            build_temporal_problem(self._domain, world, wanted, patience) if durations or problem.unreachable else None
        )
        if timed is not None and timed.unreachable:
            return timed
        return replace(problem, one_at_a_time=True, timed=timed if durations else None)

    def _one_at_a_time(self, world: World, goal: Expression, metric: Metric | None, patience: WorkLimit) -> Problem:
        """The problem with durative actions as ordinary ones."""
        amount = metric_of(metric, world.schema)
        with self._lock:
            grounded = self.grounded(world, goal, amount, patience)
            if grounded.task is None or grounded.assembly is None:
                return self._nothing(to_text(goal))
            reach, numbering = reachable(grounded.task), grounded.task.numbering
            missing = [said(numbering, one, goal) for one in grounded.task.goal if one not in reach.facts]
            if missing:
                return self._nothing(*dict.fromkeys(missing))
            task, notes = _priced(pruned(grounded.task, reach.taken), amount)
            return self._sliced(task, grounded.assembly, world, notes)

    def grounded(
        self, world: World, goal: Expression, metric: Term | None = None, patience: WorkLimit | None = None
    ) -> GroundedProblem:
        """The problem of reaching a checked goal, with everything evaluated that cannot change.

        Args:
            world: the present, with derived facts.
            goal: what shall hold.
            metric: what plans shall have little of.
            patience: for how long.

        Raises:
            UnsupportedGoalError, UnsupportedActionError, OutOfPatienceError: as for `pose`.
        """
        goal = self._derivation.expand(goal)
        matters = self._relevant(goal, metric)
        self._derivation.require_supported(goal, matters.actions)
        refuse_unforeseeable(goal, matters.actions, self._domain)
        patience = patience or WorkLimit()
        patience.doing = "grounding the goal"
        grounder = Grounder(world, matters.changing, keep_false=True, patience=patience)
        try:
            wanted = grounder.residual(goal, {})
        except UnsupportedActionError as error:
            raise UnsupportedGoalError(error.message, place=error.place) from None
        if wanted is False:
            return GroundedProblem(matters, wanted)
        groundwork, assembly = self._prepared(matters, metric, world, patience)
        numbering = groundwork.numbering
        ways, goal_numbers = _with_conjunctive_goal(groundwork.ways, wanted, numbering)
        init = (numbering.present(world) - {numbering.of(_ACTING.negated)}) | {numbering.of(_ACTING)}
        task = Task(numbering, init, goal_numbers, ways)
        return GroundedProblem(matters, wanted, task, assembly)

    def _relevant(self, goal: Expression, metric: Term | None) -> Relevant:
        """What matters for the goal; the same for all that ask about the same predicates and functions."""
        key = frozenset(names_of(goal)), metric
        if key not in self._matters:
            if len(self._matters) >= _MOST_KEPT:
                self._matters.clear()
            self._matters[key] = relevant(goal, metric, self._domain.actions.values())
        return self._matters[key]

    def _prepared(
        self, matters: Relevant, metric: Term | None, world: World, patience: WorkLimit
    ) -> tuple[OperatorCache, Assembly]:
        """The ground actions that may matter, those of an earlier problem if they serve."""
        key = (tuple(action.name for action in matters.actions), matters.changing, metric)
        known = self._kept.pop(key, None)  # taken out, so that an error on the way leaves nothing half done
        if known is None or not known[0].serves(world):
            groundwork = OperatorCache(matters, metric, world)
            known = groundwork, Assembly(groundwork.numbering)
        known[0].extend(world, patience)
        while len(self._kept) >= _MOST_KEPT:
            del self._kept[next(iter(self._kept))]
        self._kept[key] = known
        return known

    def _sliced(self, task: Task, assembly: Assembly, world: World, notes: tuple[str, ...]) -> Problem:
        """Without the objects that others can stand in for; what they need to reach the goal is there all the same."""
        left, gone, things = task.left or {}, spared(task), things_of(world)

        def problem(task: Task, world: World | None) -> Problem:
            return assembly.problem(self._domain.name, task, things, world, notes)

        def whole() -> Problem:
            with self._lock:
                return problem(task, None)

        if not gone:
            return problem(task, world)
        slice_ = pruned(task, _only(left.keys() - set(gone), len(task.ways.all)))
        if notes:
            slice_ = _evenly_priced(slice_)
        if task.numbering.fluents:  # they have the values of now
            now = problem(task, world)
            return replace(problem(slice_, world), unsliced=lambda: now)
        return replace(problem(slice_, None), unsliced=whole)

    def _nothing(self, *unreachable: str) -> Problem:
        """A problem that needs no engine: the goal holds, or cannot be reached."""
        return Problem(self._domain.name, {}, (), (), (), unreachable)


def _priced(task: Task, metric: Term | None) -> tuple[Task, tuple[str, ...]]:
    """The task with costs; all the same, and a note why, if the metric is no cost of actions."""
    if metric is None or all(way.cost is not None for way in (task.left or {}).values()):
        return task, ()
    return _evenly_priced(task), (ignored(metric),)


def _only(positions: Iterable[int], of: int) -> bytearray:
    only = bytearray(of)
    for i in positions:
        only[i] = 1
    return only


def _evenly_priced(task: Task) -> Task:
    left = (task.left or {}).items()
    return replace(task, left={i: way._replace(cost=None if way.step is None else 1.0) for i, way in left})


def _with_conjunctive_goal(
    ways: OperatorIndex, goal: Residual, numbering: Numbering
) -> tuple[OperatorIndex, tuple[int, ...]]:
    """The goal as literals and bounds; a disjunction in it becomes a fact that bookkeeping actions can add.

    They can be taken only after the last real action: a disjunct that held once might be undone later.
    """
    bookkeeping: list[Variant] = []
    wanted = tuple(map(numbering.of, _conjunction(goal, bookkeeping)))
    if not bookkeeping:
        return ways, wanted
    finish = Variant(None, (_ACTING,), (_ACTING.negated, _FINISHED))
    closing = [Variant(None, (*way.condition, _FINISHED), way.effects) for way in bookkeeping]
    acting = numbering.of(_ACTING)
    real = [way._replace(needs=(*way.needs, acting)) for way in ways.all]
    return OperatorIndex([*real, *(numbered(variant, numbering, 0.0) for variant in (finish, *closing))]), wanted


def _conjunction(goal: Residual, bookkeeping: list[Variant]) -> tuple[Leaf, ...]:
    match goal:
        case Literal() | NumericBound():
            return (goal,)
        case Every(parts):
            return tuple(leaf for part in parts for leaf in _conjunction(part, bookkeeping))
        case Some(parts):
            choices = [_conjunction(part, bookkeeping) for part in parts]
            chosen = Literal(Fact(_ONE_OF, (len(bookkeeping),)))
            bookkeeping.extend(Variant(None, choice, (chosen,)) for choice in choices)
            return (chosen,)
        case _:
            return ()


_builders: IdentityCache[PlanningDomain, ProblemBuilder] = IdentityCache(size=8)


def said(numbering: Numbering, missing: int, goal: Expression) -> str:
    """A part of the goal as its reader knows it."""
    what = numbering.named(missing)
    if isinstance(what, Fact) and what.predicate == _ONE_OF:
        return to_text(goal)
    return f"(not {what})" if missing & 1 else str(what)
