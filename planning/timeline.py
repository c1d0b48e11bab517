"""Acts along a time line: what they need and do at their two ends and in between (PDDL 2.1, Fox & Long 2003).

Whatever happens at one moment needs the state before it, and nothing of it may disturb another part of it: each could
as well have come first. What an act needs all the time holds after each moment from its start until before its end.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from knowledge_base.facts import Content, Fact
from planning.plan import Timing

State = TypeVar("State")
Changes = Mapping[Fact, Content]
"""What becomes of facts (true and false) and of numbers."""
Lacks = Callable[[State], str | None]
"""The first thing that does not hold, as text."""

FINEST = 1e-6
"""Seconds; what is nearer to each other happens at one moment."""


@dataclass(frozen=True, slots=True)
class TimelineEvent(Generic[State]):
    """What happens at one end of an act.

    Attributes:
        lacks: judges its conditions.
        changes: its effect.
    """

    lacks: Lacks[State]
    changes: Callable[[State], Changes]


@dataclass(frozen=True, slots=True)
class Act(Generic[State]):
    """Something that is done at a time.

    Attributes:
        timing: when.
        start: its beginning.
        lasting: judges what must hold all the time between its two ends.
        end: `None` if it has no duration.
    """

    timing: Timing
    start: TimelineEvent[State]
    lasting: Lacks[State] | None = None
    end: TimelineEvent[State] | None = None


@dataclass(frozen=True, slots=True)
class Flaw:
    """Why acts cannot be carried out as timed: `act` is the position of the one that `why` is about."""

    act: int
    why: str


def carried_out(acts: Sequence[Act[State]], state: State, after: Callable[[State, Changes], State]) -> State | Flaw:
    """The state when all acts are over, or the first flaw.

    Args:
        acts: what is done.
        state: the present.
        after: makes a state with changes of another, which stays as it is.
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
    """Which moment that is: times that are nearer to each other than `FINEST` are one."""
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
    """Two facts are the same or not; two changes of one number are never one change."""
    return value != other if isinstance(value, bool) else True


def _together(
    happening: Sequence[tuple[int, TimelineEvent[State]]], state: State, after: Callable[[State, Changes], State]
) -> State:
    changes: dict[Fact, Content] = {}
    for _, event in happening:
        changes.update(event.changes(state))
    return after(state, changes)
