"""Calls from any thread that take effect in the thread of an event loop, e.g. from the callback of a driver."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import TypeVarTuple, Unpack

_Args = TypeVarTuple("_Args")
_BINDING = threading.RLock()
"""Held while a loop is bound, so that no call without a loop is executed at the same time."""


class LoopCalls:
    """Executor of calls in the thread of the bound loop, in the order of the calls of each thread.

    Without a loop, or after its end, calls are executed in the calling thread.
    """

    __slots__ = ("_loop", "_thread")

    def __init__(self) -> None:
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread = 0

    def __reduce__(self) -> tuple[type[LoopCalls], tuple[()]]:
        """Pickle without the loop, which stays in this process."""
        return LoopCalls, ()

    def bind(self) -> None:
        """Bind the running loop, whose thread executes later calls."""
        with _BINDING:
            self._loop, self._thread = asyncio.get_running_loop(), threading.get_ident()

    def call(self, do: Callable[[Unpack[_Args]], object], *args: *_Args) -> None:
        """Execute a call immediately if this is the loop's thread, and in the loop's next iteration otherwise."""
        if self._loop is not None and self._thread == threading.get_ident():
            do(*args)
            return
        with _BINDING:
            loop = self._loop
            if loop is not None:
                try:
                    loop.call_soon_threadsafe(do, *args)
                except RuntimeError:  # the loop is closed
                    self._loop = loop = None
            if loop is None:
                do(*args)
