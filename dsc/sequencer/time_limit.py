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
        say: called when nobody waits for the task any more, as it went on for `GRACE` seconds after it was cancelled.

    Attributes:
        expired: whether the time is over.
    """

    def __init__(self, say: Callable[[], None]) -> None:
        self.expired = False
        self._say = say
        self._timer: asyncio.TimerHandle | None = None
        self._task: asyncio.Task[Any] | None = None

    def begin(self, task: asyncio.Task[Any], clock: LoopClock, due: float) -> None:
        """Cancel the task at that second of run time, unless it is `math.inf`."""
        self._task = task
        if math.isfinite(due):
            self._timer = clock.call_at(due, self._expire)

    def end(self) -> None:
        """The task is over, or somebody else sees to its end."""
        if self._timer is not None:
            self._timer.cancel()

    def has_cancelled(self) -> bool:
        """Whether the limit has cancelled the task, and nobody else has; the task itself asks, once."""
        assert self._task is not None  # noqa: S101
        return self.expired and self._task.uncancel() <= 0

    def _expire(self) -> None:
        assert self._task is not None  # noqa: S101
        self.expired = True
        self._task.cancel()
        self._timer = asyncio.get_running_loop().call_later(GRACE, self._overdue)

    def _overdue(self) -> None:
        assert self._task is not None  # noqa: S101
        give_up(self._task)
        self._say()
