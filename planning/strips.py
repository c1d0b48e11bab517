"""A planning problem as a value: ground STRIPS with numbers (PDDL 2.1 after grounding), the input of every engine.

Facts are positive. For each condition `(not (p a))` the problem maintains the complementary fact (positive normal
form). Its predicate is written `not p`, with a blank, so that no declared name clashes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, partial
from operator import itemgetter
from types import MappingProxyType
from typing import TYPE_CHECKING

from knowledge_base.errors import InputError
from knowledge_base.facts import Fact
from planning.plan import Plan, PlanStep, Timing
from planning.quantities import Assignment, Numbers, NumericBound
from planning.timeline import FINEST, Act, Changes, Flaw, TimelineEvent, carried_out

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence


FEATURES = ("numeric", "costs", "durations", "derived")
"""Features beyond STRIPS that a problem may need; problem construction compiles all others away."""

_NONE: Numbers = MappingProxyType({})


class UnsupportedGoalError(InputError):
    """The goal has a construct without support by any engine; the message names it."""


class UnsupportedActionError(InputError):
    """A relevant planning action has a construct without support by any engine."""


@dataclass(frozen=True, slots=True)
class ActionSpan:
    """The durative part of a ground action, whose own conditions and effects are those at its start.

    Attributes:
        least, most: bounds of its duration, in seconds.
        over_all: facts that must hold from its start to its end.
        end: facts that must hold just before its end.
        adds: facts that hold after its end.
        deletes: facts that no longer hold then, none of them in `adds`.
    """

    least: float
    most: float
    over_all: tuple[Fact, ...] = ()
    end: tuple[Fact, ...] = ()
    adds: tuple[Fact, ...] = ()
    deletes: tuple[Fact, ...] = ()


@dataclass(frozen=True, slots=True)
class GroundAction:
    """One alternative of a plan step.

    A step with a disjunctive precondition or conditional effects has several of these.

    Attributes:
        step: the plan step; `None` for bookkeeping of a disjunctive goal, which no plan shows.
        precondition: facts that must hold before.
        adds: facts that hold afterwards.
        deletes: facts that no longer hold afterwards, none of them in `adds`.
        cost: its share of the plan's cost; never negative, by default 1.
        bounds: numeric conditions before.
        assignments: numeric changes, one for each fluent, all computed from the numbers before.
        span: conditions and effects of a durative action after its start; such an action has no numbers.
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
        """Return whether the precondition holds in `state` and with these numbers."""
        return self.lacks(state, numbers) is None

    def lacks(self, state: Collection[Fact], numbers: Numbers = _NONE) -> Fact | NumericBound | None:
        """Return the first part of the precondition that does not hold, or `None`."""
        missing = next((needed for needed in self.precondition if needed not in state), None)
        return missing or next((bound for bound in self.bounds if not bound.holds(numbers)), None)

    def apply(self, state: Iterable[Fact]) -> frozenset[Fact]:
        """Return the state afterwards."""
        return (frozenset(state) - frozenset(self.deletes)) | frozenset(self.adds)

    def count(self, numbers: Numbers) -> Numbers:
        """Return the numbers afterwards.

        Raises:
            ArithmeticError: a number cannot be computed.
        """
        if not self.assignments:
            return numbers
        return {**numbers, **{one.fluent: one.result(numbers) for one in self.assignments}}

    def facts(self) -> tuple[Fact, ...]:
        """Return every fact in it."""
        later = () if self.span is None else (*self.span.over_all, *self.span.end, *self.span.adds, *self.span.deletes)
        return (*self.precondition, *self.adds, *self.deletes, *later)

    def act(self, timing: Timing) -> Act[frozenset[Fact]]:
        """Return the action at its time, in a state of facts."""
        start, span = _event(self.precondition, self.adds, self.deletes), self.span
        if span is None:
            return Act(timing, start)
        return Act(timing, start, partial(_missing, span.over_all), _event(span.end, span.adds, span.deletes))


@dataclass(frozen=True)
class Problem:
    """The input of an engine; made by `planning.problem.construction.build_problem`.

    Attributes:
        domain: the planning domain's name.
        objects: the objects in it, name -> type.
        init: the relevant facts that hold now.
        goal: the facts to reach; empty if the goal already holds.
        actions: the ground actions that can contribute.
        unreachable: goal facts, as text, that are unreachable even without deletes. If there are any, the problem is
            proven unsolvable without an engine.
        unsliced: makes `whole`; `None` if no object was removed.
        numbers: the relevant numeric fluents' values now.
        bounds: numeric conditions to reach.
        notes: requests without support, e.g. a metric that no engine receives; for readers.
        one_at_a_time: whether durative actions are seen as instantaneous, so that a missing plan proves nothing.
        timed: then the same problem with durations, for a temporal engine.
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
        """The problem with all interchangeable objects, for use when the slice has no plan.

        It is made on access; `None` if no object was removed.
        """
        return None if self.unsliced is None else self.unsliced()

    @cached_property
    def features(self) -> frozenset[str]:
        """The features that an engine must support beyond STRIPS: a subset of `FEATURES`.

        An engine without `costs` still solves the problem, but its plan may be expensive.
        """
        costs = {action.cost for action in self.actions if action.step is not None}
        numeric = bool(self.bounds) or any(action.bounds or action.assignments for action in self.actions)
        durative = any(action.span is not None for action in self.actions)
        needs = {"costs": len(costs) > 1, "numeric": numeric, "durations": durative}
        return frozenset(feature for feature, needed in needs.items() if needed)

    def cost(self, chosen: Iterable[int]) -> float:
        """Return the total cost of the actions with these indices."""
        return sum(self.actions[index].cost for index in chosen)

    @property
    def simulated_seconds(self) -> float:
        """A planning duration for simulated time, from the problem's size alone (never from a clock).

        It is 0.1 s for construction, 1 ms for each ground action and 20 ms for each goal fact. The embedded engine
        needs time of this order of magnitude.
        """
        return round(0.1 + 0.001 * len(self.actions) + 0.02 * len(self.goal), 3)

    def plan(self, chosen: Sequence[int]) -> Plan | str:
        """Return the plan of the actions with these indices, or the reason why it is not a solution."""
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
                return f"the effect of {action.step} cannot be computed: {error}"
        missing_goals = [wanted for wanted in self.goal if wanted not in state]
        missing_bounds = [bound for bound in self.bounds if not bound.holds(numbers)]
        if missing_goals or missing_bounds:
            return f"goal fact {[*missing_goals, *missing_bounds][0]} does not hold at the end"
        return self.taking(chosen)

    def taking(self, chosen: Iterable[int]) -> Plan:
        """Return the steps of the actions with these indices, without bookkeeping."""
        steps = (self.actions[index].step for index in chosen)
        return Plan(tuple(step for step in steps if step is not None))

    def scheduled(self, chosen: Sequence[tuple[int, float, float]]) -> Plan | str:
        """Return the plan of actions (index, start and duration in seconds) at their times, or why it is invalid."""
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
