"""Findings as diagnostics of an editor: ranges, severities, links and quick fixes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dsc.editing.lines import Lines, Spot
from dsc.errors import Finding

_WORD = re.compile(r"""[^\s()\[\]{},:"']+|\S""")
_NAME_PART = re.compile(r"[\w.-]")
_LINES_AFTER = 3
"""Lines from the place of a finding in which its wrong word may be: the value follows the key at the place."""


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """A finding in a text of an editor.

    Attributes:
        start, end: the range; the end is behind the last character.
        text: the mistake with its remedy.
        code: one of `dsc.codes`.
        level: `error` or `warning`.
        found: the wrong word, if any.
        nearest: the valid name that is closest to the wrong word, which a quick fix writes.
    """

    start: Spot
    end: Spot
    text: str
    code: str
    level: str
    found: str | None = None
    nearest: str | None = None


@dataclass(frozen=True, slots=True)
class FileFinding:
    """A finding with its file, which another process may have written as JSON; lines and columns count from 1."""

    file: str
    line: int | None
    column: int | None
    text: str
    code: str
    level: str
    found: str | None = None
    nearest: str | None = None

    @classmethod
    def of(cls, finding: Finding, file: Path) -> FileFinding:
        """Return a finding; `file` is the checked file, for a finding without a place."""
        error, place = finding.error, finding.place
        source = place.source if place is not None and place.source else str(file)
        line, column = (None, None) if place is None else (place.line, place.column)
        return cls(source, line, column, finding.text, finding.code, finding.level, error.found, error.nearest)

    @classmethod
    def read(cls, form: Mapping[str, Any], root: Path) -> FileFinding:
        """Return a finding in JSON data; `root` is the folder of relative paths."""
        return cls(**{**form, "file": str(root / form["file"])})


def diagnostics(findings: Iterable[FileFinding], text: str) -> list[Diagnostic]:
    """Return the findings about a file with this text as diagnostics, equal ones once."""
    lines = Lines(text)
    return list(dict.fromkeys(_diagnostic(one, lines) for one in findings))


def by_file(findings: Iterable[FileFinding], home: Callable[[str], str]) -> dict[str, list[FileFinding]]:
    """Return the findings by file; `home` returns the file that stands for a source, e.g. for a folder."""
    found: dict[str, list[FileFinding]] = {}
    for one in findings:
        found.setdefault(home(one.file), []).append(one)
    return found


def on_same_lines(findings: Iterable[FileFinding], before: str, now: str) -> list[FileFinding]:
    """Return the findings whose lines have the text that they had when the findings were made."""
    old, new = Lines(before), Lines(now)
    return [one for one in findings if one.line is None or old.line(one.line - 1) == new.line(one.line - 1)]


def _diagnostic(finding: FileFinding, lines: Lines) -> Diagnostic:
    begin, end = _span(finding, lines)
    said = finding.text, finding.code, finding.level, finding.found, finding.nearest
    return Diagnostic(lines.spot(begin), lines.spot(end), *said)


def _span(finding: FileFinding, lines: Lines) -> tuple[int, int]:
    """Return begin and end of the wrong word, else of the word at the place, else of the line."""
    number = max(0, (finding.line or 1) - 1)
    start = lines.start(number)
    line = lines.line(number)
    at = start + min(max(0, (finding.column or 1) - 1), len(line))
    if finding.found:
        end = lines.start(number + _LINES_AFTER)
        found = _whole_word(finding.found, lines.text, at, end)
        if found is not None:
            return found
    word = _WORD.match(lines.text, at) if finding.column else None
    if word is not None:
        return word.span()
    indent = len(line) - len(line.lstrip())
    return start + min(indent, len(line)), start + len(line.rstrip())


def _whole_word(word: str, text: str, begin: int, end: int) -> tuple[int, int] | None:
    """Return the span of the first whole word in a part of a text; `None` if the part lacks the word."""
    at = text.find(word, begin, end)
    while at >= 0:
        after = at + len(word)
        if not _NAME_PART.match(text[at - 1 : at]) and not _NAME_PART.match(text[after : after + 1]):
            return at, after
        at = text.find(word, at + 1, end)
    return None
