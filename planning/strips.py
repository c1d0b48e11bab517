"""A planning problem as a value: ground STRIPS with numbers (PDDL 2.1 after grounding), the form every engine takes.

Facts are positive: where a condition needs `(not (p a))`, the fact `(not-p a)` is carried along instead
(positive normal form); its predicate is written `not p`, with a blank, so that no declared name can clash.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, partial
from operator import itemgetter
from types import MappingProxyType
from typing import TYPE_CHECKING

from knowledge_base.facts import Fact
from planning.plan import Plan, PlanStep, Timing
from planning.quantities import Assignment, Numbers, NumericBound
from planning.timeline import FINEST, Act, Changes, Flaw, TimelineEvent, carried_out

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence


FEATURES = ("numeric", "costs", "durations", "derived")
"""What a problem may need of an engine beyond STRIPS; everything else is compiled away when posing."""

_NONE: Numbers = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class ActionSpan:
    """What makes a ground action durative; its own conditions and effects are then those at its start.

    Attributes:
        least, most: how long it may take, in seconds.
        over_all: facts that must hold all the time between its start and its end.
        end: facts that must hold just before its end.
        adds: facts that hold after its end.
        deletes: facts that hold no longer then, none of them in `adds`.
    """

    least: float
    most: float
    over_all: tuple[Fact, ...] = ()
    end: tuple[Fact, ...] = ()
    adds: tuple[Fact, ...] = ()
    deletes: tuple[Fact, ...] = ()


@dataclass(frozen=True, slots=True)
class GroundAction:
    """One way to take one plan step.

    A step whose precondition is a disjunction, or that has conditional effects, has several of these.

    Attributes:
        step: what it is in the plan; `None` for bookkeeping of a disjunctive goal, which no plan shows.
        precondition: facts that must hold before.
        adds: facts that hold afterwards.
        deletes: facts that hold no longer, none of them in `adds`.
        cost: what taking it once adds to the plan's cost; never negative, 1 if nobody says otherwise.
        bounds: what must hold of numbers before.
        assignments: how numbers change, one for each fluent, all computed from the numbers before.
        span: of a durative action, what it needs and does after its start; such an action has no numbers.
    """

    step: PlanStep | None
    precondition: tuple[Fact, ...]
    adds: tuple[Fact, ...]
    deletes: tuple[Fact, ...]
    cost: float = 1.0
    bounds: tuple[NumericBound, ...] = ()
    assignments: tuple[Assignment, ...] = ()
    span: ActionSpan | None = None

    def applicable(self, state: Collection[Fact], numbers: Numbers = _NONE) -> bool:
        """Whether the precondition holds in `state` and with these numbers."""
        return self.lacks(state, numbers) is None

    def lacks(self, state: Collection[Fact], numbers: Numbers = _NONE) -> Fact | NumericBound | None:
        """The first part of the precondition that does not hold."""
        missing = next((needed for needed in self.precondition if needed not in state), None)
        return missing or next((bound for bound in self.bounds if not bound.holds(numbers)), None)

    def apply(self, state: Iterable[Fact]) -> frozenset[Fact]:
        """The state after it."""
        return (frozenset(state) - frozenset(self.deletes)) | frozenset(self.adds)

    def count(self, numbers: Numbers) -> Numbers:
        """The numbers after it.

        Raises:
            ArithmeticError: one of them cannot be computed.
        """
        if not self.assignments:
            return numbers
        return {**numbers, **{one.fluent: one.result(numbers) for one in self.assignments}}

    def facts(self) -> tuple[Fact, ...]:
        """Every fact it mentions."""
        later = () if self.span is None else (*self.span.over_all, *self.span.end, *self.span.adds, *self.span.deletes)
        return (*self.precondition, *self.adds, *self.deletes, *later)

    def act(self, timing: Timing) -> Act[frozenset[Fact]]:
        """The action at its time, in a state of facts."""
        start, span = _event(self.precondition, self.adds, self.deletes), self.span
        if span is None:
            return Act(timing, start)
        return Act(timing, start, partial(_missing, span.over_all), _event(span.end, span.adds, span.deletes))


@dataclass(frozen=True)
class Problem:
    """What an engine is asked; made by `planning.problem.construction.pose`.

    Attributes:
        domain: the planning domain's name.
        objects: the objects it is about, name -> type.
        init: the facts that hold now, as far as they matter.
        goal: the facts that shall hold; none left means the goal already holds.
        actions: the ground actions that can contribute.
        unreachable: goal facts, as text, that no sequence of actions can make true even if nothing ever
            became false; if there are any, the problem is proven unsolvable without asking an engine.
        unsliced: makes `whole`; `None` if nothing was sliced off.
        numbers: the numeric fluents' values now, as far as they matter.
        bounds: what shall hold of numbers.
        notes: what was asked for and cannot be had, e.g. a metric that no engine is told about; for people.
        one_at_a_time: whether durative actions are seen as ordinary ones, so that its having no plan proves nothing.
        timed: then the same problem with durations, for an engine that can do them.
    """

    domain: str
    objects: Mapping[str, str]
    init: tuple[Fact, ...]
    goal: tuple[Fact, ...]
    actions: tuple[GroundAction, ...]
    unreachable: tuple[str, ...] = ()
    unsliced: Callable[[], Problem] | None = field(default=None, compare=False)
    numbers: Mapping[Fact, float] = field(default_factory=dict)
    bounds: tuple[NumericBound, ...] = ()
    notes: tuple[str, ...] = ()
    one_at_a_time: bool = False
    timed: Problem | None = None

    @property
    def whole(self) -> Problem | None:
        """The problem without the slice of interchangeable objects, for when the slice has no plan.

        Made when it is asked for, `None` if nothing was sliced off.
        """
        return None if self.unsliced is None else self.unsliced()

    @cached_property
    def features(self) -> frozenset[str]:
        """What an engine must be able to do beyond STRIPS: a subset of `FEATURES`.

        `costs` is a wish rather than a need: an engine that cannot do them still gives a plan, not a cheap one.
        """
        costs = {action.cost for action in self.actions if action.step is not None}
        numeric = bool(self.bounds) or any(action.bounds or action.assignments for action in self.actions)
        durative = any(action.span is not None for action in self.actions)
        needs = {"costs": len(costs) > 1, "numeric": numeric, "durations": durative}
        return frozenset(feature for feature, needed in needs.items() if needed)

    def cost(self, chosen: Iterable[int]) -> float:
        """What the actions with these indices cost together."""
        return sum(self.actions[index].cost for index in chosen)

    @property
    def simulated_seconds(self) -> float:
        """A planning duration for simulated time, from the problem's size alone (never from a clock).

        0.1 s to pose it, 1 ms for each ground action and 20 ms for each goal fact: the order of magnitude
        that the embedded engine needs.
        """
        return round(0.1 + 0.001 * len(self.actions) + 0.02 * len(self.goal), 3)

    def plan(self, chosen: Sequence[int]) -> Plan | str:
        """The plan that executes the actions with these indices, or why that is no solution."""
        state, numbers = frozenset(self.init), self.numbers
        for index in chosen:
            if not 0 <= index < len(self.actions):
                return f"there is no action number {index}"
            action = self.actions[index]
            missing = action.lacks(state, numbers)
            if missing is not None:
                return f"{action.step} is not applicable, {missing} does not hold"
            try:
                state, numbers = action.apply(state), action.count(numbers)
            except ArithmeticError as error:
                return f"what {action.step} changes cannot be computed: {error}"
        missing_goals = [wanted for wanted in self.goal if wanted not in state]
        missing_bounds = [bound for bound in self.bounds if not bound.holds(numbers)]
        if missing_goals or missing_bounds:
            return f"goal fact {[*missing_goals, *missing_bounds][0]} does not hold at the end"
        return self.taking(chosen)

    def taking(self, chosen: Iterable[int]) -> Plan:
        """The steps of the actions with these indices, without bookkeeping."""
        steps = (self.actions[index].step for index in chosen)
        return Plan(tuple(step for step in steps if step is not None))

    def scheduled(self, chosen: Sequence[tuple[int, float, float]]) -> Plan | str:
        """The plan that has actions (index, start and duration in seconds) begin at their times, or why it is none."""
        chosen = sorted(chosen, key=itemgetter(1))
        acts = []
        for index, start, seconds in chosen:
            if not 0 <= index < len(self.actions):
                return f"there is no action number {index}"
            action = self.actions[index]
            least, most = (action.span.least, action.span.most) if action.span else (0.0, 0.0)
            if not least - FINEST <= seconds <= most + FINEST:
                return f"{action.step} takes {seconds:g} s, which is not between {least:g} and {most:g}"
            acts.append(action.act(Timing(start, seconds)))
        state = carried_out(acts, frozenset(self.init), _changed)
        if isinstance(state, Flaw):
            return f"{self.actions[chosen[state.act][0]].step} needs {state.why}"
        missing = [wanted for wanted in self.goal if wanted not in state]
        if missing:
            return f"goal fact {missing[0]} does not hold at the end"
        steps = [(self.actions[index].step, act.timing) for (index, _, _), act in zip(chosen, acts, strict=True)]
        return Plan(
            tuple(step for step, _ in steps if step is not None),
            tuple(timing for step, timing in steps if step is not None),
        )


def _missing(needed: tuple[Fact, ...], state: frozenset[Fact]) -> str | None:
    return next((str(one) for one in needed if one not in state), None)


def _event(
    needed: tuple[Fact, ...], adds: tuple[Fact, ...], deletes: tuple[Fact, ...]
) -> TimelineEvent[frozenset[Fact]]:
    changes = {**dict.fromkeys(deletes, False), **dict.fromkeys(adds, True)}
    return TimelineEvent(partial(_missing, needed), lambda _: changes)


def _changed(state: frozenset[Fact], changes: Changes) -> frozenset[Fact]:
    return (state - changes.keys()) | {fact for fact, holds in changes.items() if holds}
