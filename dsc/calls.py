"""What passes between the sequencer and a component: a call, how it ended, and what is known of it after a crash."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Protocol

from knowledge_base.facts import Delta

OBSERVED = "(observed)"
"""What `SkillCall.observe` reports instead of an event; no event can be called so in a chart."""


class Clock(Protocol):
    """Time as skills and the sequencer see it: simulated or real, always injected."""

    def now(self) -> float:
        """Seconds of run time."""
        ...

    async def sleep(self, seconds: float) -> None:
        """Let `seconds` of run time pass."""
        ...


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a skill ended: its outcome event, the event's attributes, and what was observed meanwhile.

    `observed` is applied to the knowledge base, with the component as author, before the event is handled.
    """

    event: str
    attributes: Mapping[str, Any] = field(default_factory=dict)
    observed: Delta = field(default_factory=Delta)


@dataclass(frozen=True, slots=True)
class SkillCall:
    """One execution of a skill.

    Attributes:
        action_id: names this execution; stable across restarts, never used for another one.
        clock: the only time a skill may use.
        report: hands over an intermediate event while the skill goes on (e.g. progress, a perception).
        deadline: second of run time at which the skill is cancelled.
        give_up: says that something of the skill goes on that cannot be stopped.

    When a run is resumed after a crash, a call may come again with the same id. Its clock then begins when the
    action was started, and what was reported before is not heard twice: a skill that acts once for an id simply
    goes the same way.
    """

    action_id: str
    clock: Clock
    report: Callable[[Outcome], None]
    deadline: float = math.inf
    give_up: Callable[[str], None] = lambda _: None

    def observe(self, observed: Delta) -> None:
        """Hand over at once what was observed: it is known however the skill ends, and no event for the chart."""
        self.report(Outcome(OBSERVED, observed=observed))

    @property
    def remaining(self) -> float:
        """Seconds of run time until the deadline."""
        return self.deadline - self.clock.now()


class Status(Enum):
    """What a component says about an action that may have been under way when the run was broken off."""

    RUNNING = "running"
    UNKNOWN = "unknown"
    NOT_BEGUN = "not begun"


@dataclass(frozen=True, slots=True)
class Ended:
    """The action came to its end, and how."""

    outcome: Outcome


MOST_WAITING = 5_000
"""Reports of one action that wait to be taken; 750 bytes each, and a run takes some 10,000 in a second."""
_AT_ONCE = 250
"""Observations that become one change together: each such merge takes as long as the change is large."""


class Reports:
    """Posts reports in their order, at most `MOST_WAITING` that were not taken.

    Of further ones the newest of each event waits aside. Their observations become one change, so that no knowledge is
    lost. All of it is posted when half of the others are taken, or at the end.

    Args:
        post: receives a report, and how many older ones of its event it stands for.
    """

    __slots__ = ("_aside", "_observed", "_post", "_waiting")

    def __init__(self, post: Callable[[Outcome, int], None]) -> None:
        self._post = post
        self._waiting = 0
        self._aside: dict[str, tuple[Mapping[str, Any], int]] = {}
        self._observed: list[Delta] = []

    def put(self, report: Outcome) -> None:
        """Post a report, now or later."""
        if self._waiting < MOST_WAITING and not self._aside:
            self._waiting += 1
            self._post(report, 0)
            return
        _, conflated = self._aside.pop(report.event, (None, -1))
        self._aside[report.event] = report.attributes, conflated + 1
        if report.observed:
            self._observed.append(report.observed)
            if len(self._observed) > _AT_ONCE:
                self._observed = [_as_one(self._observed)]

    def taken(self) -> None:
        """One that was posted waits no more."""
        self._waiting -= 1
        if self._aside and self._waiting <= MOST_WAITING // 2:
            self.flush()

    def flush(self) -> None:
        """Post what waits aside; what was observed comes with the first of them."""
        if not self._aside:
            return
        aside, self._aside = self._aside, {}
        observed, self._observed = _as_one(self._observed), []
        for event, (attributes, conflated) in aside.items():
            self._waiting += 1
            self._post(Outcome(event, attributes, observed), conflated)
            observed = Delta()


def _as_one(observed: list[Delta]) -> Delta:
    """One change after the other as a single one; halves first, as most are small."""
    if len(observed) < 2:
        return observed[0] if observed else Delta()
    half = len(observed) // 2
    return _as_one(observed[:half]).then(_as_one(observed[half:]))
