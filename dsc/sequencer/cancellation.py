"""Cancelled skills: their clean-up, and the time limit that cancels them."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterable
from typing import Any

from dsc.components.hooks import GRACE, give_up, give_up_after
from dsc.sequencer.clock import LoopClock


class PendingCleanups:
    """Cancelled tasks until they have stopped; a task that ignores its cancellation is abandoned after `GRACE` seconds.

    Args:
        say: receives the component of a task that has stopped, or was abandoned.

    Attributes:
        pending: components with cancelled tasks that have not stopped.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self.pending: dict[str, dict[asyncio.Task[None], asyncio.Future[None]]] = {}

    def add(self, component: str, task: asyncio.Task[None], say: Callable[[], None]) -> None:
        """Bound a cancelled task of a component; call `say` if it is abandoned."""
        over: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        of_component = self.pending.setdefault(component, {})
        of_component[task] = over

        def end(_: asyncio.Task[None]) -> None:
            if of_component.pop(task, None) is not None:
                if not of_component:
                    del self.pending[component]
                over.set_result(None)
                self._say(component)

        def abandon() -> None:
            end(task)
            say()

        task.add_done_callback(end)
        give_up_after(task, GRACE, abandon)

    async def over(self, component: str) -> None:
        """Wait until no cancelled task of the component is left."""
        while ending := self.pending.get(component):
            await asyncio.wait(ending.values())

    def tasks(self) -> Iterable[asyncio.Task[None]]:
        """The tasks that have not stopped."""
        return [task for of_component in self.pending.values() for task in of_component]


class TimeLimit:
    """Cancels a task at a second of run time, and abandons it if it ignores that: one timer for both.

    Args:
        task: to be bounded.
        say: called when the task is abandoned: it continued for `GRACE` seconds after its cancellation, or it has
            ended and left its limit standing.
        clock: tells the time.
        due: second of run time at which the task is cancelled; `math.inf` means never.
    """

    def __init__(self, task: asyncio.Task[Any], say: Callable[[], None], clock: LoopClock, due: float) -> None:
        self._expired = False
        self._task = task
        self._say = say
        self._clock = clock
        self._due = due
        self._timer = clock.call_at(due, self._expire) if math.isfinite(due) else None

    @property
    def passed(self) -> bool:
        """Whether the time is over, maybe unnoticed as the task kept its loop from turning (never if simulated)."""
        return self._expired or (not self._clock.simulated and self._clock.now() > self._due)

    def end(self) -> None:
        """The task has ended, or another owner bounds it."""
        if self._timer is not None:
            self._timer.cancel()

    def has_cancelled(self) -> bool:
        """Whether the limit alone has cancelled the task; the task itself asks, one time."""
        return self._expired and self._task.uncancel() <= 0

    def _expire(self) -> None:
        self._expired = True
        if self._task.done():
            self._say()
            return
        self._task.cancel()
        self._timer = asyncio.get_running_loop().call_later(GRACE, self._overdue)

    def _overdue(self) -> None:
        give_up(self._task)
        self._say()
