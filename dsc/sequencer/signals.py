"""Signals that end a run: Ctrl-C, SIGTERM (systemd, docker, `timeout`) and SIGHUP (a closed terminal)."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import threading
from asyncio import AbstractEventLoop, Runner, Task
from collections.abc import Callable, Coroutine, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from types import FrameType
from typing import Any, Literal, TypeVar

from dsc.components.hooks import is_handler_of_asyncio

_Result = TypeVar("_Result")
OnSignal = Literal["suspend", "end"]
"""Reaction of a run with a store to a signal."""
_ENDING = signal.SIGINT, signal.SIGTERM, signal.SIGHUP


class _Ending:
    """Handler of the signals that end a run.

    Attributes:
        received: name of the first signal; empty before it.
        unfinished: functions that return what a second signal leaves unfinished, as texts.
    """

    def __init__(self) -> None:
        self.received = ""
        self.unfinished: list[Callable[[], Iterable[str]]] = []
        self._task: Task[Any] | None = None
        self._loop: AbstractEventLoop | None = None

    async def watch(self, main: Coroutine[Any, Any, _Result]) -> _Result:
        """Await a coroutine, and cancel it at the first signal."""
        self._task, self._loop = asyncio.current_task(), asyncio.get_running_loop()
        _ending.set(self)
        before = {one: handler for one in _ENDING if _is_free(handler := signal.getsignal(one))}
        for one in before:
            signal.signal(one, self._handle)
        try:
            return await main
        finally:
            for one, handler in before.items():
                signal.signal(one, handler)

    def _handle(self, number: int, _: FrameType | None) -> None:
        """Cancel the run; end the program at a second signal."""
        if self.received:
            self._end(number)
            return
        self.received = signal.Signals(number).name
        if self._task is not None and self._loop is not None:
            self._task.cancel()
            self._loop.call_soon_threadsafe(lambda: None)  # wakes a loop that waits

    _handle.raises = False  # type: ignore[attr-defined]  # for `hooks.is_own`

    def _end(self, number: int) -> None:
        """End the program by the signal, and report what is unfinished; an interactive interpreter continues."""
        found = [text for unfinished in self.unfinished for text in unfinished()]
        lines = [f"{signal.Signals(number).name} again: the program ends", *(f"unfinished: {text}" for text in found)]
        os.write(2, "".join(f"{line}\n" for line in lines).encode())
        if number == signal.SIGINT and hasattr(sys, "ps1"):
            raise KeyboardInterrupt
        signal.signal(number, signal.SIG_DFL)
        signal.raise_signal(number)


def _is_free(handler: object) -> bool:
    """Return whether a signal has the usual handler; other handlers are the program's own."""
    return handler in (signal.SIG_DFL, signal.default_int_handler) or is_handler_of_asyncio(handler)


_ending: ContextVar[_Ending | None] = ContextVar("ending", default=None)


@contextmanager
def unfinished_at_second_signal(unfinished: Callable[[], Iterable[str]]) -> Iterator[None]:
    """Return a context manager in which a second signal reports the texts that the function returns."""
    ending = _ending.get()
    functions = [] if ending is None else ending.unfinished
    functions.append(unfinished)
    try:
        yield
    finally:
        functions.remove(unfinished)


def run_until_signal(runner: Runner, main: Coroutine[Any, Any, _Result]) -> _Result:
    """Run a coroutine, which Ctrl-C, SIGTERM and SIGHUP cancel, and return its result.

    Signals reach only the main thread; signals that the program handles itself remain its own. A second signal
    immediately ends the program, and reports what is unfinished.

    Raises:
        KeyboardInterrupt: a signal has ended the run; the argument is the signal's name.
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
