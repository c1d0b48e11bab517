"""Skills that were under way when a run was broken off: asked after, and gone on with as if nothing had been."""

from __future__ import annotations

from contextlib import AbstractContextManager
from contextvars import ContextVar
from dataclasses import dataclass

from dsc.calls import Ended, Status
from dsc.components.component import Component
from dsc.engine.steps import Start
from dsc.errors import UncertainActionError
from dsc.sequencer.clock import LoopClock


@dataclass(frozen=True, slots=True)
class InterruptedSkill:
    """What is known of an action from before the restart.

    Attributes:
        began: second of run time at which it was started.
        reports: how many intermediate events of it have been taken.
    """

    began: float
    reports: int


class PastClock:
    """An action's own time after a restart: it begins when the action did, and what is past is not waited for.

    What an action does side by side, in tasks, passes through the past side by side, too.

    Args:
        clock: the run's.
        began: when the action began.
    """

    def __init__(self, clock: LoopClock, began: float) -> None:
        self._clock = clock
        self._restart = clock.now()
        self._own: ContextVar[float] = ContextVar("own", default=began)

    def now(self) -> float:
        """Seconds of run time as the action lives it."""
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


async def asked_after(component: Component, start: Start, action_id: str) -> Status | Ended:
    """What became of the action; unless it has ended, it is to be executed, with the same id.

    Raises:
        UncertainActionError: it may have happened, nobody knows, and it must not happen twice.
    """
    status = await component.status(action_id, start.skill, start.arguments)
    signature = component.skills().get(start.skill)
    if status is Status.UNKNOWN and signature is not None and signature.after_crash == "sense":
        raise UncertainActionError(f"the run was broken off, and whether {start.action_id} happened is not known")
    return status
