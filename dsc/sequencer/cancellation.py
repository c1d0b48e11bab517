"""Cancelled skills: their clean-up, and the time limit that cancels them."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterable
from typing import Any

from dsc.components.abandonment import GRACE, give_up, give_up_after
from dsc.sequencer.clock import LoopClock


class PendingCleanups:
    """What was cancelled, until it has stopped or was given up after `GRACE` seconds: nobody waits for longer.

    Args:
        say: is told the component of which something has stopped, or was given up.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._ending: dict[str, dict[asyncio.Task[None], asyncio.Future[None]]] = {}

    def add(self, component: str, task: asyncio.Task[None], say: Callable[[], None]) -> None:
        """Bound a task of a component that was just cancelled; `say` is called if it is given up."""
        over: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        of_component = self._ending.setdefault(component, {})
        of_component[task] = over

        def end(_: asyncio.Task[None]) -> None:
            if of_component.pop(task, None) is not None:
                over.set_result(None)
                self._say(component)

        def give_up() -> None:
            end(task)
            say()

        task.add_done_callback(end)
        give_up_after(task, GRACE, give_up)

    def components(self) -> Iterable[str]:
        """Those of which something is still ending."""
        return [component for component, ending in self._ending.items() if ending]

    def of(self, component: str) -> bool:
        """Whether anything of the component is still ending."""
        return bool(self._ending.get(component))

    async def over(self, component: str) -> None:
        """Wait until nothing of the component is ending any more."""
        while ending := self._ending.get(component):
            await asyncio.wait(ending.values())

    def tasks(self) -> Iterable[asyncio.Task[None]]:
        """What is to be waited for at the end."""
        return [task for of_component in self._ending.values() for task in of_component]


class TimeLimit:
    """Bounds a task; `asyncio.timeout` and a bound for who swallows it, with one timer for both.

    Args:
        say: called when nobody waits for the task any more: it went on for `GRACE` seconds after it was cancelled, or
            has ended and left its limit standing.
        clock: tells the time.
        due: second of run time at which the task is cancelled, unless it is `math.inf`.
    """

    def __init__(self, say: Callable[[], None], clock: LoopClock, due: float) -> None:
        self._expired = False
        self._say = say
        self._clock = clock
        self._due = due
        self._timer: asyncio.TimerHandle | None = None
        self._task: asyncio.Task[Any] | None = None

    @property
    def passed(self) -> bool:
        """Whether the time is over, maybe unnoticed as the task kept its loop from turning (never if simulated)."""
        return self._expired or (self._clock.now() > self._due and not self._clock.simulated)

    def begin(self, task: asyncio.Task[Any]) -> None:
        """Cancel the task when it is due."""
        self._task = task
        if math.isfinite(self._due):
            self._timer = self._clock.call_at(self._due, self._expire)

    def end(self) -> None:
        """The task is over, or somebody else sees to its end."""
        if self._timer is not None:
            self._timer.cancel()

    def has_cancelled(self) -> bool:
        """Whether the limit has cancelled the task, and nobody else has; the task itself asks, once."""
        assert self._task is not None  # noqa: S101
        return self._expired and self._task.uncancel() <= 0

    def _expire(self) -> None:
        assert self._task is not None  # noqa: S101
        self._expired = True
        if self._task.done():
            self._say()
            return
        self._task.cancel()
        self._timer = asyncio.get_running_loop().call_later(GRACE, self._overdue)

    def _overdue(self) -> None:
        assert self._task is not None  # noqa: S101
        give_up(self._task)
        self._say()
