"""Safe reading of objects whose classes users' code defines: their types, texts and members may fail.

An exception of a hook, listener or planner must not end the program while its report is written. `isinstance` reads
`__class__`, `str` calls `__str__`, and both may raise any exception.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from types import TracebackType
from typing import TypeGuard, TypeVar

from knowledge_base.errors import MAX_NAME, Place, printable, shortened

_Type = TypeVar("_Type")
MAX_MEMBERS = 3
"""Maximum number of exceptions in the description of a group; also the maximum depth of nested groups."""
_name_of = type.__dict__["__name__"].__get__  # a metaclass may return another name, or fail
_members_of = BaseExceptionGroup.__dict__["exceptions"].__get__
_cause_of = BaseException.__dict__["__cause__"].__get__
_traceback_of = BaseException.__dict__["__traceback__"].__get__
_unread = [SyntaxError.__dict__[name].__get__ for name in ("filename", "lineno", "offset")]
_MOST_CAUSES = 100
"""Maximum number of causes that are read: an error may be its own cause."""


def type_name(value: object) -> str:
    """Return the name of the value's type on one line, without calling code of the value or its metaclass."""
    return printable(shortened(str.__str__(_name_of(type(value))), MAX_NAME))


def has_type(value: object, kinds: type[_Type] | tuple[type[_Type], ...]) -> TypeGuard[_Type]:
    """Return whether the type of the value is or derives from one of `kinds`; `isinstance` reads `__class__`, too."""
    return issubclass(type(value), kinds)


def as_exception(error: BaseException) -> Exception:
    """Return the error itself or, if a future or an exception group would refuse it, a `RuntimeError` that it causes.

    A future refuses `StopIteration`. An error that is not an `Exception`, e.g. `SystemExit`, would end the program. A
    future also asks with `isinstance`, which fails for some classes.
    """
    with suppress(BaseException):
        if isinstance(error, Exception) and not isinstance(error, StopIteration | type):
            return error
    replacement = RuntimeError(described(error))
    replacement.__cause__ = error
    return replacement


def causes(error: BaseException, *, members: bool = False) -> Iterator[BaseException]:
    """Yield the error, its cause, the cause of this, and so on; with `members`, the first member of a group instead."""
    cause: BaseException | None = error
    for _ in range(_MOST_CAUSES):
        if cause is None:
            return
        yield cause
        cause = _members_of(cause)[0] if members and has_type(cause, BaseExceptionGroup) else _cause_of(cause)


def traceback_of(error: BaseException) -> TracebackType | None:
    """Return the traceback of the error."""
    found: TracebackType | None = _traceback_of(error)
    return found


def unread_place(error: BaseException) -> Place | None:
    """Return the place of a program that cannot be read; `None` for other errors than a `SyntaxError` with a file."""
    if not has_type(error, SyntaxError):
        return None
    file, line, column = (read(error) for read in _unread)
    return None if file is None else Place(str(file), line, column or None)


def described(error: BaseException, *, named: bool = True) -> str:
    """Return the exception on one line of at most `MAX_MESSAGE` characters.

    A group includes its first exceptions.

    User code defines the type, metaclass and text of an exception, and each of these may fail. This function never
    raises.

    Args:
        error: the exception.
        named: whether the name of the exception's type precedes its text.
    """
    try:
        return shortened(_describe(error, MAX_MEMBERS, named=named))
    except BaseException:  # noqa: BLE001  # e.g. RecursionError: the stack ends here
        return "an exception that cannot be described"


def _describe(error: BaseException, depth: int, *, named: bool) -> str:
    text = text_of(error, str)
    if has_type(error, BaseExceptionGroup) and depth:
        members = [_describe(one, depth - 1, named=True) for one in _members_of(error)[:MAX_MEMBERS]]
        text = f"{text}: {'; '.join(members)}"
    said = [type_name(error)] if named or not text else []
    return shortened(": ".join([*said, text] if text else said))


def text_of(value: object, write: Callable[[object], str]) -> str:
    """Return the value by `str` or `repr` on one line of bounded length, or a replacement text if `write` raises."""
    try:
        text = shortened(str.__str__(write(value)))
        return shortened(printable(" ".join(text.split()) if write is str else text))
    except BaseException as problem:  # noqa: BLE001  # user code may raise anything, `SystemExit` too
        return f"(a text that cannot be made: {type_name(problem)})"


def shown(value: object) -> str:
    """Return the text of any value for a message; never raise an exception."""
    try:
        return str.__str__(repr(value))
    except ValueError:  # Python refuses to write such a long number
        return "a number of thousands of digits" if has_type(value, int) else f"an object of type {type_name(value)}"
    except BaseException:  # noqa: BLE001  # user code may raise anything, `SystemExit` too
        return f"an object of type {type_name(value)}"
