"""Jobs timed in turn, round by round, so that whatever else the machine does hits all of them."""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Job:
    """What is timed.

    Attributes:
        run: does it.
        timed: whether `run` returns its seconds, without what is paid once however often it runs.
        units: events (or whatever is counted) for each time.
        prepare: number of times -> what `run` gets; not timed.
    """

    run: Callable[[Any], Any]
    units: int = 1
    prepare: Callable[[int], Any] = int
    timed: bool = False

    def seconds(self, times: int) -> float:
        """How long that many times take."""
        prepared = self.prepare(times)
        start = time.perf_counter()
        seconds = self.run(prepared)
        return seconds if self.timed else time.perf_counter() - start

    def times(self, seconds: float) -> int:
        """How often it runs in about that many seconds; at least once."""
        times = 1
        while (taken := self.seconds(times)) < seconds / 4:
            times *= 2
        return max(1, round(times * seconds / taken))


@dataclass(frozen=True, slots=True)
class Pace:
    """How many rounds, and how many seconds each job gets in each."""

    rounds: int
    seconds: float


Figures = dict[str, list[float]]
"""Job -> seconds for one unit, one figure for each round."""


def measure(jobs: Mapping[str, Job], pace: Pace) -> Figures:
    """All jobs in every round; who begins changes from round to round."""
    times = {name: job.times(pace.seconds) for name, job in jobs.items()}
    figures: Figures = {name: [] for name in jobs}
    for number in range(pace.rounds):
        names = list(jobs)
        first = number % len(names)
        for name in names[first:] + names[:first]:
            gc.collect()  # nobody pays for what others left behind
            figures[name].append(jobs[name].seconds(times[name]) / times[name] / jobs[name].units)
    return figures


def ratio(figures: Figures, one: str, other: str) -> float:
    """How many times as long one takes as the other: the median of the rounds."""
    return statistics.median(a / b for a, b in zip(figures[one], figures[other], strict=True))
