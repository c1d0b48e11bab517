"""Containment of hooks, which a robot's builder wrote: each hook returns a value or raises an `Exception`.

Otherwise, `sys.exit` in a hook would end the program with the hook's task. An exception whose class does not derive
from `Exception` would end the program, too.
"""

from __future__ import annotations

import asyncio
import ctypes
import re
import signal
import threading
import warnings
from asyncio.runners import Runner
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from types import TracebackType
from typing import Any
from weakref import WeakSet

from dsc.errors import ProgrammingError, SkillError
from dsc.run_log import run_logger
from knowledge_base.errors import InputError
from knowledge_base.tracebacks import is_of_project, is_users_code, raised_at, waits_at, whole_traceback
from knowledge_base.user_objects import causes, described, has_type

_LOG = run_logger(__package__)
Classes = tuple[type[BaseException], ...]
active_component: ContextVar[str | None] = ContextVar("component_at_work", default=None)
"""Name of the component whose skill or hook the present task executes; the task's callbacks inherit it."""
_found: ContextVar[list[str] | None] = ContextVar("found", default=None)
_NEVER_AWAITED = "coroutine .* was never awaited"
_RAISED = "exceptions must derive from BaseException"
_RETURNED = "; an outcome is returned, not raised"
_MOST_FOUND = 100
"""Number of programming errors of one run that are kept for its end; all are logged."""


@contextmanager
def programming_errors() -> Iterator[list[str]]:
    """Return a context manager with the list of the programming errors in its block, and in tasks begun there."""
    found: list[str] = []
    token = _found.set(found)
    try:
        yield found
    finally:
        _found.reset(token)


