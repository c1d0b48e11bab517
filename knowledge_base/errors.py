"""Errors about what people wrote: each says where, what was found, and what was meant.

One family for all rooms, so that a command can turn any of them into one line and exit status 2.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Place:
    """Where in a text something stands; lines and columns count from 1, `None` is unknown."""

    source: str | None = None
    line: int | None = None
    column: int | None = None

    def __str__(self) -> str:
        """`file:line:column`, as far as known (compilers' and editors' form)."""
        parts = [self.source or "<text>", *(str(n) for n in (self.line, self.column) if n is not None)]
        return ":".join(parts)


def nearest(name: str, valid: Iterable[str]) -> str | None:
    """The valid name that `name` was probably meant to be, or `None` when nothing is close."""
    by_folded = {candidate.casefold(): candidate for candidate in sorted(valid)}
    close = difflib.get_close_matches(name.casefold(), by_folded, n=1, cutoff=0.55)
    return by_folded[close[0]] if close else None


class InputError(Exception):
    """Something a person wrote cannot be used; nothing was changed.

    Attributes:
        message: what is wrong, one sentence without a full stop.
        place: where it stands.
        found: the offending word as written, if there is one.
        valid: the names that would have been right, if there is a list of them.
    """

    def __init__(
        self,
        message: str,
        *,
        place: Place | None = None,
        found: str | None = None,
        valid: Iterable[str] = (),
    ) -> None:
        super().__init__(message)
        self.message = message
        self.place = place
        self.found = found
        self.valid = tuple(sorted(set(valid)))

    @property
    def nearest(self) -> str | None:
        """The valid name closest to what was found."""
        return nearest(self.found, self.valid) if self.found is not None else None

    def located(self, place: Place) -> InputError:
        """The same error with `place` filled in where it had none; used by readers that know the file."""
        if self.place is None:
            self.place = place
        return self

    def __str__(self) -> str:
        """One line: place, message, and the nearest valid name or the short list of them."""
        text = f"{self.place}: {self.message}" if self.place else self.message
        if self.nearest is not None:
            return f"{text}; did you mean '{self.nearest}'?"
        if self.valid:
            shown = ", ".join(self.valid[:8]) + (", …" if len(self.valid) > 8 else "")
            return f"{text}; valid: {shown}"
        return text


class ParseError(InputError):
    """The text does not have the form of the language it claims to be in."""


class UnknownNameError(InputError):
    """A type, predicate, function, object, variable or plot that nobody declared."""


class SchemaError(InputError):
    """A declaration, fact or expression contradicts the schema (arity, type, duplicate)."""


class ConflictError(Exception):
    """A transaction met a world that is not the one it was written for; nothing was changed."""


class ConditionCancelledError(Exception):
    """Someone waits for a condition that is not installed any more and will not fire again."""
