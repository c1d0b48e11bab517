"""Identifiers of both target languages for the names of a plot."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable

_C_WORDS = frozenset({
    "auto", "bool", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum", "extern",
    "false", "float", "for", "goto", "if", "inline", "int", "long", "register", "restrict", "return", "short", "signed",
    "sizeof", "static", "struct", "switch", "true", "typedef", "union", "unsigned", "void", "volatile", "while",
})  # fmt: skip
_TAKEN = frozenset({"self", "host", "now_ns"})
"""Names of other parameters of a controller's functions."""


def identifier(name: str) -> str:
    """Return a name as an identifier of Python and C."""
    text = re.sub(r"\W", "_", name, flags=re.ASCII) or "_"
    if text[0].isdigit():
        text = f"_{text}"
    is_word = text in _C_WORDS or text in _TAKEN or keyword.iskeyword(text) or keyword.issoftkeyword(text)
    return f"{text}_" if is_word else text


def by_name(names: Iterable[str]) -> dict[str, str]:
    """Return the identifiers of names, by name."""
    known = [*names]
    return dict(zip(known, identifiers(known), strict=True))


def identifiers(names: Iterable[str], *, upper: bool = False) -> list[str]:
    """Return an identifier for each name; later names that would have the same one get a number."""
    found: list[str] = []
    for name in names:
        text = base = identifier(name).upper() if upper else identifier(name)
        number = 2
        while text in found:
            text, number = f"{base}_{number}", number + 1
        found.append(text)
    return found
