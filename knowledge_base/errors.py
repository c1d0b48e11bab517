"""Errors about input: each contains the place, the wrong word and the nearest valid word.

All packages use this family of errors, so that a command reports each error on one line with exit status 2.
"""

from __future__ import annotations

import difflib
import heapq
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import lru_cache


@dataclass(frozen=True, slots=True)
class Place:
    """Place in a text; lines and columns count from 1, and `None` is unknown."""

    source: str | None = None
    line: int | None = None
    column: int | None = None

    def __str__(self) -> str:
        """Return `file:line:column` without the unknown parts, as compilers and editors write it."""
        parts = [self.source or "<text>", *(str(n) for n in (self.line, self.column) if n is not None)]
        return printable(":".join(parts))


MAX_MESSAGE = 400
"""Maximum length of a message in characters; quoted input may be much longer."""
MAX_NAME = 100
"""Maximum length in characters of a name whose nearest valid name is searched.

The cost of a comparison is quadratic in this length.
"""
MAX_COMPARED = 50
"""Maximum number of valid names to compare with a misspelt name.

If more names are valid, only the names that share the most pairs of letters are compared.
"""


def nearest(name: str, valid: Iterable[str]) -> str | None:
    """Return the valid name closest to `name`, or `None` when no valid name is close."""
    if len(name) > MAX_NAME:
        return None
    folded = name.casefold()
    by_folded = {candidate.casefold(): candidate for candidate in sorted(valid) if len(candidate) <= MAX_NAME}
    candidates: Iterable[str] = by_folded
    if len(by_folded) > MAX_COMPARED:
        pairs = _pairs(folded)
        candidates = heapq.nsmallest(MAX_COMPARED, by_folded, key=lambda other: len(pairs ^ _pairs(other)))
    close = difflib.get_close_matches(folded, candidates, n=1, cutoff=0.55)
    return by_folded[close[0]] if close else None


def printable(text: str) -> str:
    r"""Return the text on one line.

    Line breaks, control characters and surrogates become escapes such as `\\n`.
    """
    return text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def shortened(text: str, longest: int = MAX_MESSAGE) -> str:
    """Return the text, without its middle if it has more than `longest` characters."""
    half = longest // 2
    return text if len(text) <= longest else f"{text[:half]} … {text[-half:]}"


@lru_cache(maxsize=4096)  # the errors of one text share the same valid names
def _pairs(name: str) -> frozenset[str]:
    return frozenset(name[at : at + 2] for at in range(len(name)))


class DscError(Exception):
    """The base of every exception with which this library reports a mistake or a failure."""


class InputError(DscError):
    """A mistake in the input; the operation had no effect.

    Attributes:
        message: the mistake, in one sentence without a full stop.
        place: the place of the mistake in the text.
        found: the wrong word as written, if any.
        valid: the valid names; empty if no list of them exists.
    """

    def __init__(
        self,
        message: str,
        *,
        place: Place | None = None,
        found: str | None = None,
        valid: Iterable[str] = (),
    ) -> None:
        self.message = printable(shortened(message))
        super().__init__(self.message)
        self.place = place
        self.found = None if found is None else str(found)  # a caller may pass any object
        self.valid = tuple(sorted(set(valid)))

    @property
    def nearest(self) -> str | None:
        """The valid name closest to `found`, or `None`."""
        return nearest(self.found, self.valid) if self.found is not None else None

    def located(self, place: Place) -> InputError:
        """Set `place` if this error has no place yet; return this error."""
        if self.place is None:
            self.place = place
        return self

    @property
    def text(self) -> str:
        """The message, with the nearest valid name or a short list of the valid names, without the place."""
        meant = self.nearest
        if meant is not None:
            return f"{self.message}; did you mean '{printable(meant)}'{_difference(self.found or '', meant)}?"
        if self.valid:
            names = [printable(shortened(name, MAX_NAME)) for name in self.valid[:8]] + ["…"] * (len(self.valid) > 8)
            return f"{self.message}; valid: {', '.join(names)}"
        return self.message

    def __str__(self) -> str:
        """Return one line: the place and the text."""
        return f"{self.place}: {self.text}" if self.place else self.text


def _difference(found: str, meant: str) -> str:
    """Return how two names differ that look alike, as text; empty for other names."""
    if found == meant:
        return ""
    if unicodedata.normalize("NFKC", found) == unicodedata.normalize("NFKC", meant):
        return ", which has another Unicode form"
    return ", with another case" if found.casefold() == meant.casefold() else ""


_collected: ContextVar[list[InputError] | None] = ContextVar("collected", default=None)


@contextmanager
def collecting() -> Iterator[list[InputError]]:
    """Return a context manager with a list, to which `tolerated` adds errors instead of raising them."""
    found: list[InputError] = []
    token = _collected.set(found)
    try:
        yield found
    finally:
        _collected.reset(token)


@contextmanager
def tolerated() -> Iterator[None]:
    """Inside `collecting`, add an `InputError` of the block to the list, and continue after the block.

    So one check reports all errors of a project. Outside of `collecting`, the error is raised.
    """
    try:
        yield
    except InputError as error:
        found = _collected.get()
        if found is None:
            raise
        found.append(error)


class ParseError(InputError):
    """The text violates the grammar of its language."""


class UnsupportedConstructError(ParseError):
    """A construct of PDDL or of a related language that no planner here supports.

    Attributes:
        construct: keyword of the construct, e.g. `:process`.
        engines: the family of planning engines that supports the construct.
    """

    def __init__(self, construct: str, meaning: str, engines: str, *, place: Place | None) -> None:
        super().__init__(f"'{construct}' ({meaning}) is not supported; what can do it: {engines}", place=place)
        self.construct = construct
        self.engines = engines


class UnknownNameError(InputError):
    """An undeclared type, predicate, function, object, variable or plot."""


class SchemaError(InputError):
    """A declaration, fact or expression contradicts the schema (arity, type, duplicate)."""


class ConflictError(DscError):
    """A transaction contradicts the present version or the state of this thread; nothing was changed."""


class StoreError(InputError):
    """A store's file cannot be opened, read or written; committed changes are not affected."""


class DamagedStoreError(StoreError):
    """The content of a store's file differs from the written data; the message contains the table and the row."""


class OutOfBoundsError(InputError):
    """A query or an effect exceeded its bounds or was cancelled; nothing was changed.

    Attributes:
        work: number of facts and objects that the evaluation examined.
        seconds: duration of the evaluation in seconds.
    """

    def __init__(self, message: str, *, work: int, seconds: float) -> None:
        done = f"given up after {work} facts and objects in {seconds:.2f} s"
        super().__init__(f"{message}; {done}: name more objects, use fewer variables, or raise the bound")
        self.work = work
        self.seconds = seconds


class SchemaMismatchError(SchemaError):
    """A store or world is read with a schema that does not extend its own schema.

    Attributes:
        differences: missing and different declarations, one sentence each.

    Args:
        said: summary of the differences.
    """

    def __init__(
        self, differences: Sequence[str], *, place: Place | None = None, said: str = "the schema is another one"
    ) -> None:
        more = f"; and {len(differences) - 3} more" if len(differences) > 3 else ""
        super().__init__(f"{said}: {'; '.join(differences[:3])}{more}", place=place)
        self.differences = tuple(differences)


class HistoryError(InputError):
    """A version or time is no longer kept, or is in the future."""


class UserCodeError(InputError):
    """A user's function, e.g. a computed predicate, has failed; the message has the file and the line."""


class ConditionCancelledError(DscError):
    """A coroutine waits for a condition that is cancelled and will not fire again."""
