"""Edits of a text as values: the lines in which two texts differ."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import SequenceMatcher

_LINE = re.compile(r"[^\n]*\n|[^\n]+")


@dataclass(frozen=True, slots=True)
class TextEdit:
    """A replacement of one span of a text.

    Attributes:
        begin, end: the span, as offsets in characters.
        text: the new text of the span.
    """

    begin: int
    end: int
    text: str


def patch(text: str, edits: Iterable[TextEdit]) -> str:
    """Return a text after edits, whose spans do not overlap; offsets count in the text before all edits."""
    for one in sorted(edits, key=lambda one: (one.begin, one.end), reverse=True):
        text = text[: one.begin] + one.text + text[one.end :]
    return text


def differences(before: str, after: str) -> tuple[TextEdit, ...]:
    """Return the edits of whole lines that turn one text into another; `differences(after, before)` undoes them."""
    old, new = _LINE.findall(before), _LINE.findall(after)
    starts = [0]
    for line in old:
        starts.append(starts[-1] + len(line))
    found = SequenceMatcher(None, old, new, autojunk=False).get_opcodes()
    return tuple(
        TextEdit(starts[first], starts[last], "".join(new[begin:end]))
        for tag, first, last, begin, end in found
        if tag != "equal"
    )
