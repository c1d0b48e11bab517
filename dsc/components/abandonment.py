"""Work that was cancelled stops within a bound, or is given up: it never holds up a run, nor the end of the process."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

GRACE = 30.0
"""Seconds of loop time for cancelled work to put things in order."""


def give_up_after(task: asyncio.Task[Any], seconds: float, say: Callable[[], None]) -> None:
    """If the task is not over in so many seconds of loop time, nobody waits for it any more, and `say` is called."""

    def overdue() -> None:
        give_up(task)
        say()

    handle = asyncio.get_running_loop().call_later(seconds, overdue)
    task.add_done_callback(lambda _: handle.cancel())


def give_up(task: asyncio.Task[Any]) -> None:
    """Let a task be: the loop does not wait for it when it closes.

    Asyncio waits for every task it knows of, for ever if one swallows its cancellation; the way out is the one its
    documentation names for those who extend it.
    """
    task._log_destroy_pending = False  # type: ignore[attr-defined]  # noqa: SLF001  # it is known to be pending
    asyncio.tasks._unregister_task(task)  # noqa: SLF001  # documented under "Extending"
