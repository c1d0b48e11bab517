"""Schedules: the preemptive execution of jobs on one core, for worst cases and random releases."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from random import Random
from typing import Literal, NamedTuple

from dsc.deployment.tasks import Task

MOST_EARLY = 1_000
"""Maximum number of jobs of a task that arrive before the worst case begins."""
Policy = Literal["fixed_priority", "earliest_deadline"]


@dataclass(frozen=True, slots=True)
class Job:
    """One execution of a task; all times are nanoseconds.

    Attributes:
        task: the task.
        arrival: the time from which its deadline counts.
        ready: the time from which it may run.
        work: its execution time.
    """

    task: Task
    arrival: int
    ready: int
    work: int

    @property
    def due(self) -> int:
        """The time at which it must have ended."""
        return self.arrival + self.task.deadline


class Slice(NamedTuple):
    """A time in which the core runs one job; `job` is `None` for the section that blocks all tasks."""

    job: Job | None
    begin: int
    end: int


@dataclass(frozen=True, slots=True)
class Schedule:
    """The execution of jobs.

    Attributes:
        slices: the times in which jobs run, in order.
        ends: the jobs that have ended, with their ends, in order.
        unended: the jobs that had not ended when the schedule was cut.
        until: the time at which the schedule was cut.
    """

    slices: tuple[Slice, ...]
    ends: tuple[tuple[Job, int], ...]
    unended: tuple[Job, ...]
    until: int

    @property
    def misses(self) -> list[Job]:
        """The jobs that ended after their deadline, or have not ended at it."""
        late = [job for job, end in self.ends if end > job.due]
        return [*late, *(job for job in self.unended if job.due < self.until)]

    def responses(self) -> dict[str, int]:
        """Return the longest time from arrival to end of each task's jobs, by name."""
        longest: dict[str, int] = {}
        for job, end in self.ends:
            longest[job.task.name] = max(longest.get(job.task.name, 0), end - job.arrival)
        return longest


def worst_jobs(tasks: Iterable[Task], until: int) -> Iterator[Job]:
    """Yield the jobs of the worst case: all tasks are ready together at 0, after their longest jitter.

    Of the jobs that arrived before 0, each task has the last `MOST_EARLY`.
    """
    for task in tasks:
        skipped = max(0, task.jitter // task.period - MOST_EARLY)
        for arrival in range(skipped * task.period - task.jitter, until, task.period):
            yield Job(task, arrival, max(0, arrival), task.worst_case)


def random_jobs(tasks: Iterable[Task], until: int, random: Random) -> Iterator[Job]:
    """Yield jobs with random offsets, jitter and execution times; half of them need their worst case."""
    for task in tasks:
        for arrival in range(random.randrange(task.period), until, task.period):
            work = random.choice((task.worst_case, random.randint(1, task.worst_case)))
            yield Job(task, arrival, arrival + random.randint(0, task.jitter), work)


def run_jobs(jobs: Iterable[Job], policy: Policy, until: int, blocked: int = 0) -> Schedule:
    """Return the schedule of jobs on one core: the most urgent job that is ready runs, and others wait.

    Args:
        jobs: the jobs.
        policy: which job is the most urgent one.
        until: the time at which the schedule is cut, in nanoseconds.
        blocked: length of a first section in which no job runs, as a less urgent task has a lock.
    """
    urgency = _URGENCY[policy]
    coming = sorted(jobs, key=lambda job: job.ready, reverse=True)
    ready: list[tuple[tuple[int, int, int], list[int], Job]] = []
    slices = [Slice(None, 0, blocked)] if blocked else []
    ends: list[tuple[Job, int]] = []
    now = blocked
    while (coming or ready) and now < until:
        while coming and coming[-1].ready <= now:
            job = coming.pop()
            heappush(ready, ((*urgency(job), len(coming)), [job.work], job))
        if not ready:
            now = coming[-1].ready
            continue
        _, left, job = ready[0]
        end = min(now + left[0], coming[-1].ready if coming else until, until)
        left[0] -= end - now
        slices.append(Slice(job, now, end))
        now = end
        if not left[0]:
            heappop(ready)
            ends.append((job, end))
    return Schedule(tuple(_without_gaps(slices)), tuple(ends), (*(job for _, _, job in ready), *coming), until)


_URGENCY: dict[Policy, Callable[[Job], tuple[int, int]]] = {
    "fixed_priority": lambda job: (-job.task.priority, job.arrival),
    "earliest_deadline": lambda job: (job.due, job.arrival),
}


def _without_gaps(slices: Sequence[Slice]) -> Iterator[Slice]:
    """Yield the slices; those of one job that follow each other without a gap are one."""
    before: Slice | None = None
    for one in slices:
        if before is not None and before.job is one.job and before.end == one.begin:
            before = Slice(one.job, before.begin, one.end)
        else:
            if before is not None:
                yield before
            before = one
    if before is not None:
        yield before
