"""Calls of plots and skills: a call's identity and clock, its reports, its outcome, and its status after a crash."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from enum import Enum
from typing import Any, Generic, Never, Protocol, cast

from typing_extensions import TypeVar

from dsc.outcomes import Outcome
from dsc.rank import ORDINARY, Rank
from knowledge_base.facts import Delta

OBSERVED = "(observed)"
"""The event of a report by `SkillCall.observe`; no event of a chart can have this name."""
RECORDED = "(recorded)"
"""The event of a report by `SkillCall.record`, with the attribute `lines`."""


class Clock(Protocol):
    """The clock of skills and the sequencer, in simulated or real time; callers always inject it."""

    def now(self) -> float:
        """Return the seconds of run time."""
        ...

    async def sleep(self, seconds: float) -> None:
        """Wait until `seconds` of run time have passed."""
        ...

    def hold(self) -> AbstractContextManager[None]:
        """Return a context manager: simulated time stands still while its block waits for a thread or process."""
        ...


Outputs = TypeVar("Outputs", bound=Mapping[str, Any], default=Mapping[str, Any])
"""Outputs of a plot by name; a `TypedDict` gives them types."""


@dataclass(frozen=True)  # without slots: `PlotCall[…](…)` sets an attribute
class PlotCall(Generic[Outputs]):
    """A plot with values of its parameters, as the functions return it that `dsc plot types` makes (S2.11).

    Attributes:
        plot: the name of the plot.
        given: values by parameter; `None` leaves the parameter's default.
    """

    plot: str
    given: Mapping[str, Any]

    @property
    def arguments(self) -> dict[str, Any]:
        """The values without those that are left to defaults."""
        return {name: value for name, value in self.given.items() if value is not None}


Reported_contra = TypeVar("Reported_contra", bound=Outcome, contravariant=True, default=Never)
"""Outcome classes that a skill reports before its end."""


@dataclass(frozen=True, slots=True)
class SkillCall(Generic[Reported_contra]):
    """One execution of a skill; `SkillCall[Progress]` is the call of a skill that reports `Progress`.

    Attributes:
        action_id: identifies this execution in its run; the id is stable across restarts. In real time it contains the
            run, and is unique.
        clock: the only clock that a skill may use.
        report: posts an intermediate event while the skill continues (e.g. progress, a perception).
        deadline: second of run time at which the skill is cancelled.
        abandon: reports, as text, that a part of the skill continues and cannot be stopped.
        rank: the rank of the skill among those that wait for its component.
        waits: reports, as text, the skill of another program for which the component lets this skill wait; empty when
            the wait ends.
        run: identifies the run, see `key`; empty in a run without an id.
        fence: the fencing number of the program that hosts the component; 0 without a host. A later host has a greater
            number, so that a device can refuse a host that was replaced.

    After a crash, a resumed run may repeat a call with an equal id. The clock of the repeated call begins at the start
    of the action, and repeated reports are dropped. So a skill that acts only one time for each id executes the same
    steps again.
    """

    action_id: str
    clock: Clock
    report: Callable[[Reported_contra], None]
    deadline: float = math.inf
    abandon: Callable[[str], None] = lambda _: None
    rank: Rank = ORDINARY
    waits: Callable[[str], None] = lambda _: None
    run: str = ""
    fence: int = 0

    @property
    def key(self) -> str:
        """A text that no other execution has, e.g. for the header `Idempotency-Key`; a restart repeats the key.

        In real time it is unique; in simulated time it is unique for the robot, so that traces stay comparable.
        """
        return self.action_id if "/" in self.action_id or not self.run else f"{self.run}/{self.action_id}"

    def observe(self, observed: Delta) -> None:
        """Report observed facts immediately, before the outcome and without an event for the chart."""
        self.report(cast(Any, Outcome(OBSERVED, observed=observed)))

    def record(self, lines: Sequence[str]) -> None:
        """Report records of a run inside the skill, as lines of a trace file, for the trace of the caller."""
        self.report(cast(Any, Outcome(RECORDED, {"lines": [*lines]})))

    @property
    def remaining(self) -> float:
        """Seconds of run time until the deadline."""
        return self.deadline - self.clock.now()


class Status(Enum):
    """A component's report about an action that may have been running when the run was interrupted."""

    RUNNING = "running"
    UNKNOWN = "unknown"
    NOT_BEGUN = "not begun"


@dataclass(frozen=True, slots=True)
class Ended:
    """The component's report that an action has ended, with its outcome."""

    outcome: Outcome


MOST_WAITING = 5_000
"""Number of reports of one action that may wait for the sequencer.

A report needs about 750 bytes, and a run handles about 10,000 reports in a second.
"""
_MOST_PENDING = 250
"""Number of observed changes that are merged together; the duration of each merge grows with the size of the change."""


class Reports:
    """Queue of the intermediate events of one action.

    The queue posts reports in order; at most `MOST_WAITING` posted reports wait for the sequencer. Further reports are
    conflated: the queue keeps the newest report of each event, and merges all their observations into one change. So no
    observation is lost. The conflated reports are posted when the sequencer has handled half of the posted reports, or
    at the end.

    Args:
        post: receives a report, and the number of older reports of its event that the report replaces.
    """

    __slots__ = ("_aside", "_observed", "_post", "_waiting")

    def __init__(self, post: Callable[[Outcome, int], None]) -> None:
        self._post = post
        self._waiting = 0
        self._aside: dict[str, tuple[Mapping[str, Any], int]] = {}
        self._observed: list[Delta] = []

    def put(self, report: Outcome) -> None:
        """Post a report now, or conflate it while too many reports wait."""
        if self._waiting < MOST_WAITING and not self._aside:
            self._waiting += 1
            self._post(report, 0)
            return
        _, conflated = self._aside.pop(report.event, (None, -1))
        self._aside[report.event] = report.attributes, conflated + 1
        if report.observed:
            self._observed.append(report.observed)
            if len(self._observed) > _MOST_PENDING:
                self._observed = [_as_one(self._observed)]

    def taken(self) -> None:
        """Count one posted report as handled; if few reports wait, post the conflated reports."""
        self._waiting -= 1
        if self._aside and self._waiting <= MOST_WAITING // 2:
            self.flush()

    def flush(self) -> None:
        """Post the conflated reports; the first of them contains all their observations."""
        if not self._aside:
            return
        aside, self._aside = self._aside, {}
        observed, self._observed = _as_one(self._observed), []
        for event, (attributes, conflated) in aside.items():
            self._waiting += 1
            self._post(Outcome(event, attributes, observed), conflated)
            observed = Delta()


def _as_one(observed: list[Delta]) -> Delta:
    """Merge consecutive changes in order. The merge recurses on halves, as most changes are small."""
    if len(observed) < 2:
        return observed[0] if observed else Delta()
    half = len(observed) // 2
    return _as_one(observed[:half]).then(_as_one(observed[half:]))
