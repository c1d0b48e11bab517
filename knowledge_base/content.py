"""What a function may be worth: a number, text, a truth value, or a geometry (S4.3)."""

from __future__ import annotations

import math
from collections.abc import Mapping

from knowledge_base.errors import InputError, Place, SchemaError
from knowledge_base.facts import Content

GEOMETRY = "geometry"
MOST_NUMBERS = 16
"""How many numbers a geometry has at most: those of a 4x4 matrix."""

UNSET: Mapping[str, Content] = {"number": 0, "text": "", "boolean": False, GEOMETRY: ()}
"""The types of content (PDDL 3.1's typed results), each with what a function is worth until it is set."""

_SAID = {
    "number": "a number",
    "text": "text",
    "boolean": "true or false",
    GEOMETRY: f"a geometry, a tuple of at most {MOST_NUMBERS} numbers",
}


def require_content(content: object, result: str, what: object, place: Place | None = None) -> None:
    """Raise an error unless `content` is something that a function of this result may be worth.

    Args:
        content: the value.
        result: the type it must be of, one of `UNSET`.
        what: what it is the value of, written only when there is something wrong.
        place: where it is written.

    Raises:
        SchemaError: it is of another type.
        InputError: a number that is not finite, or a text that no file can hold.
    """
    if not _is(content, result):
        raise SchemaError(f"{what} is {_SAID[result]}, not {content!r}", place=place)
    numbers = content if isinstance(content, tuple) else (content,)
    for number in numbers:
        if isinstance(number, str):
            require_writable(number, what, place)
        else:
            require_finite(number, what, place)


def require_writable(text: str, what: object, place: Place | None = None) -> None:
    """Raise `InputError` for a text with half characters (surrogates), for which UTF-8 has nothing."""
    if text.isascii():
        return
    try:
        text.encode()
    except UnicodeEncodeError:
        raise InputError(f"{what} is text that can be written to a file, not {text!a}", place=place) from None


def require_finite(number: float, what: object, place: Place | None = None) -> None:
    """Raise `InputError` for an infinity, for what is no number, and for what no file can hold."""
    try:
        if math.isfinite(number):
            return
    except OverflowError:
        raise InputError(f"{what} is a number of at most 1e308", place=place) from None
    raise InputError(f"{what} is a finite number, not {number}", place=place)


def _is(content: object, result: str) -> bool:
    match result:
        case "number":
            return _is_number(content)
        case "text":
            return isinstance(content, str)
        case "boolean":
            return isinstance(content, bool)
        case _:
            return isinstance(content, tuple) and len(content) <= MOST_NUMBERS and all(map(_is_number, content))


def _is_number(content: object) -> bool:
    return isinstance(content, int | float) and not isinstance(content, bool)
