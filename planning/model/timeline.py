"""Simulation of durative actions on a time line, by the semantics of PDDL 2.1 (Fox & Long 2003).

An act has conditions and effects at start, over all and at end. Simultaneous events must not interfere: each of them
must be possible in the state before, and each order of them must have the same effect. A condition over all must
hold after each event from the start of the act until before its end.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from knowledge_base.facts import Content, Fact
from planning.model.plan import Timing

State = TypeVar("State")
Changes = Mapping[Fact, Content]
"""New truth values of facts and new values of numeric fluents."""
Lacks = Callable[[State], str | None]
"""Returns the first condition that does not hold in a state, as text; `None` if all conditions hold."""

FINEST = 1e-6
"""Resolution in seconds; events that are closer together than this are simultaneous."""


@dataclass(frozen=True, slots=True)
class TimelineEvent(Generic[State]):
    """The start or the end of an act.

    Attributes:
        lacks: returns the first condition of the event that does not hold, or `None`.
        changes: returns the effect of the event.
    """

    lacks: Lacks[State]
    changes: Callable[[State], Changes]


@dataclass(frozen=True, slots=True)
class Act(Generic[State]):
    """An act with a start time and a duration.

    Attributes:
        timing: start and duration of the act.
        start: the event at the start of the act.
        lasting: returns the first violated part of the condition over all, or `None`.
        end: the event at the end of the act; `None` for an act without a duration.
    """

    timing: Timing
    start: TimelineEvent[State]
    lasting: Lacks[State] | None = None
    end: TimelineEvent[State] | None = None


@dataclass(frozen=True, slots=True)
class Flaw:
    """The first violated condition of a schedule.

    Attributes:
        act: the index of the act.
        why: the condition, as text.
    """

    act: int
    why: str


def execute(acts: Sequence[Act[State]], state: State, after: Callable[[State, Changes], State]) -> State | Flaw:
    """Return the state after all acts, or the first violated condition.

    Args:
        acts: the acts, in any order.
        state: the state before the first act.
        after: returns the state after changes; must not change its argument.
    """
    moments: dict[int, list[tuple[int, TimelineEvent[State]]]] = {}
    for number, act in enumerate(acts):
        moments.setdefault(moment(act.timing.start), []).append((number, act.start))
        if act.end is not None:
            moments.setdefault(moment(act.timing.end), []).append((number, act.end))
    for now in sorted(moments):
        happening = moments[now]
        flaw = _flaw(happening, state, after)
        if flaw is not None:
            return flaw
        state = _together(happening, state, after)
        for number, act in enumerate(acts):
            if act.lasting is not None and moment(act.timing.start) <= now < moment(act.timing.end):
                lost = act.lasting(state)
                if lost is not None:
                    return Flaw(number, lost)
    return state


def moment(seconds: float) -> int:
    """Return the time in multiples of `FINEST`; simultaneous events have equal numbers."""
    return round(seconds / FINEST)


def _flaw(
    happening: Sequence[tuple[int, TimelineEvent[State]]], state: State, after: Callable[[State, Changes], State]
) -> Flaw | None:
    for number, event in happening:
        missing = event.lacks(state)
        if missing is not None:
            return Flaw(number, missing)
    for (_, first), (number, second) in itertools.permutations(happening, 2):
        made = first.changes(state)
        alone, ahead = second.changes(state), after(state, made)
        rival = (one for one, value in alone.items() if one in made and _differ(value, made[one]))
        other = (one for one, _ in alone.items() ^ second.changes(ahead).items())
        disturbed = second.lacks(ahead) or next(itertools.chain(rival, other), None)
        if disturbed is not None:
            return Flaw(number, f"{disturbed} (something else changes that at the same moment)")
    return None


def _differ(value: Content, other: Content) -> bool:
    """Return whether two changes differ; two numeric changes always do, since their order may matter."""
    return value != other if isinstance(value, bool) else True


def _together(
    happening: Sequence[tuple[int, TimelineEvent[State]]], state: State, after: Callable[[State, Changes], State]
) -> State:
    changes: dict[Fact, Content] = {}
    for _, event in happening:
        changes.update(event.changes(state))
    return after(state, changes)
