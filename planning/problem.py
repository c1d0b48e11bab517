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
from knowledge_base.language.printer import to_text
from planning.conditions import Every, Grounder, Leaf, Literal, Residual, Some
from planning.costs import ignored, metric_of
from planning.derived import derivation
from planning.errors import UnsupportedActionError, UnsupportedGoalError
from planning.grounding import Variant
from planning.groundwork import Groundwork, Way, numbered, things_of
from planning.interchange import spared
from planning.quantities import Bound, fluents
from planning.reduction import Task, pruned, reachable
from planning.relevance import Relevant, relevant
from planning.strips import GroundAction, Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from knowledge_base.exchange.problem_text import Metric
    from knowledge_base.language.evaluation import World
    from planning.domain import PlanningDomain
    from planning.numbering import Numbering

# Names with blanks, which no declared name can clash with.
_ACTING, _FINISHED = Literal(Fact("still acting")), Literal(Fact("finished acting"))
_ONE_OF = "one of"
_MOST_KEPT = 8  # goals of different kinds, each with its ground actions


def pose(domain: PlanningDomain, world: World, goal: Expression, metric: Metric | None = None) -> Problem:
    """The problem of reaching `goal` from `world`, which stays as it is.

    Args:
        domain: the planning actions.
        world: the present.
        goal: what shall hold.
        metric: what makes a plan better than another; to minimize `(total-cost)` if the domain declares that.

    Raises:
        InputError: the goal has a free variable, or names something that is not declared or not known.
        UnsupportedGoalError: the goal states a fact about a number that actions change, or asks for a derived
            predicate that cannot be planned with.
        UnsupportedActionError: so does an action that matters, or it has too many alternatives.
    """
    return Poser(domain).pose(world, goal, metric)


def check_goal(goal: Expression, world: World) -> None:
    """Raise an `InputError` unless the goal says something about the things of this world."""
    check(goal, world.schema, objects=things_of(world))


@dataclass(frozen=True, slots=True)
class Posing:
    """A problem before anything that cannot contribute is left out.

    Attributes:
        relevant: what of the domain matters.
        grounder: evaluates conditions as far as the relevant actions do not change them.
        wanted: what is left of the goal; `False` if it can never hold.
        task: the ground problem; `None` if it can never hold.
    """

    relevant: Relevant
    grounder: Grounder
    wanted: Residual
    task: Task | None


class Poser:
    """Poses one problem after the other for a domain, and keeps what the next one needs again.

    The problem is the same as that of a new poser, only sooner. May be used by several threads.
    """

    def __init__(self, domain: PlanningDomain) -> None:
        self._derivation = derivation(domain)
        self._domain = self._derivation.domain
        self._kept: dict[tuple[tuple[str, ...], frozenset[str], Term | None], Groundwork] = {}
        self._lock = threading.Lock()

    def pose(self, world: World, goal: Expression, metric: Metric | None = None) -> Problem:
        """See `planning.problem.pose`."""
        check_goal(goal, world)
        world = self._derivation.world(world)
        if holds(self._derivation.expand(goal), world):
            return self._nothing()
        amount = metric_of(metric, world.schema)
        with self._lock:
            posing = self.posing(world, goal, amount)
            if posing.task is None:
                return self._nothing(to_text(goal))
            reached, possible = reachable(posing.task)
            missing = [said(posing.task.numbering, one, goal) for one in posing.task.goal if one not in reached]
            if missing:
                return self._nothing(*dict.fromkeys(missing))
            possible, notes = _priced(possible, amount)
            return self._sliced(pruned(posing.task, possible), world, notes)

    def posing(self, world: World, goal: Expression, metric: Term | None = None) -> Posing:
        """The problem of reaching a checked goal, with everything evaluated that cannot change.

        Args:
            world: the present, with derived facts.
            goal: what shall hold.
            metric: what plans shall have little of.

        Raises:
            UnsupportedGoalError, UnsupportedActionError: as for `pose`.
        """
        goal = self._derivation.expand(goal)
        matters = relevant(goal, metric, self._domain.actions.values())
        self._derivation.require_supported(goal, matters.actions)
        grounder = Grounder(world, matters.changing, keep_false=True)
        try:
            wanted = grounder.residual(goal, {})
        except UnsupportedActionError as error:
            raise UnsupportedGoalError(error.message, place=error.place) from None
        if wanted is False:
            return Posing(matters, grounder, wanted, None)
        numbering, ways = self._groundwork(matters, metric, world)
        ways, goal_numbers = _with_conjunctive_goal(ways, wanted, numbering)
        init = (numbering.present(world) - {numbering.of(_ACTING.negated)}) | {numbering.of(_ACTING)}
        task = Task(numbering, init, goal_numbers, ways)
        return Posing(matters, grounder, wanted, task)

    def _groundwork(self, matters: Relevant, metric: Term | None, world: World) -> tuple[Numbering, Sequence[Way]]:
        """The ground actions that may matter, those of an earlier problem if they serve."""
        key = (tuple(action.name for action in matters.actions), matters.changing, metric)
        known = self._kept.pop(key, None)  # taken out, so that an error on the way leaves nothing half done
        if known is None or not known.serves(world):
            known = Groundwork(matters, metric, world)
        ways = known.ways(world)
        while len(self._kept) >= _MOST_KEPT:
            del self._kept[next(iter(self._kept))]
        self._kept[key] = known
        return known.numbering, ways

    def _sliced(self, task: Task, world: World, notes: tuple[str, ...]) -> Problem:
        whole = self._problem(task, world, notes)
        left = spared(task)
        if len(left) == len(task.ways):
            return whole
        slice_ = replace(task, ways=left)
        reached, possible = reachable(slice_)
        if not reached.issuperset(task.goal):
            return whole
        return replace(self._problem(pruned(slice_, possible), world, notes), whole=whole)

    def _problem(self, task: Task, world: World, notes: tuple[str, ...]) -> Problem:
        init, _ = _split(task.numbering, task.init)
        goal, bounds = _split(task.numbering, task.goal)
        actions = tuple(_ground_action(way, task.numbering) for way in task.ways)
        mentioned = dict.fromkeys(arg for action in actions if action.step for arg in action.step.args)
        mentioned.update(dict.fromkeys(str(value) for fact in (*init, *goal) for value in fact.args))
        types = {one: world.type_of(one) for one in mentioned}
        objects = {one: kind for one, kind in types.items() if kind is not None}
        numbers = {one: world.value(one.predicate, one.args) for one in _fluents(actions, bounds)}
        return Problem(self._domain.name, objects, init, goal, actions, (), None, numbers, bounds, notes)

    def _nothing(self, *unreachable: str) -> Problem:
        """A problem that needs no engine: the goal holds, or cannot be reached."""
        return Problem(self._domain.name, {}, (), (), (), unreachable)


