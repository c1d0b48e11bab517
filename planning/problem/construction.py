"""Problem construction: the part of a world and a domain that matters for a goal, as a ground problem.

Construction consists of these steps, in this order:

- Select the relevant actions.
- Ground these actions by relaxed reachability, and evaluate all conditions that cannot change.
- Compile a disjunctive goal into bookkeeping actions after the last real action, unless only one part is reachable.
- Prune facts and actions that cannot contribute.
- Remove objects that other objects can replace.
- Replace negative conditions by positive ones.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from knowledge_base.facts import Fact
from knowledge_base.language.checking.check import check
from knowledge_base.language.evaluation.evaluator import holds
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.expression import Expression, Term
from knowledge_base.language.syntax.rewriting import names_of
from knowledge_base.language.syntax.text import to_text
from knowledge_base.owner_cache import cache_on_owner
from knowledge_base.pddl.problem_text import Metric
from planning.model.cancellable_work import WorkLimit
from planning.model.domain import PlanningDomain
from planning.model.problem import Problem, UnsupportedActionError, UnsupportedGoalError
from planning.model.quantities import NumericBound
from planning.problem.conditions import Every, Grounder, Leaf, Literal, Residual, Some
from planning.problem.derived import derivation
from planning.problem.operators import OperatorCache, ignored, metric_of, things_of
from planning.problem.reduction import find_redundant, prune
from planning.problem.relaxed_reachability import reachable
from planning.problem.relevance import Relevant, refuse_unsupported, relevant
from planning.problem.task import Assembly, Numbering, OperatorIndex, Task, ground_operator
from planning.problem.temporal import build_temporal_problem, durative

# Names with blanks differ from every declared name.
_ACTING, _FINISHED = Literal(Fact("still acting")), Literal(Fact("finished acting"))
_ONE_OF = "one of"
_MOST_KEPT = 8  # sets of ground actions, one for each kind of goal


def build_problem(
    domain: PlanningDomain,
    world: World,
    goal: Expression,
    metric: Metric | None = None,
    *,
    durations: bool = False,
    patience: WorkLimit | None = None,
) -> Problem:
    """Return the problem of reaching `goal` from `world`; `world` stays unchanged.

    The domain keeps its `ProblemBuilder`, which keeps ground actions for later problems.

    Args:
        domain: the planning domain.
        world: the present world.
        goal: the condition to reach.
        metric: the plan metric; by default the least `(total-cost)` if the domain declares that function.
        durations: whether to construct `timed` too, for an engine that supports durations.
        patience: the limit of the work; unlimited if omitted.

    Raises:
        InputError: the goal has a free variable, or contains an undeclared or unknown name.
        UnsupportedGoalError: the goal contains a fact about a number that actions change, an unsupported derived
            predicate, or a condition that no engine can foresee (`unforeseeable`).
        UnsupportedActionError: a relevant action contains such a condition, or has too many alternatives.
        WorkLimitError: the limit has passed, e.g. with many objects and many parameters.
    """
    return _builder(domain).build_problem(world, goal, metric, durations=durations, patience=patience)


def check_goal(goal: Expression, world: World) -> None:
    """Raise `InputError` if the goal does not fit the schema or contains a missing object."""
    check(goal, world.schema, objects=things_of(world), live=False)


@dataclass(frozen=True, slots=True)
class GroundedProblem:
    """A ground problem before pruning.

    Attributes:
        relevant: the relevant actions, predicates and functions.
        things: the type of each object, by the object's name.
        wanted: the residual of the goal; `False` if the goal can never hold.
        task: the ground problem in numbers; `None` if the goal can never hold.
        assembly: constructs a `Problem` from the task.
    """

    relevant: Relevant
    things: Mapping[str, str]
    wanted: Residual
    task: Task | None = None
    assembly: Assembly | None = None


class ProblemBuilder:
    """Builder of the problems of one domain, which keeps ground actions for the next problem.

    A new builder returns equal problems but takes longer. Several threads may use one builder.
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
        """Return the problem; see `planning.problem.construction.build_problem`."""
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
        """Return the problem in which durative actions are instantaneous."""
        amount = metric_of(metric, world.schema)
        with self._lock:
            grounded = self.grounded(world, goal, amount, patience)
            if grounded.task is None or grounded.assembly is None:
                return self._nothing(to_text(goal))
            reach, numbering = reachable(grounded.task), grounded.task.numbering
            missing = [said(numbering, one, goal) for one in grounded.task.goal if one not in reach.facts]
            if missing:
                return self._nothing(*dict.fromkeys(missing))
            decided = _without_decided_choices(grounded.task, reach.taken)
            task, notes = _set_costs(prune(decided, reach.taken), amount)
            return self._slice(task, grounded.assembly, world, grounded.things, notes)

    def grounded(
        self, world: World, goal: Expression, metric: Term | None = None, patience: WorkLimit | None = None
    ) -> GroundedProblem:
        """Return the ground problem of a checked goal after partial evaluation.

        Args:
            world: the present world, with derived facts.
            goal: the condition to reach.
            metric: the term to minimize; `None` without a metric.
            patience: the limit of the work.

        Raises:
            UnsupportedGoalError, UnsupportedActionError, WorkLimitError: as for `build_problem`.
        """
        goal = self._derivation.expand(goal)
        matters = self._relevant(goal, metric)
        refuse_unsupported(goal, matters.actions, self._derivation)
        patience, things = patience or WorkLimit(), things_of(world)
        patience.doing = "grounding the goal"
        grounder = Grounder(world, matters.changing, keep_false=True, patience=patience)
        try:
            wanted = grounder.residual(goal, {})
        except UnsupportedActionError as error:
            raise UnsupportedGoalError(error.message, place=error.place) from None
        if wanted is False:
            return GroundedProblem(matters, things, wanted)
        groundwork, assembly = self._prepare(matters, metric, world, things, patience)
        numbering = groundwork.numbering
        ways, goal_numbers = _with_conjunctive_goal(groundwork.ways, wanted, numbering)
        acting = numbering.of(_ACTING)
        init = (numbering.present(world) - {acting ^ 1}) | {acting}
        return GroundedProblem(matters, things, wanted, Task(numbering, init, goal_numbers, ways), assembly)

    def _relevant(self, goal: Expression, metric: Term | None) -> Relevant:
        """Return the relevant part of the domain; cached by the predicates and functions of the goal."""
        key = frozenset(names_of(goal)), metric
        if key not in self._matters:
            if len(self._matters) >= _MOST_KEPT:
                self._matters.clear()
            self._matters[key] = relevant(goal, metric, self._domain.actions.values())
        return self._matters[key]

    def _prepare(
        self, matters: Relevant, metric: Term | None, world: World, things: Mapping[str, str], patience: WorkLimit
    ) -> tuple[OperatorCache, Assembly]:
        """Return the cached ground actions if they are valid for this world; otherwise new ground actions."""
        key = (tuple(action.name for action in matters.actions), matters.changing, metric)
        known = self._kept.pop(key, None)  # removed during use, so that an error leaves no partial entry
        if known is None or not known[0].serves(world, things):
            groundwork = OperatorCache(matters, metric, world, things)
            known = groundwork, Assembly(groundwork.numbering)
        known[0].extend(world, things, patience)
        while len(self._kept) >= _MOST_KEPT:
            del self._kept[next(iter(self._kept))]
        self._kept[key] = known
        return known

    def _slice(
        self, task: Task, assembly: Assembly, world: World, things: Mapping[str, str], notes: tuple[str, ...]
    ) -> Problem:
        """Return the slice, without objects that others can replace; `unsliced` constructs the whole problem."""
        left, gone = task.left or {}, find_redundant(task)

        def problem(task: Task, world: World | None) -> Problem:
            return assembly.problem(self._domain.name, task, things, world, notes)

        def whole() -> Problem:
            with self._lock:
                return problem(task, None)

        if not gone:
            return problem(task, world)
        slice_ = prune(task, _only(left.keys() - set(gone), len(task.ways.all)))
        if notes:
            slice_ = _evenly_priced(slice_)
        if task.numbering.fluents:  # numeric fluents must have the values of this version
            now = problem(task, world)
            return replace(problem(slice_, world), unsliced=lambda: now)
        return replace(problem(slice_, None), unsliced=whole)

    def _nothing(self, *unreachable: str) -> Problem:
        """Return a problem that needs no engine: the goal holds, or is unreachable."""
        return Problem(self._domain.name, {}, (), (), (), unreachable)


