"""Skills that a crash interrupted: the component reports their status, and they resume in their own time."""

from __future__ import annotations

from contextlib import AbstractContextManager
from contextvars import ContextVar
from dataclasses import dataclass

from dsc.calls import Ended, Status
from dsc.components.component import Component
from dsc.engine.steps import Start
from dsc.errors import UncertainActionError
from dsc.sequencer.clock import LoopClock
from dsc.skills import SkillSignature


@dataclass(frozen=True, slots=True)
class InterruptedSkill:
    """The record of an action from before the restart.

    Attributes:
        began: second of run time at which it was started.
        reports: the number of its intermediate events that were taken.
    """

    began: float
    reports: int


class PastClock:
    """An action's clock after a restart: it begins at the start of the action, and passes the past without waiting.

    Each task of an action passes through the past on its own.

    Args:
        clock: run time.
        began: second of run time at which the action began.
    """

    def __init__(self, clock: LoopClock, began: float) -> None:
        self._clock = clock
        self._restart = clock.now()
        self._own: ContextVar[float] = ContextVar("own", default=began)

    def now(self) -> float:
        """Seconds of run time, as the action sees it."""
        own = self._own.get()
        return own if own < self._restart else self._clock.now()

    async def sleep(self, seconds: float) -> None:
        """Let `seconds` of the action's time pass."""
        due = self.now() + seconds
        self._own.set(due)
        await self._clock.sleep_until(due)

    def hold(self) -> AbstractContextManager[None]:
        """Simulated time stands still inside."""
        return self._clock.hold()


async def required_status(
    component: Component, signature: SkillSignature, start: Start, action_id: str
) -> Status | Ended:
    """Query the status of an interrupted action; unless it has ended, it is executed again with the same id.

    Raises:
        UncertainActionError: its status is unknown, and it must not happen twice.
    """
    status = await component.status(action_id, start.skill, start.arguments)
    if status is Status.UNKNOWN and signature.after_crash == "sense":
        raise UncertainActionError(f"the run was broken off, and whether {start.action_id} happened is not known")
    return status
