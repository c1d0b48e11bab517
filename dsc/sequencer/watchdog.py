"""Watchdog: names code of users that blocks the event loop, and with it the whole robot."""

from __future__ import annotations

import asyncio
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import CodeType, FrameType
from typing import Any, NamedTuple

from dsc.run_log import run_logger
from knowledge_base.tracebacks import is_users_code

_LOG = run_logger(__package__)
BLOCKED = 1.0
"""Real seconds after which the loop counts as blocked; the next warnings follow after ten times, hundred times ..."""
NameOf = Callable[[asyncio.Task[Any]], str | None]
"""Function that returns the skill whose execution is a task, or `None`."""
_PERIOD = 0.25
"""Part of `BLOCKED` between two looks at the loop."""


@contextmanager
def watched(name_of: NameOf, run: CodeType) -> Iterator[None]:
    """Return a context manager in which a watchdog looks at the running loop; the runs of a loop share one watchdog.

    Args:
        name_of: returns the skill whose execution is a task, or `None`; called from the watchdog's thread.
        run: the code that executes a run; its callers only wait for the run.
    """
    loop = asyncio.get_running_loop()
    watchdog = _watchdogs.get(loop)
    if watchdog is None:
        watchdog = _watchdogs[loop] = Watchdog(loop, run)
        watchdog.start()
    watchdog.names_of.append(name_of)
    try:
        yield
    finally:
        watchdog.names_of.remove(name_of)
        if not watchdog.names_of:
            del _watchdogs[loop]
            watchdog.end()


class Watchdog:
    """A thread that warns if one call in the thread of an event loop does not return.

    The thread looks at the loop's present task. If there is one, the thread asks the loop for a call, and warns if the
    call is late. So an idle loop is not disturbed, and simulated time is not affected. Each place is reported one time,
    and at the end with the number of its blocks.

    Args:
        loop: the running loop.
        run: see `watched`.

    Attributes:
        names_of: the functions that return the skill of a task.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, run: CodeType) -> None:
        self.names_of: list[NameOf] = []
        self._outermost = {asyncio.Handle._run.__code__, run}  # noqa: SLF001  # every call of a loop passes the former
        self._loop = loop
        self._watched = threading.get_ident()
        self._over = threading.Event()
        self._blocks: dict[str, _Blocks] = {}
        self._thread = threading.Thread(target=self._watch, name="watchdog", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def end(self) -> None:
        """End the thread, and report the places that have blocked the loop several times."""
        self._over.set()
        self._thread.join()
        for place, blocks in self._blocks.items():
            if blocks.number > 1:
                _LOG.warning("%s has blocked the event loop %d times, %.1f s in all", place, *blocks)

    def _watch(self) -> None:
        while not self._over.wait(_PERIOD * BLOCKED):
            if asyncio.current_task(self._loop) is not None and not self._ask():
                return

    def _ask(self) -> bool:
        """Ask the loop for a call, and warn until the call is made; return whether the loop still runs."""
        answered, place = threading.Event(), None
        began, limit = time.monotonic(), BLOCKED
        try:
            self._loop.call_soon_threadsafe(answered.set)
        except RuntimeError:  # the loop is closed
            return False
        while not answered.wait(_PERIOD * BLOCKED) and not self._over.is_set():
            if time.monotonic() - began >= limit:
                place = self._warn(limit) or place
                limit *= 10
        if place is not None:
            number, seconds = self._blocks.get(place, _Blocks(0, 0.0))
            self._blocks[place] = _Blocks(number + 1, seconds + time.monotonic() - began)
        return True

    def _warn(self, seconds: float) -> str | None:
        """Log the skill and line that block the loop unless their place is known; return this place as text."""
        task = asyncio.current_task(self._loop)
        frames = list(self._frames())
        if task is None or not frames:
            return None
        of_user = next((one for one in frames if is_users_code(one.f_code.co_filename)), None)
        frame = of_user or frames[0]
        who = next(filter(None, (name_of(task) for name_of in tuple(self.names_of))), None)
        named = f"skill '{who}'" if who else "a hook or listener" if of_user else "the executive"
        place = f"{named} in {frame.f_code.co_name} ({frame.f_code.co_filename})"
        if place not in self._blocks or seconds > BLOCKED:
            remedy = "; declare it `blocking`, or await in it" if who and of_user else ""
            at = f"{frame.f_code.co_filename}:{frame.f_lineno}"
            _LOG.warning("%s blocks the event loop for %g s at %s%s", named, seconds, at, remedy)
        return place

    def _frames(self) -> Iterator[FrameType]:
        """Yield the frames of the call that the loop executes, from the innermost, without the callers of the run."""
        frame = sys._current_frames().get(self._watched)  # noqa: SLF001  # documented for debuggers
        while frame is not None and frame.f_code not in self._outermost:
            yield frame
            frame = frame.f_back


class _Blocks(NamedTuple):
    """The number of the blocks of one place, and their duration in seconds."""

    number: int
    seconds: float


_watchdogs: dict[asyncio.AbstractEventLoop, Watchdog] = {}
