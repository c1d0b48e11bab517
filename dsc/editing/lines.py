r"""Positions in a text: offsets in characters, and lines with columns in UTF-16 units, as editors count them.

The Language Server Protocol 3.17 ("Position") counts columns in UTF-16 code units by default, and ends lines with
`\n`, `\r\n` or `\r`.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from typing import NamedTuple

_END = re.compile(r"\r\n|\n|\r")


class Spot(NamedTuple):
    """A position of an editor; line and column count from 0, and columns are UTF-16 units."""

    line: int
    column: int


class Lines:
    """The lines of a text.

    Args:
        text: the whole text.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self._starts = [0, *(end.end() for end in _END.finditer(text))]

    def offset(self, spot: Spot) -> int:
        """Return the offset of a position; a position outside the text becomes the nearest one inside."""
        if spot.line >= len(self._starts):
            return len(self.text)
        line = self.line(spot.line)
        units, at = 0, 0
        while at < len(line) and units < spot.column:
            units += _units(line[at])
            at += 1
        return self._starts[max(0, spot.line)] + at

    def spot(self, offset: int) -> Spot:
        """Return the position of an offset between 0 and the length of the text."""
        number = bisect_right(self._starts, offset) - 1
        start = self._starts[number]
        return Spot(number, sum(map(_units, self.text[start:offset])))

    def line(self, number: int) -> str:
        """Return a line without its end; numbers count from 0. A line after the last one is empty."""
        if not 0 <= number < len(self._starts):
            return ""
        end = self._starts[number + 1] if number + 1 < len(self._starts) else len(self.text)
        return self.text[self._starts[number] : end].rstrip("\r\n")

    def start(self, number: int) -> int:
        """Return the offset at which a line begins; a line after the last one begins at the end of the text."""
        return self._starts[number] if number < len(self._starts) else len(self.text)


def _units(character: str) -> int:
    return 2 if ord(character) > 0xFFFF else 1
