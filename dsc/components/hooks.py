"""Calls of code that a robot's builder wrote: however a hook ends, its caller gets a value or an `Exception`.

`sys.exit` in a hook, or an exception of no usual kind, would end the program with the task that runs it.
"""

from __future__ import annotations

import asyncio
import signal
import threading
from asyncio.runners import Runner
from collections.abc import Callable
from functools import partial
from types import TracebackType
from typing import Any

from knowledge_base.errors import described


class contained:  # noqa: N801  # a context manager, as `suppress`
    """Inside, a hook runs: an exception that is no `Exception` becomes a `RuntimeError` that describes it.

    A cancellation by others, the closing of the coroutine, and Ctrl-C pass.
    """

    __slots__ = ("_task",)

    def __enter__(self) -> None:
        self._task = running_task()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if error is not None and not issubclass(type(error), Exception) and is_own(error, self._task):
            itself = ": it cancelled itself" if issubclass(type(error), asyncio.CancelledError) else ""
            raise RuntimeError(described(error) + itself) from error


def is_own(error: BaseException, task: asyncio.Task[Any] | None) -> bool:
    """Whether the hook itself raised it, rather than a cancellation, the end of its coroutine, or Ctrl-C.

    Args:
        error: raised inside the hook.
        task: the task that runs the hook, `None` outside any.
    """
    kind = type(error)  # `isinstance` would ask the exception for its class, which may fail
    if issubclass(kind, asyncio.CancelledError):
        return task is not None and task.cancelling() == 0
    if issubclass(kind, GeneratorExit):  # a coroutine is closed by others, never by the task that runs it
        return task is running_task()
    return not (issubclass(kind, KeyboardInterrupt) and _from_keyboard(error))


def running_task() -> asyncio.Task[Any] | None:
    """The task that is running in this thread, if any."""
    try:
        return asyncio.current_task()
    except RuntimeError:
        return None


def _from_keyboard(error: BaseException) -> bool:
    """Whether it may be Ctrl-C: with the handler of `asyncio.run` its traceback tells, with others nothing does."""
    if threading.current_thread() is not threading.main_thread():
        return False
    handler = signal.getsignal(signal.SIGINT)
    if _ON_SIGINT is None or not isinstance(handler, partial) or getattr(handler.func, "__func__", None) != _ON_SIGINT:
        return callable(handler)
    innermost = error.__traceback__
    while innermost is not None and innermost.tb_next is not None:
        innermost = innermost.tb_next
    return innermost is not None and innermost.tb_frame.f_code is _ON_SIGINT.__code__


_ON_SIGINT: Any = getattr(Runner, "_on_sigint", None)  # it has no public name


GRACE = 30.0
"""Seconds of loop time for a cancelled task to clean up."""


def give_up_after(task: asyncio.Task[Any], seconds: float, say: Callable[[], None]) -> None:
    """Abandon the task if it is not over after that many seconds of loop time, and call `say`."""

    def overdue() -> None:
        give_up(task)
        say()

    handle = asyncio.get_running_loop().call_later(seconds, overdue)
    task.add_done_callback(lambda _: handle.cancel())


def give_up(task: asyncio.Task[Any]) -> None:
    """Abandon a task: the loop does not wait for it when it closes.

    Asyncio waits without end for a task that ignores its cancellation. Its documentation names this way for extensions.
    """
    task._log_destroy_pending = False  # type: ignore[attr-defined]  # noqa: SLF001  # it is known to be pending
    asyncio.tasks._unregister_task(task)  # noqa: SLF001  # documented under "Extending"
