"""How values are spelt in the language: which names need no quotes, and a value as text that is read back as it is."""

from __future__ import annotations

import re
from collections.abc import Mapping

# What can be written without quotes and is read back as the same text (names are folded to lower case).
_PLAIN_NAME = re.compile(r"[^\s()\";?:]+[^\s()\";?]*")
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?")
TRUTH_VALUES: Mapping[str, bool] = {"true": True, "false": False}
"""The two words that are read as truth values, not as names."""


def is_number(text: str) -> bool:
    """Whether `text` is written as a number: `3`, `-0.5`, `1e-3`."""
    return _NUMBER.fullmatch(text) is not None


def is_plain_name(text: str) -> bool:
    """Whether `text` is a name that needs no quotes: lower case, no blanks, no number, no truth value."""
    return (
        _PLAIN_NAME.fullmatch(text) is not None
        and text == text.lower()
        and not is_number(text)
        and text not in TRUTH_VALUES
        and text != "-"
    )


def value_text(value: str | float | tuple[float, ...], *, quoted: bool = False) -> str:
    """A value as the language writes it: `cup1`, `0.5`, `true`, `"red cup"`, `(geometry 0.4 0.1)`."""
    if isinstance(value, tuple):
        return "(" + " ".join(["geometry", *map(value_text, value)]) + ")"
    if isinstance(value, bool):
        return "true" if value else "false"
    if not isinstance(value, str):
        return repr(value)
    if not quoted and is_plain_name(value):
        return value
    escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
