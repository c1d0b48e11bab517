"""Words that a rename leaves to the author: in Python code, and in texts whose meaning only a program knows."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from dsc.editing.disk import Disk
from dsc.editing.kinds import Kind
from dsc.editing.names import Occurrence
from dsc.editing.workspace import Page
from dsc.text.yaml import Span
from knowledge_base.pddl.unsaved_texts import readable_text

_KNOWN = frozenset({Kind.PLOT, Kind.PROFILE})
"""Kinds of files in which each name has a known place."""


def lines_in_python(root: Path, pattern: str) -> Iterator[tuple[Path, int]]:
    """Yield file and line, from 1, of each line of a folder's Python code that has a pattern."""
    found = re.compile(pattern)
    for file in sorted(Disk().files_in(root, {".py"})):
        for number, line in enumerate(readable_text(file).splitlines(), 1):
            if found.search(line):
                yield file, number


def lines_in_texts(pages: Iterable[Page], name: str, renamed: list[tuple[Page, Occurrence]]) -> list[tuple[Path, int]]:
    """Return file and line, from 1, of each value or key that has a name as a word, and that is not renamed.

    Among the values of plots and profiles, these are texts without another meaning that are the name, or quote it.
    """
    changed = {(page.file, one.begin) for page, one in renamed}
    found = set[tuple[Path, int]]()
    for page in pages:
        named = {(page.file, one.begin) for one in page.names} if page.kind in _KNOWN else set()
        quoted = rf"""^["']*{re.escape(name)}["']*$|"{re.escape(name)}\\?\""""
        whole = rf"(?<![\w\-]){re.escape(name)}(?![\w\-])"
        pattern = re.compile(whole if page.kind is Kind.SCENARIO else quoted)
        for begin, end in _spans(page):
            for match in pattern.finditer(page.text[begin:end]):
                at = begin + match.start() + match[0].index(name)
                if not {(page.file, each) for each in (at, begin, at - 1)} & (changed | named):
                    found.add((page.file, page.text.count("\n", 0, at) + 1))
    return sorted(found)


def _spans(page: Page) -> Iterator[Span]:
    """Yield the spans of single values; in files whose keys may be names, also those of keys."""
    outer = {path[:-1] for path in page.spans.values}
    yield from (span for path, span in page.spans.values.items() if path not in outer and path[-1:] != ("about",))
    if page.kind not in _KNOWN:
        yield from page.spans.keys.values()
