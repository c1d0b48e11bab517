"""Containment of hooks, which a robot's builder wrote: each hook returns a value or raises an `Exception`.

Otherwise, `sys.exit` in a hook would end the program with the hook's task. An exception whose class does not derive
from `Exception` would end the program, too.
"""

from __future__ import annotations

import asyncio
import os
import signal
import sysconfig
import threading
from asyncio.runners import Runner
from collections.abc import Callable
from functools import partial
from pathlib import Path
from traceback import walk_tb
from types import TracebackType
from typing import Any

from knowledge_base.errors import described


class contained:  # noqa: N801  # a context manager, named like `suppress`
    """Context manager in which a hook runs: an exception that is not an `Exception` becomes a `RuntimeError`.

    A cancellation by another task, the closing of the coroutine, and Ctrl-C pass unchanged.
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
    """Return whether the hook itself raised the error.

    The other causes are a cancellation by another task, the closing of the hook's coroutine, and Ctrl-C.

    Args:
        error: the error, raised inside the hook.
        task: the task that runs the hook; `None` outside of a task.
    """
    kind = type(error)  # `isinstance` would read the exception's `__class__`, which may fail
    if issubclass(kind, asyncio.CancelledError):
        return task is not None and task.cancelling() == 0
    if issubclass(kind, GeneratorExit):  # other code closes a coroutine, never the task that runs it
        return task is running_task()
    return not (issubclass(kind, KeyboardInterrupt) and _from_keyboard(error))


def raised_at(error: BaseException) -> str:
    """Return the innermost line of a user's code that raised the error, as ` (file:line)`; empty without a line.

    Code of this project, of the standard library and of installed packages counts only if no other code was involved.
    A syntax error has the line that cannot be read.
    """
    if isinstance(error, SyntaxError) and error.filename is not None:
        return f" ({error.filename}:{error.lineno})"
    frames = []
    cause: BaseException | None = error
    while cause is not None:
        frames += [(frame.f_code.co_filename, line) for frame, line in walk_tb(cause.__traceback__)]
        cause = cause.__cause__
    users = [frame for frame in frames if not frame[0].startswith(_NOT_USERS)]
    found = users or [frame for frame in frames if not frame[0].startswith(_FROZEN)]
    return f" ({found[-1][0]}:{found[-1][1]})" if found else ""


_ROOT = Path(__file__).parents[2]
_FROZEN = "<frozen"
"""The beginning of the file names of code inside the interpreter, e.g. of `import`."""
_NOT_USERS = (
    *(str(_ROOT / package) + os.sep for package in ("knowledge_base", "dsc", "planning")),
    *{sysconfig.get_path(name) + os.sep for name in ("stdlib", "purelib", "platlib")},
    _FROZEN,
)
"""Beginnings of the paths of code that no user of this project has written."""


def running_task() -> asyncio.Task[Any] | None:
    """Return the task that runs in this thread; `None` outside of a task."""
    try:
        return asyncio.current_task()
    except RuntimeError:
        return None


def _from_keyboard(error: BaseException) -> bool:
    """Return whether the error may be Ctrl-C.

    With the signal handler of `asyncio.run`, the traceback identifies Ctrl-C. With another handler, Ctrl-C is assumed.
    """
    if threading.current_thread() is not threading.main_thread():
        return False
    handler = signal.getsignal(signal.SIGINT)
    if _ON_SIGINT is None or not isinstance(handler, partial) or getattr(handler.func, "__func__", None) != _ON_SIGINT:
        return callable(handler)
    innermost = error.__traceback__
    while innermost is not None and innermost.tb_next is not None:
        innermost = innermost.tb_next
    return innermost is not None and innermost.tb_frame.f_code is _ON_SIGINT.__code__


_ON_SIGINT: Any = getattr(Runner, "_on_sigint", None)  # the handler has no public name


GRACE = 30.0
"""Seconds of loop time for a cancelled task to clean up."""


def give_up_after(task: asyncio.Task[Any], seconds: float, say: Callable[[], None]) -> None:
    """Abandon the task if it has not ended after `seconds` of loop time, and call `say`."""

    def overdue() -> None:
        give_up(task)
        say()

    handle = asyncio.get_running_loop().call_later(seconds, overdue)
    task.add_done_callback(lambda _: handle.cancel())


def give_up(task: asyncio.Task[Any]) -> None:
    """Abandon a task, so that the loop does not wait for the task when the loop closes.

    Asyncio waits without end for a task that ignores its cancellation. Its documentation permits this function's calls
    to extensions.
    """
    task._log_destroy_pending = False  # type: ignore[attr-defined]  # noqa: SLF001  # the task is known to be pending
    asyncio.tasks._unregister_task(task)  # noqa: SLF001  # documented under "Extending"
