"""Origins of texts: a file, or the literal of a program that passes the text to this project."""

from __future__ import annotations

import ast
import os
import tokenize
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from knowledge_base.errors import Place
from knowledge_base.tracebacks import PROJECT, calling_place, is_program


@dataclass(frozen=True, slots=True)
class Origin:
    """The beginning of a text in a file; by default, the text is a whole file.

    Attributes:
        source: name of the file; `None` if it is unknown.
        line, column: place of the first character, from 1.
        indent: number of characters in the file before each later line, e.g. if `textwrap.dedent` has removed them.
        whole: whether only the line of the whole text is known, because its lines differ from those of the file.
    """

    source: str | None = None
    line: int = 1
    column: int = 1
    indent: int = 0
    whole: bool = False

    def place(self, line: int, column: int) -> Place:
        """Return the place in the file of a line and column of the text, which count from 1."""
        if self.whole:
            return Place(self.source, self.line)
        before = self.column - 1 if line == 1 else self.indent
        return Place(self.source, self.line + line - 1, max(before + column, 1))


def origin_of(text: str, source: str | None) -> Origin:
    """Return the origin of a text, which is the whole file `source`, or a literal in the file of the caller.

    The caller is the innermost line of the stack outside of this project. If the file has several literals with that
    text, the nearest one is meant. The indentation may differ. A text that the program computes has an unknown origin.
    """
    caller = calling_place(*PROJECT) if source is None and isinstance(text, str) else None
    if caller is None or caller.source is None or not is_program(caller.source):
        return Origin(source)
    try:
        changed = os.stat(caller.source)  # noqa: PTH116  # it is fast
    except OSError:  # e.g. a notebook
        return Origin()
    program = _literals(caller.source, changed.st_mtime_ns, changed.st_size)
    found = program.get(_key(text), ()) if text.strip() else ()
    called = caller.line or 1
    literal = min(found, key=lambda one: abs(one.line - called), default=None)
    return Origin() if literal is None else literal.origin(text, caller.source)


class _Literal(NamedTuple):
    """A text in a program: its line, its offset in this line in bytes, and the lines that contain it."""

    line: int
    offset: int
    lines: Sequence[str]

    def origin(self, text: str, source: str) -> Origin:
        """Return the origin of the text, which has the same content as this literal."""
        written = [(number, one.strip(), one) for number, one in enumerate(text.split("\n")) if one.strip()]
        first, start = written[0][0], len(self.lines[0].encode()[: self.offset].decode())

        def column_of(content: str, number: int) -> int:
            """Return the column, from 0, of a line of the text in a line of the program; -1 if it is missing."""
            there = self.lines[number : number + 1]
            return there[0].find(content, start if number == 0 else 0) if there else -1

        begins = next((number for number in range(len(self.lines)) if column_of(written[0][1], number) >= 0), 0)
        columns = [column_of(content, begins + number - first) for number, content, _ in written]
        if min(columns) < 0:  # e.g. a line break that is written as an escape
            return Origin(source, self.line, whole=True)
        shifts = [column - one.index(content) for column, (_, content, one) in zip(columns, written, strict=True)]
        own, later = (1, shifts[0]) if first else (shifts[0] + 1, next(iter(shifts[1:]), 0))
        return Origin(source, self.line + begins - first, own, later)


@lru_cache(maxsize=64)
def _literals(file: str, changed: int, size: int) -> Mapping[str, Sequence[_Literal]]:  # noqa: ARG001  the file's state
    """Return the literals of a program by `_key`."""
    try:
        with tokenize.open(file) as stream:
            text = stream.read()
        tree = parse_program(text)
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):
        return {}
    lines, found = text.split("\n"), dict[str, list[_Literal]]()
    for node in _constants(tree):
        literal = _Literal(node.lineno, node.col_offset, lines[node.lineno - 1 : node.end_lineno])
        found.setdefault(_key(str(node.value)), []).append(literal)
    return found


def parse_program(text: str) -> ast.Module:
    """Return the syntax tree of a program; errors as for `ast.parse`."""
    try:
        return ast.parse(text)
    except SystemError:  # finalizers that run during it confuse its counter (CPython issue 106905)
        return ast.parse(text)


def _constants(tree: ast.Module) -> Iterator[ast.Constant]:
    """Yield the texts of a program, without the parts of f-strings."""
    parts = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in ast.walk(node)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in parts:
            yield node


def _key(text: str) -> str:
    """Return the lines of a text without indentation and without empty lines around them."""
    return "\n".join(line.strip() for line in text.split("\n")).strip("\n")
