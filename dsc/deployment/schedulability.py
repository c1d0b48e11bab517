"""Schedulability of the tasks of one core: utilisation bound, response times, and the demand test (S1.12).

Fixed priorities: Liu and Layland (1973) for the bound; Audsley et al. (1993) and Tindell, Burns and Wellings (1994) for
response times with jitter, blocking, and deadlines beyond the period. Earliest deadline first: the processor demand of
Baruah, Rosier and Howell (1990), with jitter and blocking. Without blocking, and for fixed priorities also without
equal priorities, both tests are exact for tasks that may arrive at any time; otherwise they are sufficient.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from heapq import merge
from itertools import count, pairwise, repeat

from dsc.deployment.tasks import Task, hyperperiod, utilisation
from knowledge_base.errors import InputError

MOST_POINTS = 50_000
"""Maximum number of steps of one test: iterations of response times, or deadlines."""


@dataclass(frozen=True, slots=True)
class Demand:
    """The work that is due at a time after all tasks have arrived together, both in nanoseconds."""

    time: int
    work: int


def utilisation_bound(number: int) -> float:
    """Return the utilisation up to which `number` tasks with rate-monotonic priorities meet all deadlines."""
    return float(number * (2 ** (1 / number) - 1)) if number else 1.0


def within_bound(tasks: Sequence[Task]) -> bool:
    """Return whether the utilisation bound alone shows that all deadlines are met.

    The bound holds for rate-monotonic priorities, without jitter and blocking, and with deadlines not below the period.
    """
    by_priority = sorted(tasks, key=lambda task: -task.priority)
    return (
        all(not task.jitter and not task.blocking and task.deadline >= task.period for task in tasks)
        and all(one.period <= next_.period for one, next_ in pairwise(by_priority))
        and utilisation(tasks) <= utilisation_bound(len(tasks))
    )


def response_time(task: Task, others: Sequence[Task]) -> int | None:
    """Return the worst response time of a task with fixed priorities, in nanoseconds; `None` if there is no bound.

    The search ends at the first response above the deadline, which is then the result.

    Args:
        task: the task.
        others: the other tasks of its core; those of equal priority count as more urgent.

    Raises:
        InputError: the test needs more than `MOST_POINTS` steps.
    """
    urgent = [other for other in others if other.priority >= task.priority]
    if utilisation([task, *urgent]) > 1:
        return None
    repeats = hyperperiod([task, *urgent])
    worst, number = 0, 0
    steps = repeat(None, MOST_POINTS)
    while True:
        done = _end_of_job(task, urgent, number, steps)
        worst = max(worst, task.jitter + done - number * task.period)
        next_arrival = (number + 1) * task.period - task.jitter
        if worst > task.deadline or done <= next_arrival or number * task.period > repeats:
            return worst
        number += 1


def _end_of_job(task: Task, urgent: Sequence[Task], number: int, steps: Iterator[None]) -> int:
    """Return the end of the job with a number in the busy period, or the first time at which it misses its deadline."""
    own = task.blocking + (number + 1) * task.worst_case
    latest = task.deadline + number * task.period - task.jitter
    end = own
    for _ in steps:
        following = own + _interference(urgent, end)
        if following == end or end > latest:
            return end
        end = following
    raise _no_decision(f"the response time of task '{task.name}'")


def _interference(urgent: Sequence[Task], time: int) -> int:
    """Return the work of more urgent jobs that are ready before `time` after a common release."""
    return sum(-(-(task.jitter + time) // task.period) * task.worst_case for task in urgent)


def overload(tasks: Sequence[Task]) -> Demand | None:
    """Return the first time at which more work is due than can be done with earliest deadline first; else `None`.

    Raises:
        InputError: more than `MOST_POINTS` deadlines lie before the end of the test.
    """
    longest = max((task.blocking for task in tasks), default=0)
    deadlines = merge(*map(_deadlines, tasks))
    if not tasks:
        return None
    end = _end_of_test(tasks, longest)
    for number, time in zip(range(MOST_POINTS), deadlines, strict=False):
        if end is not None and time > end:
            return None
        work = demand(tasks, time) + max(task.blocking for task in tasks if task.deadline - task.jitter <= time)
        if work > time:
            return Demand(time, work)
        if number == MOST_POINTS - 1:
            break
    raise _no_decision("the demand test")


def demand(tasks: Sequence[Task], time: int) -> int:
    """Return the work of jobs that arrive and are due within `time` nanoseconds after a common release."""
    jobs = ((task, (time + task.jitter - task.deadline) // task.period + 1) for task in tasks)
    return sum(max(0, number) * task.worst_case for task, number in jobs)


def _deadlines(task: Task) -> Iterator[int]:
    """Yield the times, after a common release, at which jobs of a task are due."""
    return (number * task.period + task.deadline - task.jitter for number in count())


def _end_of_test(tasks: Sequence[Task], blocking: int) -> int | None:
    """Return the time after which no overload can begin; `None` if the tasks need more than the core."""
    share = utilisation(tasks)
    if share > 1:
        return None
    last = hyperperiod(tasks) + max(task.deadline for task in tasks)
    if share == 1:
        return last
    late = sum(max(0, task.period + task.jitter - task.deadline) * task.utilisation for task in tasks)
    return min(last, int((late + blocking) / (1 - share))) if not blocking else int((late + blocking) / (1 - share))


def _no_decision(what: str) -> InputError:
    return InputError(
        f"{what} needs more than {MOST_POINTS} steps, so that the test does not end; choose periods with a smaller"
        " common multiple, or a lower utilisation"
    )
