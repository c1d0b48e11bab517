"""Signals that end a run: SIGTERM (systemd, docker, `timeout`) and SIGHUP (a closed terminal) act like Ctrl-C."""

from __future__ import annotations

import asyncio
import signal
import threading
from asyncio import AbstractEventLoop, Runner, Task
from collections.abc import Coroutine
from contextvars import ContextVar
from types import FrameType
from typing import Any, TypeVar

_Result = TypeVar("_Result")
_ENDING = signal.SIGTERM, signal.SIGHUP


class _Ending:
    """Handler of the signals that end a run.

    Attributes:
        received: name of the first signal; empty before it.
    """

    def __init__(self) -> None:
        self.received = ""
        self._task: Task[Any] | None = None
        self._loop: AbstractEventLoop | None = None

    async def watch(self, main: Coroutine[Any, Any, _Result]) -> _Result:
        """Await a coroutine, and cancel it at the first signal."""
        self._task, self._loop = asyncio.current_task(), asyncio.get_running_loop()
        _ending.set(self)
        handled = [one for one in _ENDING if signal.getsignal(one) is signal.SIG_DFL]  # others are the program's own
        for one in handled:
            signal.signal(one, self._handle)
        try:
            return await main
        finally:
            for one in handled:
                signal.signal(one, signal.SIG_DFL)

    def _handle(self, number: int, _: FrameType | None) -> None:
        """Cancel the run; end the program at a second signal."""
        if self.received:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
            return
        self.received = signal.Signals(number).name
        if self._task is not None and self._loop is not None:
            self._task.cancel()
            self._loop.call_soon_threadsafe(lambda: None)  # wakes a loop that waits


_ending: ContextVar[_Ending | None] = ContextVar("ending", default=None)


def ending_signal() -> str:
    """Return the name of the signal that ends the present run; empty without a signal."""
    ending = _ending.get()
    return "" if ending is None else ending.received


def run_until_signal(runner: Runner, main: Coroutine[Any, Any, _Result]) -> _Result:
    """Run a coroutine, which SIGTERM and SIGHUP cancel, and return its result.

    Signals reach only the main thread; signals that the program handles itself remain its own. A second signal
    immediately ends the program.

    Raises:
        KeyboardInterrupt: a signal has ended the run; the argument is the signal's name, and is missing for Ctrl-C.
    """
    if threading.current_thread() is not threading.main_thread():
        return runner.run(main)
    ending = _Ending()
    try:
        return runner.run(ending.watch(main))
    except asyncio.CancelledError:
        if not ending.received:
            raise
        raise KeyboardInterrupt(ending.received) from None
