"""Lines of users' code in tracebacks, for messages about exceptions of their functions."""

from __future__ import annotations

import inspect
import os
import sys
import sysconfig
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from knowledge_base.errors import Place, printable, shortened
from knowledge_base.user_objects import causes, described, traceback_of, unread_place


def raised_at(error: BaseException, *, only_users: bool = False) -> str:
    """Return the innermost line of a user's code that raised the error, as ` (file:line)`; empty without a line.

    Code of this project, of the standard library and of installed packages counts only if no other code was involved,
    and never with `only_users`. A syntax error has the line that cannot be read.
    """
    unread = unread_place(error)
    if unread is not None:
        return f" ({unread.source}:{unread.line})"
    frames = list(_frames(error))
    users = [frame for frame in frames if is_users_code(frame[0])]
    found = users if users or only_users else [frame for frame in frames if not frame[0].startswith(_FROZEN)]
    return f" ({found[-1][0]}:{found[-1][1]})" if found else ""


def _frames(error: BaseException) -> Iterator[tuple[str, int]]:
    """Yield file and line of each frame of the error, of its causes, and of the first member of a group."""
    for cause in causes(error, members=True):
        for frame, line in traceback.walk_tb(traceback_of(cause)):
            yield frame.f_code.co_filename, line


def waits_at(coroutine: Any) -> str:
    """Return the innermost line of a user's code at which a coroutine waits, as `file:line`; empty without a line."""
    found = ""
    awaited = coroutine
    while awaited is not None:
        frame = getattr(awaited, "cr_frame", None) or getattr(awaited, "gi_frame", None)
        if frame is not None and is_users_code(frame.f_code.co_filename):
            found = f"{frame.f_code.co_filename}:{frame.f_lineno}"
        awaited = getattr(awaited, "cr_await", None) or getattr(awaited, "gi_yieldfrom", None)
    return found


def place_of(made: type | Callable[..., Any]) -> Place | None:
    """Return file and line of the definition of a class or function; `None` if its source is unknown."""
    try:
        source = inspect.unwrap(made) if inspect.isfunction(made) else made
        return Place(inspect.getsourcefile(source), inspect.getsourcelines(source)[1])
    except (OSError, TypeError):
        return None


def calling_place(*folders: str) -> Place | None:
    """Return the innermost line of the stack that is in none of the folders; `None` without one."""
    frame = sys._getframe(1)  # noqa: SLF001  # the only way to the caller's line
    while frame is not None and frame.f_code.co_filename.startswith((*folders, __file__)):
        frame = frame.f_back  # type: ignore[assignment]  # `None` at the end
    return None if frame is None else Place(frame.f_code.co_filename, frame.f_lineno)


def user_place(error: BaseException) -> Place | None:
    """Return the innermost line of a user's code that raised the error, or that cannot be read; `None` without one."""
    unread = unread_place(error)
    if unread is not None:
        return unread
    users = [frame for frame in _frames(error) if is_users_code(frame[0])]
    return Place(*users[-1]) if users else None


def is_of_project(error: BaseException) -> bool:
    """Return whether the frames of an error are all of this project or of the standard library."""
    return not any(is_program(file) and not file.startswith(PROJECT) for file, _ in _frames(error))


def is_program(file: str) -> bool:
    """Return whether a file is not of the standard library; installed packages count as programs."""
    return file.startswith(_PACKAGES) or not file.startswith((_STANDARD, _FROZEN))


def is_users_code(file: str) -> bool:
    """Return whether a file is neither of this project, nor of the standard library, nor of an installed package."""
    return not file.startswith(_NOT_USERS)


def whole_traceback(error: BaseException) -> str:
    """Return the traceback as printable lines; the description if a part of the error fails while it is formatted."""
    try:
        begun = traceback_of(error)  # the calls before the user's code are of no use to the user
        while begun is not None and not is_users_code(begun.tb_frame.f_code.co_filename):
            begun = begun.tb_next
        begun = begun or traceback_of(error)
        text = "".join(traceback.format_exception(type(error), error, begun)).rstrip()
    except BaseException:  # noqa: BLE001  # user code defines the text, notes and type of an exception
        return described(error)
    return "\n".join(printable(shortened(line)) for line in text.splitlines()[-_MOST_LINES:])


_MOST_LINES = 200
"""Maximum number of lines of a traceback in a log; the last lines have the exception."""
_ROOT = Path(__file__).parents[1]
_FROZEN = "<frozen"
"""The beginning of the file names of code inside the interpreter, e.g. of `import`."""
PROJECT = tuple(str(_ROOT / package) + os.sep for package in ("knowledge_base", "dsc", "planning"))
"""The folders of the packages of this project."""
_PACKAGES = tuple({sysconfig.get_path(name) + os.sep for name in ("purelib", "platlib")})
_STANDARD = sysconfig.get_path("stdlib") + os.sep
_NOT_USERS = (*PROJECT, *_PACKAGES, _STANDARD, _FROZEN, "<string>")  # the last one is e.g. a dataclass's `__init__`
