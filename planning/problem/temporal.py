"""Construction of a temporal problem: ground actions with conditions and effects at start, over all and at end.

Relaxed reachability treats start and end of an action as two operators. An end is possible if the start is possible
and the conditions over all and at end can hold. A goal that is unreachable here is also unreachable with concurrent
actions; the problem with one action at a time cannot prove that.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from knowledge_base.facts import Fact, Value
from knowledge_base.language.evaluation.evaluator import evaluate_term
from knowledge_base.language.evaluation.terms import as_number
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.effect import AllOf
from knowledge_base.language.syntax.expression import And, Expression
from planning.model.cancellable_work import WorkLimit
from planning.model.domain import PlanningAction, PlanningDomain
from planning.model.ground_action import ActionSpan, GroundAction
from planning.model.plan import PlanStep
from planning.model.problem import Problem, UnsupportedActionError
from planning.model.quantities import Assignment, NumericBound, fluents, value_of
from planning.problem.conditions import Every, Grounder, Leaf, Literal, Residual, alternatives
from planning.problem.expressions import changed
from planning.problem.grounding import ground_operators
from planning.problem.operators import OperatorCache, things_of
from planning.problem.relaxed_reachability import reachable
from planning.problem.relevance import Relevant, relevant
from planning.problem.task import NOT, GroundOperator, Numbering, OperatorIndex, Task, as_fact, ground_action

LONGEST = 1e6
"""The upper bound, in seconds, of the duration of an action without an upper bound in the domain."""

_MOST_ALTERNATIVES = 64  # alternatives of one step
_ENDS, _BEGUN = " ends", "begun "  # the blanks distinguish the names from every declared name


class _TooComplexError(Exception):
    """Error: the problem has a disjunctive goal, variable durations, or too many alternatives of one step."""


def durative(domain: PlanningDomain, goal: Expression) -> bool:
    """Return whether durative actions matter for the goal; derived predicates in it must have been replaced."""
    if all(action.timed is None for action in domain.actions.values()):
        return False
    return any(action.timed is not None for action in _relevant(domain, goal).actions)


def build_temporal_problem(
    domain: PlanningDomain, world: World, goal: Expression, patience: WorkLimit
) -> Problem | None:
    """Return the problem with durations; `None` if it has a disjunctive goal, or durations that actions change.

    Args:
        domain: the domain without derived predicates, see `planning.problem.derived.derivation`.
        world: the present world, with derived facts.
        goal: the condition to reach, without derived predicates.
        patience: the limit of the work.

    Raises:
        WorkLimitError: the limit has passed.
    """
    matters = _relevant(domain, goal)
    actions = {action.name: domain.actions[action.name] for action in matters.actions}
    # Functions in the bounds of durations are relevant too.
    changing = matters.changing.union(*(changed(action.effect) for action in matters.actions))
    try:
        wanted = _leaves(Grounder(world, matters.changing, keep_false=True, patience=patience).residual(goal, {}))
        steps, missing = _possible(actions.values(), matters, wanted, world, patience)
        if missing:
            return Problem(domain.name, {}, (), (), (), missing)
        grounding = _Grounding(actions, Grounder(world, changing, patience=patience), world, Numbering())
        found = [action for step in steps for action in grounding.of(step)]
    except (_TooComplexError, UnsupportedActionError):
        return None
    return _restrict(domain.name, found, wanted, world)


def _relevant(domain: PlanningDomain, goal: Expression) -> Relevant:
    """Return the relevant part of the domain; each action has its conditions and effects of all times."""
    return relevant(goal, None, map(_whole, domain.actions.values()))


def _whole(action: PlanningAction) -> PlanningAction:
    timed = action.timed
    if timed is None:
        return action
    precondition = And((timed.start, timed.over_all, timed.end))
    return replace(action, precondition=precondition, effect=AllOf((timed.start_effect, timed.end_effect)))


def _leaves(wanted: Residual) -> tuple[Leaf, ...]:
    parts = wanted.parts if isinstance(wanted, Every) else (wanted,)
    found = tuple(part for part in parts if isinstance(part, Literal | NumericBound))
    if len(found) < len(parts):
        raise _TooComplexError
    return found


def _start(action: PlanningAction) -> PlanningAction:
    """Return the start of a durative action as an instantaneous action; any other action unchanged."""
    timed = action.timed
    return action if timed is None else replace(action, precondition=timed.start, effect=timed.start_effect)


def _end(action: PlanningAction, *needed: Expression) -> Iterator[PlanningAction]:
    if action.timed is not None:
        name = action.name + _ENDS
        yield replace(action, name=name, precondition=And(needed), effect=action.timed.end_effect)


def _possible(
    actions: Iterable[PlanningAction],
    matters: Relevant,
    wanted: tuple[Leaf, ...],
    world: World,
    patience: WorkLimit,
) -> tuple[list[PlanStep], tuple[str, ...]]:
    """Return the steps that are reachable without deletes, and the goal literals that are not."""
    actions = tuple(actions)
    later = [one for action in actions if action.timed for one in _end(action, action.timed.over_all, action.timed.end)]
    ends = replace(matters, actions=(*map(_start, actions), *later))
    things = things_of(world)
    groundwork = OperatorCache(ends, None, world, things)
    groundwork.extend(world, things, patience)
    numbering = groundwork.numbering

    def link(way: GroundOperator, step: PlanStep) -> GroundOperator:
        begun = numbering.of(Literal(Fact(_BEGUN + step.action.removesuffix(_ENDS), step.args)))
        if step.action.endswith(_ENDS):
            return way._replace(needs=(*way.needs, begun))
        return way._replace(adds=(*way.adds, begun))

    ways = OperatorIndex([link(way, way.step) for way in groundwork.ways.all if way.step is not None])
    goal = tuple(map(numbering.of, wanted))
    begun = {one for way in ways.all for one in way.adds if str(numbering.named(one)).startswith(f"({_BEGUN}")}
    reach = reachable(Task(numbering, numbering.present(world) - begun, goal, ways))
    missing = [one for one, number in zip(wanted, goal, strict=True) if number not in reach.facts]
    if missing:
        return [], tuple(map(_as_text, missing))
    taken = {way.step: None for way, so in zip(ways.all, reach.taken, strict=True) if so and way.step is not None}
    endless = {action.name for action in actions if action.timed is None}
    return [s for s in taken if s.action in endless or PlanStep(s.action + _ENDS, s.args) in taken], ()


@dataclass(frozen=True, slots=True)
class _Grounding:
    """Constructor of the ground actions of possible steps."""

    actions: Mapping[str, PlanningAction]
    grounder: Grounder
    world: World
    numbering: Numbering

    def of(self, step: PlanStep) -> Iterator[GroundAction]:
        """Yield an action for each alternative; one alternative over all holds for the whole duration."""
        action = self.actions[step.action]
        bindings = {p.name: arg for p, arg in zip(action.parameters, step.args, strict=True)}
        starts = list(ground_operators(_start(action), bindings, self.grounder, self.numbering))
        spans = list(self._spans(action, bindings))
        if len(starts) * len(spans) > _MOST_ALTERNATIVES:
            raise _TooComplexError
        for start, span in itertools.product(starts, spans):
            yield replace(ground_action(start, self.numbering), step=step, span=span)

    def _spans(self, action: PlanningAction, bindings: Mapping[str, Value]) -> Iterator[ActionSpan | None]:
        timed, duration = action.timed, action.duration
        if timed is None or duration is None:
            yield None
            return
        if any(map(self.grounder.changes, (duration.least, duration.most))):
            raise _TooComplexError
        least, most = (
            as_number(evaluate_term(one, self.world, bindings), "a duration", one.place)
            for one in (duration.least, duration.most)
        )
        lasting = list(
            itertools.islice(alternatives(self.grounder.precondition(timed.over_all, bindings)), _MOST_ALTERNATIVES + 1)
        )
        ends = [
            ground_action(end, self.numbering)
            for one in _end(action, timed.end)
            for end in ground_operators(one, bindings, self.grounder, self.numbering)
        ]
        if len(lasting) * len(ends) > _MOST_ALTERNATIVES:
            raise _TooComplexError
        for always, end in itertools.product(lasting, ends):
            yield ActionSpan(
                least, min(most, LONGEST), _facts(always), end.precondition, end.adds, end.deletes,
                _bounds(always), end.bounds, end.assignments,
            )  # fmt: skip


def _facts(leaves: Iterable[Leaf]) -> tuple[Fact, ...]:
    return tuple(as_fact(one) for one in leaves if isinstance(one, Literal))


def _bounds(leaves: Iterable[Leaf]) -> tuple[NumericBound, ...]:
    return tuple(one for one in leaves if isinstance(one, NumericBound))


def _as_text(leaf: Leaf) -> str:
    return str(leaf) if isinstance(leaf, NumericBound) else str(leaf.fact) if leaf.positive else f"(not {leaf.fact})"


def _numbers(actions: Iterable[GroundAction], goal: Iterable[NumericBound]) -> set[Fact]:
    """Return the numbers that conditions read, directly or in the changes of such numbers."""
    parts = [part for action in actions for part in (action, action.span) if part is not None]
    bounds = [*goal, *(bound for action in actions for bound in action.bounds)]
    bounds += [
        bound for part in parts if isinstance(part, ActionSpan) for bound in (*part.lasting_bounds, *part.end_bounds)
    ]
    read, found = set[Fact](), {one for bound in bounds for one in bound.fluents()}
    while found - read:
        read |= found
        found = {
            one
            for part in parts
            for change in part.assignments
            if change.fluent in read
            for one in fluents(change.amount)
        }
    return read


def _restrict(name: str, actions: list[GroundAction], wanted: tuple[Leaf, ...], world: World) -> Problem:
    """Return the problem without facts and numbers that no condition reads, and without facts that never change."""
    goal, bounds = _facts(wanted), _bounds(wanted)
    read = _numbers(actions, bounds)
    asked = dict.fromkeys([*goal, *(fact for action in actions for fact in _conditions_of(action))])
    gone = {fact for action in actions for fact in (*action.deletes, *(action.span.deletes if action.span else ()))}
    present = [fact for fact in asked if _holds(fact, world)]
    kept = asked.keys() - (set(present) - gone)

    def among(facts: tuple[Fact, ...]) -> tuple[Fact, ...]:
        return tuple(fact for fact in facts if fact in kept)

    def with_read(assignments: tuple[Assignment, ...]) -> tuple[Assignment, ...]:
        return tuple(one for one in assignments if one.fluent in read)

    def small(action: GroundAction) -> GroundAction:
        one = action.span
        span = one and replace(
            one, over_all=among(one.over_all), end=among(one.end), adds=among(one.adds), deletes=among(one.deletes),
            assignments=with_read(one.assignments),
        )  # fmt: skip
        return replace(
            action, precondition=among(action.precondition), adds=among(action.adds), deletes=among(action.deletes),
            assignments=with_read(action.assignments), span=span,
        )  # fmt: skip

    mentioned = dict.fromkeys(arg for action in actions if action.step for arg in action.step.args)
    objects = {one: kind for one in mentioned if (kind := world.type_of(one)) is not None}
    numbers = {one: value_of(world, one) for one in sorted(read, key=str)}
    init = tuple(one for one in present if one in kept)
    return Problem(name, objects, init, among(goal), tuple(map(small, actions)), numbers=numbers, bounds=bounds)


def _conditions_of(action: GroundAction) -> tuple[Fact, ...]:
    span = action.span
    return (*action.precondition, *(() if span is None else (*span.over_all, *span.end)))


def _holds(fact: Fact, world: World) -> bool:
    predicate = fact.predicate.removeprefix(NOT)
    return world.holds(predicate, fact.args) is (predicate == fact.predicate)
