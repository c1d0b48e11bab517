"""Waiting for a planner so long and no longer, whatever it does; in real time, whatever the clock of the run says."""

from __future__ import annotations

import asyncio
import contextlib
import math
import threading
from typing import TYPE_CHECKING, Any, TypeVar

from dsc.components.hooks import contained

if TYPE_CHECKING:
    from collections.abc import Awaitable

STOPPING = 10.0
"""Seconds in which a planner that was told to stop has to; ending an engine's processes takes less than one."""

_Result = TypeVar("_Result")


class LateError(Exception):
    """There was no answer in time.

    Attributes:
        obeyed: the work has stopped when it was told to.
    """

    def __init__(self, *, obeyed: bool) -> None:
        super().__init__()
        self.obeyed = obeyed


async def bounded(work: Awaitable[_Result], seconds: float, name: str) -> _Result:
    """What the work comes to within that time, or when it is told to stop; it is told so, too, when nobody waits.

    Args:
        work: what a planner does.
        seconds: how long it may take.
        name: of who does it, to be blamed.

    Raises:
        LateError: there is nothing.
    """
    task = asyncio.ensure_future(_contained(work))
    try:
        in_time = await _ends(task, seconds)
    except asyncio.CancelledError:
        await _stopped(task, name)
        raise
    if not (in_time or await _stopped(task, name)):
        raise LateError(obeyed=False)
    if task.cancelled():
        if in_time:
            raise RuntimeError("it has cancelled itself")
        raise LateError(obeyed=True)
    return task.result()


async def _contained(work: Awaitable[_Result]) -> _Result:
    with contained():
        return await work


async def _ends(task: asyncio.Future[Any], seconds: float) -> bool:
    loop = asyncio.get_running_loop()
    over = loop.create_future()
    timer = threading.Timer(min(seconds, threading.TIMEOUT_MAX), lambda: loop.call_soon_threadsafe(over.cancel))
    timer.daemon = True
    if math.isfinite(seconds):
        timer.start()
    try:
        await asyncio.wait((task, over), return_when=asyncio.FIRST_COMPLETED)
    finally:
        timer.cancel()
        over.cancel()
    return task.done()


async def _stopped(task: asyncio.Future[Any], name: str) -> bool:
    """Tell the work to stop; whether it has."""
    task.cancel()
    try:
        ended = await _ends(task, STOPPING)
    except asyncio.CancelledError:  # the program ends, and would wait for it
        if not task.done():
            _throw_away(task, name)
        raise
    if not ended:
        _throw_away(task, name)
    return ended


def _throw_away(task: asyncio.Future[Any], name: str) -> None:
    """Let the work not be gone on with."""
    blame(name, "it goes on although it was told to stop")
    task.add_done_callback(lambda task: task.cancelled() or task.exception())  # nobody else will look at it
    if isinstance(task, asyncio.Task):
        with contextlib.suppress(Exception):
            task.get_coro().close()
    task.cancel()


def blame(name: str, what: str) -> None:
    """Say what a planner does wrong that changes no answer, in the way of asyncio: to the loop's handler."""
    asyncio.get_running_loop().call_exception_handler({"message": f"planner {name}: {what}"})
