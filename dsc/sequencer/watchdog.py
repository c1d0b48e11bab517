"""Watchdog: names code of users that blocks the event loop, and with it the whole robot."""

from __future__ import annotations

import asyncio
import logging
import sys
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import Any, Self

from knowledge_base.tracebacks import is_users_code

_LOG = logging.getLogger(__package__)
BLOCKED = 1.0
"""Real seconds after which the loop counts as blocked; the next warnings follow after ten times, hundred times ..."""
_PERIOD = 0.25
"""Part of `BLOCKED` between two looks at the loop."""


class Watchdog:
    """Context manager with a thread that warns if one call in the loop's own thread does not return.

    The thread looks at the loop's present task. If there is one, the thread asks the loop for a call, and warns if the
    call is late. So an idle loop is not disturbed, and simulated time is not affected.

    Args:
        name_of: returns the skill whose execution is this task, or `None`; called from the thread.
    """

    def __init__(self, name_of: Callable[[asyncio.Task[Any]], str | None]) -> None:
        self._name_of = name_of
        self._loop = asyncio.get_running_loop()
        self._watched = threading.get_ident()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="watchdog", daemon=True)

    def __enter__(self) -> Self:
        """Start the thread."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """End the thread."""
        self._over.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._over.wait(_PERIOD * BLOCKED):
            if asyncio.current_task(self._loop) is not None and not self._ask():
                return

    def _ask(self) -> bool:
        """Ask the loop for a call, and warn until the call is made; return whether the loop still runs."""
        answered = threading.Event()
        began, limit = time.monotonic(), BLOCKED
        try:
            self._loop.call_soon_threadsafe(answered.set)
        except RuntimeError:  # the loop is closed
            return False
        while not answered.wait(_PERIOD * BLOCKED) and not self._over.is_set():
            if time.monotonic() - began >= limit:
                self._warn(limit)
                limit *= 10
        return True

    def _warn(self, seconds: float) -> None:
        task = asyncio.current_task(self._loop)
        frame = _innermost_of_user(sys._current_frames().get(self._watched))  # noqa: SLF001  # documented for debuggers
        if task is None or frame is None:
            return
        who = self._name_of(task)
        named = f"skill '{who}'" if who else "a hook or listener"
        place = f"{frame.f_code.co_filename}:{frame.f_lineno}"
        remedy = "; declare it `blocking`, or await in it" if who else ""
        _LOG.warning("%s blocks the event loop for %g s at %s%s", named, seconds, place, remedy)


def _innermost_of_user(frame: FrameType | None) -> FrameType | None:
    while frame is not None and not is_users_code(frame.f_code.co_filename):
        frame = frame.f_back
    return frame
