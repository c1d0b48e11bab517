"""Ground actions as immutable values, with numbers and durations (PDDL 2.1), and their simulation on a time line."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from knowledge_base.facts import Fact
from planning.model.plan import PlanStep, Timing
from planning.model.quantities import Assignment, Numbers, NumericBound
from planning.model.timeline import Act, Changes, TimelineEvent

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

_NONE: Numbers = MappingProxyType({})


class GroundState(NamedTuple):
    """The facts that hold at a time, and the numbers."""

    facts: frozenset[Fact]
    numbers: Numbers


@dataclass(frozen=True, slots=True)
class ActionSpan:
    """Duration, later conditions and later effects of a durative ground action.

    The attributes `precondition`, `adds` and `deletes` of the `GroundAction` apply to the action's start.

    Attributes:
        least, most: bounds of the duration, in seconds.
        over_all: facts that must hold from the start of the action to its end.
        end: facts that must hold just before the end of the action.
        adds: facts that hold after the end of the action.
        deletes: facts that no longer hold after the end of the action, none of them in `adds`.
        lasting_bounds: numeric conditions that must hold from the start of the action to its end.
        end_bounds: numeric conditions that must hold just before the end of the action.
        assignments: numeric changes at the end, computed from the numbers before.
    """

    least: float
    most: float
    over_all: tuple[Fact, ...] = ()
    end: tuple[Fact, ...] = ()
    adds: tuple[Fact, ...] = ()
    deletes: tuple[Fact, ...] = ()
    lasting_bounds: tuple[NumericBound, ...] = ()
    end_bounds: tuple[NumericBound, ...] = ()
    assignments: tuple[Assignment, ...] = ()


@dataclass(frozen=True, slots=True)
class GroundAction:
    """One alternative of a plan step.

    A step with a disjunctive precondition or conditional effects has several ground actions.

    Attributes:
        step: the plan step; `None` for a bookkeeping action, which no plan shows.
        precondition: facts that must hold before the action.
        adds: facts that hold after the action.
        deletes: facts that no longer hold after the action, none of them in `adds`.
        cost: the share of the plan's cost; never negative, by default 1.
        bounds: numeric conditions that must hold before the action.
        assignments: numeric changes, one for each fluent, computed from the numbers before the action.
        span: conditions and effects of a durative action after its start.
    """

    step: PlanStep | None
    precondition: tuple[Fact, ...]
    adds: tuple[Fact, ...]
    deletes: tuple[Fact, ...]
    cost: float = 1.0
    bounds: tuple[NumericBound, ...] = ()
    assignments: tuple[Assignment, ...] = ()
    span: ActionSpan | None = None

    @property
    def is_numeric(self) -> bool:
        """Whether the action has numeric conditions or changes numbers."""
        one = self.span
        later = one is not None and bool(one.lasting_bounds or one.end_bounds or one.assignments)
        return bool(self.bounds or self.assignments) or later

    def applicable(self, state: Collection[Fact], numbers: Numbers = _NONE) -> bool:
        """Return whether the precondition holds in `state` and the numeric conditions hold for `numbers`."""
        return self.lacks(state, numbers) is None

    def lacks(self, state: Collection[Fact], numbers: Numbers = _NONE) -> Fact | NumericBound | None:
        """Return the first fact or numeric condition of the precondition that does not hold, or `None`."""
        return missing_condition(self.precondition, self.bounds, state, numbers)

    def apply(self, state: Iterable[Fact]) -> frozenset[Fact]:
        """Return the state after the action."""
        return (frozenset(state) - frozenset(self.deletes)) | frozenset(self.adds)

    def count(self, numbers: Numbers) -> Numbers:
        """Return the numbers after the action.

        Raises:
            ArithmeticError: the new value of a fluent cannot be computed.
        """
        if not self.assignments:
            return numbers
        return {**numbers, **{one.fluent: one.result(numbers) for one in self.assignments}}

    def facts(self) -> tuple[Fact, ...]:
        """Return every fact that the action mentions."""
        later = () if self.span is None else (*self.span.over_all, *self.span.end, *self.span.adds, *self.span.deletes)
        return (*self.precondition, *self.adds, *self.deletes, *later)

    def act(self, timing: Timing) -> Act[GroundState]:
        """Return the action as an act on the time line."""
        start = _event(self.precondition, self.bounds, self.adds, self.deletes, self.assignments)
        span = self.span
        if span is None:
            return Act(timing, start)
        lasting = partial(_missing, span.over_all, span.lasting_bounds)
        return Act(timing, start, lasting, _event(span.end, span.end_bounds, span.adds, span.deletes, span.assignments))


def missing_condition(
    needed: Iterable[Fact], bounds: Iterable[NumericBound], facts: Collection[Fact], numbers: Numbers
) -> Fact | NumericBound | None:
    """Return the first fact or bound that does not hold, or `None`."""
    missing = next((one for one in needed if one not in facts), None)
    return missing or next((one for one in bounds if not one.holds(numbers)), None)


def _missing(needed: tuple[Fact, ...], bounds: tuple[NumericBound, ...], state: GroundState) -> str | None:
    missing = missing_condition(needed, bounds, *state)
    return None if missing is None else str(missing)


def _event(
    needed: tuple[Fact, ...],
    bounds: tuple[NumericBound, ...],
    adds: tuple[Fact, ...],
    deletes: tuple[Fact, ...],
    assignments: tuple[Assignment, ...],
) -> TimelineEvent[GroundState]:
    facts = {**dict.fromkeys(deletes, False), **dict.fromkeys(adds, True)}

    def changes(state: GroundState) -> Changes:
        return {**facts, **{one.fluent: one.result(state.numbers) for one in assignments}}

    return TimelineEvent(partial(_missing, needed, bounds), changes)


def after(state: GroundState, changes: Changes) -> GroundState:
    """Return the state after changes."""
    numbers = {one: to for one, to in changes.items() if isinstance(to, float | int) and not isinstance(to, bool)}
    facts = (state.facts - changes.keys()) | {fact for fact, holds in changes.items() if holds is True}
    return GroundState(facts, {**state.numbers, **numbers} if numbers else state.numbers)
