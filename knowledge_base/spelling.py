"""Spelling of values in the language: names without quotes, and text that is read as an equal value."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

# Names without quotes, which a reader converts to lower case. In lists, a `-` separates names from their type.
_PLAIN_NAME = re.compile(r"[^\s()\";?:-][^\s()\";?]*")
_NOT_IN_NAMES = re.compile(r"[\s()\";?]+")
LONGEST_NAME = 255
"""Maximum number of characters in the name of an object."""
A_NAME_IS = (
    f"a name has 1 to {LONGEST_NAME} printable characters in lower case without blanks, parentheses, quotes, ';' and"
    " '?'; it begins with neither '-' nor ':' and is not a number, true, false or #t"
)
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)
_ENDS = {"n": "\n", "r": "\r"}  # a reader of files may replace one line ending by another
_TIME_PASSED = "#t"
"""The elapsed time in PDDL+."""
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?")
TRUTH_VALUES: Mapping[str, bool] = {"true": True, "false": False}
"""The two words that are read as truth values, not as names."""


def is_number(text: str) -> bool:
    """Return whether `text` is written as a number: `3`, `-0.5`, `1e-3`."""
    return _NUMBER.fullmatch(text) is not None


def is_plain_name(text: str) -> bool:
    """Return whether `text` is a name without quotes: lower case, no blanks, not a number or truth value."""
    return (
        _PLAIN_NAME.fullmatch(text) is not None
        and text == text.lower()
        and text.isprintable()
        and not is_number(text)
        and text not in TRUTH_VALUES
    )


def is_name(text: str) -> bool:
    """Return whether `text` is a valid name of an object, also in PDDL files; see `A_NAME_IS`."""
    return len(text) <= LONGEST_NAME and is_plain_name(text) and text != _TIME_PASSED


def nearest_name(text: str) -> str | None:
    """Return the text converted to a name, e.g. `red-cup` for `Red Cup`; `None` if no valid name remains."""
    plain = "".join(c for c in _NOT_IN_NAMES.sub("-", text[:LONGEST_NAME].lower()) if c.isprintable())
    name = plain.strip("-").lstrip(":-")
    return name if is_name(name) else None


def value_text(value: str | float | tuple[float, ...], *, quoted: bool = False) -> str:
    """Return a value in the notation of the language: `cup1`, `0.5`, `true`, `"red cup"`, `(geometry 0.4 0.1)`."""
    if isinstance(value, tuple):
        return "(" + " ".join(["geometry", *map(value_text, value)]) + ")"
    if isinstance(value, bool):
        return "true" if value else "false"
    if not isinstance(value, str):
        return repr(value)
    if not quoted and is_plain_name(value):
        return value
    escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("\r", "\\r")
    return f'"{escaped}"'


def number_text(number: int, noun: str) -> str:
    """Return a number with its noun: `1 place`, `2 places`."""
    return f"{number} {noun}{'s' * (number != 1)}"


def text_inside(quoted: str) -> str:
    """Return the text that `value_text` writes as this text in quotes."""
    return _ESCAPE.sub(lambda found: _ENDS.get(found[1], found[1]), quoted[1:-1])


def brief_repr(value: DataclassInstance) -> str:
    """Return the call that constructs a value of a dataclass, without `None` and empty fields."""
    said = {field.name: getattr(value, field.name) for field in fields(value)}
    kept = (f"{name}={one!r}" for name, one in said.items() if one not in (None, (), {}))
    return f"{type(value).__name__}({', '.join(kept)})"
