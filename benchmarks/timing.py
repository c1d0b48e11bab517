"""Jobs timed in turn, round by round, so that other load of the machine affects all of them."""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Job:
    """A timed job.

    Attributes:
        run: runs the job.
        timed: whether `run` returns its seconds, without costs that do not depend on the number of times.
        units: events, or other units, for each time.
        prepare: number of times -> the argument of `run`; not timed.
    """

    run: Callable[[Any], Any]
    units: int = 1
    prepare: Callable[[int], Any] = int
    timed: bool = False

    def seconds(self, times: int) -> float:
        """Return the seconds of that many times."""
        prepared = self.prepare(times)
        start = time.perf_counter()
        seconds = self.run(prepared)
        return seconds if self.timed else time.perf_counter() - start

    def times(self, seconds: float) -> int:
        """Return the number of times that take about that many seconds; at least one."""
        times = 1
        while (taken := self.seconds(times)) < seconds / 4:
            times *= 2
        return max(1, round(times * seconds / taken))


@dataclass(frozen=True, slots=True)
class Pace:
    """Number of rounds, and seconds of each job in a round."""

    rounds: int
    seconds: float


Figures = dict[str, list[float]]
"""Job -> seconds for one unit, one figure for each round."""


def measure(jobs: Mapping[str, Job], pace: Pace) -> Figures:
    """Return the figures of all jobs in every round; each round begins with another job."""
    times = {name: job.times(pace.seconds) for name, job in jobs.items()}
    figures: Figures = {name: [] for name in jobs}
    for number in range(pace.rounds):
        names = list(jobs)
        first = number % len(names)
        for name in names[first:] + names[:first]:
            gc.collect()  # so that no job pays for another's garbage
            figures[name].append(jobs[name].seconds(times[name]) / times[name] / jobs[name].units)
    return figures


def ratio(figures: Figures, one: str, other: str) -> float:
    """Return the ratio of the times of two jobs: the median of the rounds."""
    return statistics.median(a / b for a, b in zip(figures[one], figures[other], strict=True))