@contextmanager
def unheard_errors(found: list[str]) -> Iterator[None]:
    """Return a context manager in which an exception of a task without an `await` is a programming error of the run.

    Args:
        found: the list of `programming_errors`.
    """
    loop = asyncio.get_running_loop()
    before = loop.get_exception_handler()

    def lost(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        error = context.get("exception")
        if error is None or not raised_at(error, only_users=True):
            loop.default_exception_handler(context) if before is None else before(loop, context)
            return
        token = _found.set(found)
        programming_error(error, "a task that nobody awaits")
        _found.reset(token)

    loop.set_exception_handler(lost)
    try:
        yield
    finally:
        loop.set_exception_handler(before)


@contextmanager
def unawaited_coroutines() -> Iterator[None]:
    """Return a context manager in which a coroutine of a run without an `await` is a programming error of the run.

    It changes Python's display of warnings for the whole process until its end. Therefore only simulated time and the
    command use it, but not a run in the real time of another program.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("always", _NEVER_AWAITED, RuntimeWarning)
        shown = warnings.showwarning

        def show(
            message: Warning | str, category: type[Warning], filename: str, lineno: int, file: Any = None,
            line: Any = None,
        ) -> None:  # fmt: skip
            found = _found.get()
            if found is not None and re.match(_NEVER_AWAITED, str(message)) and is_users_code(filename):
                _note_unawaited(found, f"{message}; write `await` before it ({filename}:{lineno})")
            else:
                shown(message, category, filename, lineno, file, line)

        warnings.showwarning = show
        yield


def _note_unawaited(found: list[str], bug: str) -> None:
    if bug in found:
        return
    _LOG.error("%s", bug)
    if len(found) < _MOST_FOUND:
        found.append(bug)


class contained:  # noqa: N801  # a context manager, named like `suppress`
    """Context manager in which a hook runs: an exception that is not an `Exception` becomes a `RuntimeError`.

    A cancellation by another task, the closing of the coroutine, and Ctrl-C pass unchanged.

    Args:
        hook: the name of the hook, as `arm.start`; with it, a programming error becomes a `ProgrammingError`.
        raises: the exceptions that the component declares.
    """

    __slots__ = ("_hook", "_raises", "_task")

    def __init__(self, hook: str = "", raises: Classes = ()) -> None:
        self._hook = hook
        self._raises = raises

    def __enter__(self) -> None:
        self._task = running_task()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if error is None or not (has_type(error, Exception) or is_own(error, self._task)):
            return
        bug = programming_error(error, self._hook, self._raises) if self._hook else None
        if bug is not None:
            raise bug from error
        if not has_type(error, Exception):
            itself = ": it cancelled itself" if has_type(error, asyncio.CancelledError) else ""
            raise RuntimeError(described(error) + itself) from error


def programming_error(error: BaseException, hook: str, raises: Classes = ()) -> ProgrammingError | None:
    """Return the programming error that `error` is or results from, and log its traceback; `None` for other errors.

    Every exception of a hook is a programming error, except a `SkillError` and the declared exceptions.

    Args:
        error: the exception of a hook or skill.
        hook: the name of the hook or skill, as `arm.grasp`.
        raises: the exceptions that the component declares.
    """
    known = bug_in(error)
    if known is not None:  # logged before
        return known
    if issubclass(type(error), (SkillError, *raises)):
        return None
    itself = ": it cancelled itself" if has_type(error, asyncio.CancelledError) else ""
    refused = has_type(error, InputError)  # its message is complete without a line of this project
    said = described(error, named=not refused)
    said += _RETURNED if _RAISED in said else ""
    place = raised_at(error, only_users=refused)
    bug = ProgrammingError(f"{hook}: {said}{itself}{place}")
    useless = refused and is_of_project(error)  # e.g. for a mistake in a watched condition
    _LOG.error("%s", bug if useless else f"{bug}\n{whole_traceback(error)}")
    found = _found.get()
    if found is not None and len(found) < _MOST_FOUND:
        found.append(str(bug))
    return bug


def bug_in(error: BaseException) -> ProgrammingError | None:
    """Return the programming error that an error is, or that caused it; `None` for other errors."""
    return next((cause for cause in causes(error) if type(cause) is ProgrammingError), None)


def reason_of(error: BaseException) -> str:
    """Return an error of a hook as text, without the class of an error whose message is complete."""
    return described(error, named=not has_type(error, (ProgrammingError, InputError)))


def executes(hook: str, task: asyncio.Task[Any]) -> str:
    """Return the hook that a task calls, with the line at which it waits, as ` and executes arm.start (arm.py:7)`."""
    place = waits_at(task.get_coro())
    return f" and executes {hook}" + (f" ({place})" if place else "")


def is_own(error: BaseException, task: asyncio.Task[Any] | None) -> bool:
    """Return whether the hook itself raised the error.

    The other causes are a cancellation by another task, the closing of the hook's coroutine, and Ctrl-C.

    Args:
        error: the error, raised inside the hook.
        task: the task that runs the hook; `None` outside of a task.
    """
    if has_type(error, asyncio.CancelledError):
        return task is None or task.cancelling() == 0
    if has_type(error, GeneratorExit):  # other code closes a coroutine, never the task that runs it
        return task is running_task()
    return not (has_type(error, KeyboardInterrupt) and _from_keyboard(error))


def running_task() -> asyncio.Task[Any] | None:
    """Return the task that runs in this thread; `None` outside of a task."""
    try:
        return asyncio.current_task()
    except RuntimeError:
        return None


def _from_keyboard(error: BaseException) -> bool:
    """Return whether the error may be Ctrl-C.

    With the signal handler of `asyncio.run`, the traceback identifies Ctrl-C. With another handler, Ctrl-C is assumed,
    unless the handler has the attribute `raises = False`.
    """
    if threading.current_thread() is not threading.main_thread():
        return False
    handler = signal.getsignal(signal.SIGINT)
    if not is_handler_of_asyncio(handler):
        return callable(handler) and bool(getattr(handler, "raises", True))
    innermost = error.__traceback__
    while innermost is not None and innermost.tb_next is not None:
        innermost = innermost.tb_next
    return innermost is not None and innermost.tb_frame.f_code is _ON_SIGINT.__code__


def is_handler_of_asyncio(handler: object) -> bool:
    """Return whether a signal handler is the one of `asyncio.run` for Ctrl-C."""
    if _ON_SIGINT is None or not isinstance(handler, partial):
        return False
    return bool(getattr(handler.func, "__func__", None) == _ON_SIGINT)


_ON_SIGINT: Any = getattr(Runner, "_on_sigint", None)  # the handler has no public name


GRACE = 30.0
"""Seconds of loop time for a cancelled task to clean up."""


def abandon_after(task: asyncio.Task[Any], seconds: float, say: Callable[[], None]) -> None:
    """Abandon the task if it has not ended after `seconds` of loop time, and call `say`."""

    def overdue() -> None:
        abandon(task)
        say()

    handle = asyncio.get_running_loop().call_later(seconds, overdue)
    task.add_done_callback(lambda _: handle.cancel())


def abandon(task: asyncio.Task[Any]) -> None:
    """Abandon a task, so that the loop does not wait for the task when the loop closes.

    Asyncio waits without end for a task that ignores its cancellation. Its documentation permits this function's calls
    to extensions. Python also resumes a suspended coroutine when it frees it, also at its exit; so it never frees this
    one.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(task.get_coro()))
    task._log_destroy_pending = False  # type: ignore[attr-defined]  # noqa: SLF001  # the task is known to be pending
    asyncio.tasks._unregister_task(task)  # noqa: SLF001  # documented under "Extending"
    _abandoned.add(task)


def cancel_once(task: asyncio.Task[Any]) -> None:
    """Cancel a task that was not cancelled before; a second cancellation would interrupt the clean-up of its skill."""
    if not task.cancelling():
        task.cancel()


def can_end(task: asyncio.Task[Any]) -> bool:
    """Return whether the end of a task can be awaited: it is neither done nor abandoned, and its loop is open."""
    return not (task.done() or task in _abandoned or task.get_loop().is_closed())


_abandoned: WeakSet[asyncio.Task[Any]] = WeakSet()