def _set_costs(task: Task, metric: Term | None) -> tuple[Task, tuple[str, ...]]:
    """Return the task with action costs; if the metric is not an action cost, with equal costs and a note."""
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
    """Return the goal as literals and bounds, and the operators with bookkeeping actions for each disjunction.

    A plan contains bookkeeping actions only after the last real action, since a later action may falsify a disjunct.
    """
    bookkeeping: list[_Bookkeeping] = []
    wanted = tuple(map(numbering.of, _conjunction(goal, bookkeeping)))
    if not bookkeeping:
        return ways, wanted
    acting = numbering.of(_ACTING)
    real = [way._replace(needs=(*way.needs, acting)) for way in ways.all]
    finish = ground_operator(None, (_ACTING,), (_ACTING.negated, _FINISHED), numbering, cost=0.0)
    closing = [
        ground_operator(None, (*choice, _FINISHED), (chosen,), numbering, cost=0.0) for choice, chosen in bookkeeping
    ]
    return OperatorIndex([*real, finish, *closing]), wanted


def _without_decided_choices(task: Task, possible: Sequence[int]) -> Task:
    """Return the task whose goal has the condition of each disjunction of which only one part is reachable.

    Engines find plans for such a goal much sooner than for bookkeeping actions. A goal like that of the clean-up table
    has a disjunction for each item, whose other parts are about facts that no action changes.
    """
    if not task.ways.all or task.ways.all[-1].step is not None:  # bookkeeping actions are the last ones
        return task
    finished = task.numbering.of(_FINISHED)

    def simplify(wanted: int) -> Iterator[int]:
        ways = task.ways.adders.get(wanted, ()) if _is_choice(task.numbering.named(wanted)) else ()
        reached = [task.ways.all[i] for i in ways if possible[i]]
        if len(reached) != 1:
            yield wanted
            return
        for need in reached[0].needs:
            if need != finished:
                yield from simplify(need)

    return replace(task, goal=tuple(dict.fromkeys(chain.from_iterable(map(simplify, task.goal)))))


def _is_choice(what: object) -> bool:
    return isinstance(what, Fact) and what.predicate == _ONE_OF


_Bookkeeping = tuple[tuple[Leaf, ...], Literal]
"""The conjunction of one part of a disjunction, and the literal that is true after this part."""


def _conjunction(goal: Residual, bookkeeping: list[_Bookkeeping]) -> tuple[Leaf, ...]:
    match goal:
        case Literal() | NumericBound():
            return (goal,)
        case Every(parts):
            return tuple(leaf for part in parts for leaf in _conjunction(part, bookkeeping))
        case Some(parts):
            choices = [_conjunction(part, bookkeeping) for part in parts]
            chosen = Literal(Fact(_ONE_OF, (len(bookkeeping),)))
            bookkeeping += [(choice, chosen) for choice in choices]
            return (chosen,)
        case _:
            return ()


@cache_on_owner
def _builder(domain: PlanningDomain) -> ProblemBuilder:
    return ProblemBuilder(domain)


def said(numbering: Numbering, missing: int, goal: Expression) -> str:
    """Return an unreachable part of the goal as text."""
    what = numbering.named(missing)
    if _is_choice(what):
        return to_text(goal)
    return f"(not {what})" if missing & 1 else str(what)