def _priced(possible: list[Way], metric: Term | None) -> tuple[list[Way], tuple[str, ...]]:
    """The ways with their costs, or all with the same cost and a note why."""
    if all(way.cost is not None for way in possible):
        return possible, ()
    return [replace(way, cost=1.0) for way in possible], () if metric is None else (ignored(metric),)


def _split(numbering: Numbering, numbers: Iterable[int]) -> tuple[tuple[Fact, ...], tuple[Bound, ...]]:
    """Facts in positive normal form, and bounds."""
    facts: list[Fact] = []
    bounds: list[Bound] = []
    for number in numbers:
        one = numbering.named(number)
        if isinstance(one, Bound):
            bounds.append(one)
        else:
            facts.append(numbering.fact(number))
    return tuple(facts), tuple(bounds)


def _ground_action(way: Way, numbering: Numbering) -> GroundAction:
    needs, bounds = _split(numbering, way.needs)
    adds = tuple([numbering.fact(one) for one in way.adds if one not in numbering.fluents])
    deletes = tuple(map(numbering.fact, way.deletes))
    return GroundAction(way.step, needs, adds, deletes, 0.0 if way.cost is None else way.cost, bounds, way.assignments)


def _fluents(actions: Iterable[GroundAction], goal: Iterable[Bound]) -> dict[Fact, None]:
    """All numeric fluents that matter."""
    found = dict.fromkeys(fluent for bound in goal for fluent in bound.fluents())
    for action in actions:
        found.update((fluent, None) for bound in action.bounds for fluent in bound.fluents())
        for one in action.assignments:
            found.update(dict.fromkeys((one.fluent, *fluents(one.amount))))
    return found


def _with_conjunctive_goal(
    ways: Sequence[Way], goal: Residual, numbering: Numbering
) -> tuple[Sequence[Way], tuple[int, ...]]:
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
    real = [replace(way, needs=(*way.needs, acting)) for way in ways]
    return [*real, *(numbered(variant, numbering, 0.0) for variant in (finish, *closing))], wanted


def _conjunction(goal: Residual, bookkeeping: list[Variant]) -> tuple[Leaf, ...]:
    match goal:
        case Literal() | Bound():
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


def said(numbering: Numbering, missing: int, goal: Expression) -> str:
    """A part of the goal as its reader knows it."""
    what = numbering.named(missing)
    if isinstance(what, Fact) and what.predicate == _ONE_OF:
        return to_text(goal)
    return f"(not {what})" if missing & 1 else str(what)
