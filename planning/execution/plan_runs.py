"""All plans that have a plot and have not ended, with the attempts at their goals."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Any

from knowledge_base.errors import UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from planning.problem.derived import Settled

from planning.execution.attempt import Attempt
from planning.execution.plan_run import PlanRun

MOST_UNMONITORED = 64
"""The maximum number of unmonitored plans that are kept. The chart may abandon a plan without a message."""
MOST_ATTEMPTS = 64
"""The maximum number of goals whose interrupted attempts are kept; the oldest are dropped."""


class PlanRuns:
    """The plans that have a plot and have not ended, by name."""

    def __init__(self) -> None:
        self._runs: dict[str, PlanRun] = {}
        self._attempts: dict[str, Attempt] = {}
        self._named = 0

    def interrupted(self, task: str) -> Attempt | None:
        """Return the attempt at a task that has neither reached nor abandoned its goal."""
        return self._attempts.get(task)

    def attempt(self, task: str, unmet: int | None) -> Attempt:
        """Begin and return a new attempt at a task, whose goal has `unmet` false parts after an interruption."""
        self._attempts.pop(task, None)
        while len(self._attempts) >= MOST_ATTEMPTS:
            del self._attempts[next(iter(self._attempts))]
        attempt = self._attempts[task] = Attempt(unmet)
        return attempt

    def conclude_monitored(self, ended: Collection[int]) -> None:
        """End the attempts at the tasks whose monitoring activations have ended."""
        for run in self._runs.values():
            if run.monitored_for in ended:
                self.conclude(run.task)

    def conclude(self, task: str) -> None:
        """End the attempt at a task, since its goal is reached or abandoned."""
        self._attempts.pop(task, None)

    def new_name(self) -> str:
        """Return a name that no earlier plan of the program run has."""
        self._named += 1
        return f"plan_{self._named}"

    def get(self, name: str) -> PlanRun | None:
        """Return the plan of that name, or `None`."""
        return self._runs.get(name)

    def monitored(self) -> list[PlanRun]:
        """Return the plans whose steps are executed."""
        return [one for one in self._runs.values() if one.on_begin is not None]

    def carrying(self, name: str) -> list[PlanRun]:
        """Return the plans in which running steps of the plan of that name may continue, the latest last."""
        return [one for one in self._runs.values() if one.carries(name)]

    def required(self, name: str) -> PlanRun:
        """Return the plan of that name; raise `UnknownNameError` if there is no such plan."""
        if name not in self._runs:
            raise UnknownNameError(f"there is no plan '{name}'", found=name, valid=self._runs)
        return self._runs[name]

    def add(self, run: PlanRun) -> None:
        """Add a plan, and delete the oldest plans without a monitor beyond `MOST_UNMONITORED`."""
        unmonitored = [name for name, one in self._runs.items() if one.on_begin is None]
        for name in unmonitored[:-MOST_UNMONITORED]:
            del self._runs[name]
        self._runs[run.name] = run

    def over(self, name: str) -> None:
        """Delete a plan, the plan that it replaces, and a successor that has not begun."""
        run = self._runs.pop(name, None)
        if run is not None and run.replaces is not None:
            self.over(run.replaces)
        self.withdraw(name)

    def withdraw(self, name: str) -> None:
        """Delete a successor of the plan that has not begun, because the chart did not use the successor."""
        for successor in [one.name for one in self._runs.values() if one.replaces == name]:
            del self._runs[successor]

    def begin(self, run: PlanRun) -> None:
        """Begin the monitoring of a plan; this deletes the plan that it replaces."""
        replaced, run.replaces = run.replaces, None
        if replaced is not None:
            self.over(replaced)

    def remember(self) -> dict[str, Any]:
        """Return all plans as plain data, with their attempts: regions may attempt equal goals at the same time."""
        runs = self._runs.values()
        attempts = list({id(one): one for one in (*self._attempts.values(), *(run.attempt for run in runs))}.values())
        numbers = {id(attempt): number for number, attempt in enumerate(attempts)}
        return {
            "plans": self._named,
            "attempts": [attempt.to_json() for attempt in attempts],
            "tasks": {task: numbers[id(attempt)] for task, attempt in self._attempts.items()},
            "runs": [{**run.to_json(), "attempt": numbers[id(run.attempt)]} for run in runs],
        }

    def recall(self, memory: Mapping[str, Any], now: Settled) -> None:
        """Restore the plans that `remember` returned, with conditions expanded for the present world."""
        self._named = memory["plans"]
        attempts = [Attempt.from_json(form) for form in memory["attempts"]]
        self._attempts = {task: attempts[number] for task, number in memory["tasks"].items()}
        self._runs = {form["name"]: PlanRun.from_json(form, now, attempts[form["attempt"]]) for form in memory["runs"]}
