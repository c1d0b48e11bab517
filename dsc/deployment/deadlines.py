"""Deadlines of real-time tasks: each core of each host, in each mode (S1.12)."""

from __future__ import annotations

from collections.abc import Iterator

from dsc.components.demands import TimedTask
from dsc.deployment.cores import Core, Verdict, cores_of, verdict_of
from dsc.deployment.model import Deployment
from dsc.deployment.schedulability import demand
from dsc.deployment.tasks import Task
from dsc.deployment.words import finding_at, in_mode, shown_time
from dsc.errors import Finding
from dsc.model.reading import FormPath
from knowledge_base.errors import InputError

SCHEDULE = "deployment-schedule"


def check_deadlines(deployment: Deployment) -> Iterator[Finding]:
    """Yield tasks without a core or with unclear priorities, and cores whose tasks may miss their deadlines."""
    wrong = list(check_tasks(deployment))
    yield from wrong
    for core in () if wrong else cores_of(deployment):
        try:
            verdict = verdict_of(core)
        except InputError as error:
            error.place = deployment.place(("hosts", core.host))
            yield Finding(error, SCHEDULE)
            continue
        of_core = verdict.overload is not None or core.utilisation > 1
        for task in verdict.late(core)[: 1 if of_core else None]:
            path = ("hosts", core.host) if of_core else _task_path(deployment, task)
            yield finding_at(deployment, path, _delay(core, task, verdict), SCHEDULE)


def check_tasks(deployment: Deployment) -> Iterator[Finding]:
    """Yield tasks on cores that their host does not have, and priorities of only some tasks on a core."""
    explicit: dict[tuple[str, int], bool] = {}
    for component, path, task in _all_tasks(deployment):
        host = deployment.host_of(component) or ""
        platform = deployment.platforms[deployment.hosts[host].platform]
        where = (*path, "core")
        if task.core >= platform.cores:
            message = f"host '{host}' has no core {task.core}; its last core is {platform.cores - 1}"
            yield finding_at(deployment, where, message, SCHEDULE)
        elif platform.scheduling == "fixed_priority":
            given = task.priority is not None
            if explicit.setdefault((host, task.core), given) != given:
                message = f"either all tasks on core {task.core} of host '{host}' have a priority, or none of them"
                yield finding_at(deployment, path, message, SCHEDULE)


def _all_tasks(deployment: Deployment) -> Iterator[tuple[str, FormPath, TimedTask]]:
    for component, placed in deployment.components.items():
        for path, needs in placed.demands(None):
            for name, task in needs.tasks.items():
                yield component, ("components", component, *path, "tasks", name), task


def _task_path(deployment: Deployment, task: Task) -> FormPath:
    """Return the path of the task `component.task` or `component.mode.task` in the model."""
    component, *mode, name = task.name.split(".")
    paths = (path for owner, path, _ in _all_tasks(deployment) if owner == component and path[-1] == name)
    return next((path for path in paths if not mode or mode[0] in path), ("components", component))


def _delay(core: Core, task: Task, verdict: Verdict) -> str:
    where = f"core {core.number} of host '{core.host}'{in_mode(core.mode)}"
    if core.utilisation > 1:
        shares = ", ".join(f"{one.name} {float(one.utilisation):.0%}" for one in core.tasks)
        return f"the tasks on {where} need {core.utilisation:.0%} of its time: {shares}"
    if verdict.overload is not None:
        time, work = verdict.overload.time, verdict.overload.work
        due = [one for one in core.tasks if one.deadline - one.jitter <= time]
        parts = ", ".join(f"{one.name} {shown_time(demand([one], time))}" for one in due)
        blocked = " with blocking" if any(one.blocking for one in due) else ""
        return (
            f"{shown_time(time)} after all tasks on {where} have arrived together, {shown_time(work)} of work are"
            f" due{blocked}: {parts}"
        )
    worst = verdict.responses[task.name] or 0
    urgent = [one.name for one in core.tasks if one is not task and one.priority >= task.priority]
    behind = f" behind {', '.join(urgent)}" if urgent else ""
    return (
        f"task '{task.name}' may end {shown_time(worst)} or more after its arrival{behind} on {where}, but its deadline"
        f" is {shown_time(task.deadline)}"
    )
