"""Outages: a failed plan waits until a failed device is back, with longer and longer pauses (S4.2)."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from dsc.calls import Clock
from dsc.components.life_cycle import Life
from dsc.events import SKILL_ERROR

if TYPE_CHECKING:
    from dsc.components.component import Component
    from dsc.engine.steps import Step
    from planning.execution.plan_records import PlanRecords
    from planning.execution.plan_run import PlanRun

FIRST_PAUSE = 1.0
"""Seconds of the first pause; each further pause is twice as long."""
LONGEST_PAUSE = 30.0
"""Maximum number of seconds of a pause."""
_MOST_ERRORS = 16
"""Number of the latest skill errors that may be reasons of failed plans."""


class Outages:
    """Waits for failed components before a failed plan continues, so that a short outage uses up no budget.

    Args:
        components: the components of the run by name.
        records: receives a record for each wait.
    """

    def __init__(self, components: Mapping[str, Component], records: PlanRecords) -> None:
        self._components = components
        self._records = records
        self._errors: deque[tuple[str, str]] = deque(maxlen=_MOST_ERRORS)  # reasons with their components

    def note(self, step: Step) -> None:
        """Store the skill errors of a macrostep."""
        for micro in step.microsteps:
            if micro.event is not None and micro.event.name == SKILL_ERROR:
                skill, reason = micro.event.attributes.get("skill", ""), micro.event.attributes.get("reason", "")
                self._errors.append((str(reason), str(skill).partition(".")[0]))

    def remember(self) -> list[list[str]]:
        """Return the skill errors as plain data."""
        return [list(error) for error in self._errors]

    def recall(self, memory: Iterable[Iterable[str]]) -> None:
        """Restore the skill errors that `remember` returned."""
        self._errors.clear()
        self._errors.extend((reason, component) for reason, component in memory)

    async def over(self, run: PlanRun, why: str, clock: Clock) -> bool:
        """Wait for the component whose skill error is the reason `why` of a failure; return whether there is one.

        The wait takes at most `seconds` of the plan's budget. A component in FatalError is started again after each
        pause. If a component that is alive fails repeatedly, each wait is a pause.
        """
        name = next((component for reason, component in reversed(self._errors) if reason == why), None)
        component = None if name is None else self._components.get(name)
        if component is None:
            return False
        pause = min(FIRST_PAUSE * 2 ** min(run.attempt.outages, 10) / 2, LONGEST_PAUSE, run.seconds)
        again = run.attempt.outages > 0
        if _is_failed(component):
            self._records.waits(run.name, component.name, run.seconds)
            await _restart(component, run.seconds, clock)
        elif again:
            self._records.waits(run.name, component.name, pause)
            await clock.sleep(pause)
        run.attempt.outages += 1  # last, as a crash repeats the wait
        return True


def _is_failed(component: Component) -> bool:
    """Return whether a component has failed and may come back; after a programming error, it does not."""
    return component.life.state is Life.FATAL_ERROR and component.life.bug is None


async def _restart(component: Component, seconds: float, clock: Clock) -> None:
    """Start a failed component after longer and longer pauses, until it is alive or `seconds` have passed."""
    end, pause = clock.now() + seconds, FIRST_PAUSE
    while _is_failed(component) and clock.now() < end:
        await clock.sleep(min(pause, end - clock.now()))
        if _is_failed(component):
            await component.life.come_alive()
        pause = min(2 * pause, LONGEST_PAUSE)
