"""How long a skill may take: it is cancelled then, and given up if it goes on nevertheless."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Any

from dsc.components.stopping import GRACE, give_up
from dsc.sequencer.clock import LoopClock


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
