"""Origins of texts: a file, or the literal of a program that passes the text to this project."""

from __future__ import annotations

import linecache
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from knowledge_base.errors import Place
from knowledge_base.tracebacks import calling_place

_PROJECT = tuple(f"{Path(__file__).parents[1] / package}{os.sep}" for package in ("knowledge_base", "dsc", "planning"))


@dataclass(frozen=True, slots=True)
class Origin:
    """The beginning of a text in a file; by default, the text is a whole file.

    Attributes:
        source: name of the file; `None` if it is unknown.
        line, column: place of the first character, from 1.
        indent: number of characters in the file before each later line, e.g. if `textwrap.dedent` has removed them.
    """

    source: str | None = None
    line: int = 1
    column: int = 1
    indent: int = 0

    def place(self, line: int, column: int) -> Place:
        """Return the place in the file of a line and column of the text, which count from 1."""
        before = self.column - 1 if line == 1 else self.indent
        return Place(self.source, self.line + line - 1, before + column)


def origin_of(text: str, source: str | None) -> Origin:
    """Return the origin of a text, which is the whole file `source`, or a literal in the file of the caller.

    The caller is the innermost line of the stack outside of this project. A text that its file does not contain line by
    line has an unknown origin, e.g. one with escapes.
    """
    caller = calling_place(*_PROJECT) if source is None else None
    if caller is None or caller.source is None or not os.path.isfile(caller.source):  # noqa: PTH113  # it is fast
        return Origin(source)
    lines, program = text.split("\n"), linecache.getlines(caller.source)
    written = [number for number, line in enumerate(lines) if line.strip()]
    starts = _find([lines[number] for number in range(written[0], written[-1] + 1)], program) if written else []
    if not starts:
        return Origin()
    called = caller.line or 1
    above = min(starts, key=lambda start: abs(start + 1 - called)) - written[0]
    shifts = {number: _indent(program[above + number], lines[number]) for number in written}
    return Origin(caller.source, above + 1, shifts.pop(0, 0) + 1, next(iter(shifts.values()), 0))


def _find(lines: Sequence[str], program: Sequence[str]) -> list[int]:
    """Return the numbers, from 0, of the lines at which a program has these lines; indentation may differ.

    In the program, other text may precede the first line and follow the last line.
    """
    first, *others = (line.strip() for line in lines)
    found = [start for start, line in enumerate(program) if first in line]
    if not others:
        return found
    *inside, last = others
    return [
        start
        for start in found
        if program[start].rstrip().endswith(first)
        and [line.strip() for line in program[start + 1 : start + len(others)]] == inside
        and "".join(program[start + len(others) : start + len(lines)]).strip().startswith(last)
    ]


def _indent(written: str, line: str) -> int:
    """Return by how many characters a line is further right in the program than in the text."""
    content = line.strip()
    at = written.rindex(content) if written.rstrip().endswith(content) else written.index(content)
    return at - line.index(content)
