"""Real-time tasks of one processor core, in whole nanoseconds, so that no analysis rounds."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from math import lcm

NANOSECONDS = 1_000_000_000
"""Nanoseconds of a second."""


@dataclass(frozen=True, slots=True)
class Task:
    """A periodic or sporadic task; all times are whole nanoseconds.

    Attributes:
        name: the name in reports.
        period: the minimum time between two arrivals of jobs.
        worst_case: the longest execution time of a job.
        deadline: the time from a job's arrival until it must have ended; may be longer than the period.
        jitter: the longest time from an arrival until the job is ready.
        blocking: the longest time for which a job waits for tasks of lower priority, e.g. for their locks.
        priority: the priority with fixed priorities; a greater number is more urgent.
    """

    name: str
    period: int
    worst_case: int
    deadline: int
    jitter: int = 0
    blocking: int = 0
    priority: int = 0

    @property
    def utilisation(self) -> Fraction:
        """The share of the core that the task needs."""
        return Fraction(self.worst_case, self.period)


def utilisation(tasks: Iterable[Task]) -> Fraction:
    """Return the share of the core that all tasks need together."""
    return sum((task.utilisation for task in tasks), Fraction(0))


def hyperperiod(tasks: Iterable[Task]) -> int:
    """Return the least common multiple of the periods, after which the arrivals repeat."""
    return lcm(*(task.period for task in tasks))
