"""Cores: the tasks on each processor core of a deployment, and whether they meet their deadlines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from dsc.components.demands import TimedTask
from dsc.deployment.model import Deployment
from dsc.deployment.schedulability import Demand, overload, response_time, utilisation_bound, within_bound
from dsc.deployment.schedule import Policy, Schedule, run_jobs, worst_jobs
from dsc.deployment.tasks import NANOSECONDS, Task, hyperperiod, utilisation

LONGEST_TIMELINE = 60 * NANOSECONDS
"""Maximum length of the schedule of a worst case."""
MOST_JOBS = 2_000
"""Maximum number of jobs in the schedule of a worst case."""


@dataclass(frozen=True, slots=True)
class Core:
    """A processor core in one mode of the robot, with its tasks, the most urgent one first."""

    host: str
    number: int
    mode: str
    policy: Policy
    tasks: tuple[Task, ...]

    @property
    def utilisation(self) -> float:
        """The share of the core that its tasks need."""
        return float(utilisation(self.tasks))

    @property
    def bound(self) -> float:
        """The utilisation up to which each such number of tasks meets its deadlines."""
        return utilisation_bound(len(self.tasks)) if self.policy == "fixed_priority" else 1.0

    def worst_schedule(self) -> Schedule:
        """Return the schedule after a common release of all tasks, for two hyperperiods or less."""
        until = min(2 * hyperperiod(self.tasks), LONGEST_TIMELINE, MOST_JOBS * min(one.period for one in self.tasks))
        return run_jobs(worst_jobs(self.tasks, until), self.policy, until)


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether the tasks of a core meet their deadlines.

    Attributes:
        responses: with fixed priorities, the worst response time of each task in nanoseconds; `None` without a bound.
        overload: with earliest deadline first, the first time at which more work is due than the core can do.
        within_bound: whether the utilisation bound alone proves that all deadlines are met.
    """

    responses: Mapping[str, int | None]
    overload: Demand | None
    within_bound: bool

    def late(self, core: Core) -> list[Task]:
        """Return the tasks that may miss their deadline; with earliest deadline first, all tasks or none."""
        if core.policy == "earliest_deadline":
            return [] if self.overload is None else list(core.tasks)
        return [one for one in core.tasks if (worst := self.responses[one.name]) is None or worst > one.deadline]


def verdict_of(core: Core) -> Verdict:
    """Return whether the tasks of a core meet their deadlines; errors as for `response_time` and `overload`."""
    if core.policy == "earliest_deadline":
        found = overload(core.tasks)
        return Verdict({}, found, found is None and all(one.deadline >= one.period for one in core.tasks))
    responses = {one.name: response_time(one, [it for it in core.tasks if it is not one]) for one in core.tasks}
    return Verdict(responses, None, within_bound(core.tasks))


def cores_of(deployment: Deployment) -> Iterator[Core]:
    """Yield each core with tasks, in each mode of the robot in which its tasks differ."""
    seen: set[tuple[str, int, tuple[Task, ...]]] = set()
    for mode, active in deployment.active().items():
        for host, found in deployment.hosts.items():
            platform = deployment.platforms[found.platform]
            placed = _tasks_on(deployment, host, active)
            for number in range(platform.cores):
                tasks = tuple(_with_priorities({name: one for name, one in placed.items() if one.core == number}))
                if tasks and (host, number, tasks) not in seen:
                    seen.add((host, number, tasks))
                    yield Core(host, number, mode, platform.scheduling, tasks)


def _tasks_on(deployment: Deployment, host: str, active: Mapping[str, str | None]) -> dict[str, TimedTask]:
    """Return the tasks on a host as `component.task`; equal names of several modes as `component.mode.task`."""
    found: dict[str, TimedTask] = {}
    for component, path, demand in deployment.demands_on(host, active):
        for name, task in demand.tasks.items():
            is_further = f"{component}.{name}" in found and active[component] is None
            found[f"{component}.{path[-1]}.{name}" if is_further else f"{component}.{name}"] = task
    return found


def _with_priorities(tasks: dict[str, TimedTask]) -> list[Task]:
    """Return tasks with priorities, in nanoseconds; without priorities, those of shorter deadlines are more urgent."""
    by_urgency = sorted(tasks, key=lambda name: tasks[name].due)  # the earlier one of two with equal deadlines
    ranks = {name: -place for place, name in enumerate(by_urgency)}
    made = [
        _in_nanoseconds(name, one, ranks[name] if one.priority is None else one.priority) for name, one in tasks.items()
    ]
    return sorted(made, key=lambda one: -one.priority)


def _in_nanoseconds(name: str, task: TimedTask, priority: int) -> Task:
    times = (task.period, task.worst_case, task.due, task.jitter, task.blocking)
    period, worst_case, deadline, jitter, blocking = (round(time * NANOSECONDS) for time in times)
    return Task(name, period, worst_case, deadline, jitter, blocking, priority)
