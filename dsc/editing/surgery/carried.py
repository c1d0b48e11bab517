"""The text of a value on its way to another place: with its comments, in the style of the place."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from dsc.editing.surgery.sheet import Sheet
from dsc.model.reading import FormPath
from dsc.text.yaml import dump, inline
from knowledge_base.errors import InputError


@dataclass(frozen=True, slots=True)
class Carried:
    """A value with its text.

    Attributes:
        head: the text after a colon or dash, up to the end of the line.
        lines: the further lines, each with its line break.
        column: the column of the key or dash; of a mapping or list in lines, the column of its first part.
        in_lines: whether the value is a mapping or list without brackets.
        flow: the text of the value for a place inside brackets; `None` if its comments have no place there.
        above: the comments directly above the entry, each without indentation and line break.
    """

    head: str
    lines: tuple[str, ...]
    column: int
    in_lines: bool
    flow: str | None
    above: tuple[str, ...] = ()

    @classmethod
    def of_data(cls, value: Any) -> Carried:
        """Return a new value in the style of the project."""
        flow = inline(value)
        text = dump({_KEY: value})
        if not text.startswith(f"{_KEY}:\n"):
            return cls(f" {flow}", (), 0, in_lines=False, flow=flow)
        lines = text.splitlines(keepends=True)[1:]
        return cls("", tuple(lines), len(lines[0]) - len(lines[0].lstrip()), in_lines=True, flow=flow)

    @classmethod
    def of_entry(cls, sheet: Sheet, path: FormPath) -> Carried:
        """Return the value of an entry of a text."""
        begin, end = sheet.spans.values[path]
        flow = sheet.flow_text(path)
        if sheet.in_brackets(path[:-1]):
            head, *lines = f" {flow}".splitlines(keepends=True)
            return cls(head, tuple(lines), sheet.indentation(begin), in_lines=False, flow=flow)
        start, stop = sheet.value_begin(path), sheet.stop(path)
        bracketed = flow == sheet.text[begin:end]
        is_commented = sheet.has_comment(start, begin) or sheet.has_comment(end if bracketed else begin, stop)
        kept = None if is_commented else flow
        if not sheet.in_lines(path):
            head, *lines = sheet.text[start:stop].splitlines(keepends=True) or [""]
            return cls(head, tuple(lines), sheet.column(sheet.begin(path)), in_lines=False, flow=kept)
        if sheet.line_start(begin) == sheet.line_start(start):
            text = "\n" + " " * sheet.column(begin) + sheet.text[begin:stop]
        else:
            text = sheet.text[start:stop]
        head, *lines = text.splitlines(keepends=True)
        return cls(head.rstrip(), tuple(lines), sheet.column(begin), in_lines=True, flow=kept)

    @classmethod
    def of_part(cls, sheet: Sheet, path: FormPath) -> Carried:
        """Return an entry of a text with the comments that move with it."""
        carried = cls.of_entry(sheet, path)
        if sheet.in_brackets(path[:-1]):
            return carried
        above = sheet.text[sheet.lead(path) : sheet.begin(path)].splitlines()
        comments = tuple(one.strip() for one in above if one.strip())
        return replace(carried, above=comments, flow=None) if comments else carried

    def inside(self, key: str | int, *, is_item: bool) -> Carried:
        """Return a mapping or list whose only entry is this value."""
        flow = None
        if self.flow is not None:
            entry = self.flow_entry(key, is_item=is_item)
            flow = f"[{entry}]" if is_item else f"{{{entry}}}"
            if not self.in_lines and not self.lines and self.flow[:1] not in {"{", "["}:
                return Carried(f" {flow}", (), 0, in_lines=False, flow=flow)
        lines = f"{self.entry(key, is_item=is_item, column=0)}\n".splitlines(keepends=True)
        return Carried("", tuple(lines), 0, in_lines=True, flow=flow)

    def entry(self, key: str | int, *, is_item: bool, column: int) -> str:
        """Return the lines of an entry at a column, without the indentation of the first line and the last break."""
        above = "".join(f"{one}\n{' ' * column}" for one in self.above)
        return above + ("-" if is_item else f"{inline(key)}:") + self.value(is_item=is_item, column=column)

    def value(self, *, is_item: bool, column: int) -> str:
        """Return the text after the colon or dash of an entry at a column, without the last break."""
        if not self.in_lines:
            return (self.head + self._shift(column - self.column)).rstrip("\r\n")
        body = self._shift(column + 2 - self.column).rstrip("\r\n")
        if is_item and not self.head.strip() and not body.lstrip().startswith("#"):
            return f" {body.lstrip()}"
        return f"{self.head}\n{body}"

    def flow_entry(self, key: str | int, *, is_item: bool) -> str:
        """Return the entry inside brackets.

        Raises:
            InputError: the value has comments, which brackets would end.
        """
        if self.flow is None:
            raise InputError("the part has comments, for which there is no place inside brackets")
        return self.flow if is_item else f"{inline(key)}: {self.flow}"

    def _shift(self, by: int) -> str:
        return "".join(" " * by + one if by > 0 and one.strip() else _dedent(one, -by) for one in self.lines)


_KEY = "key"


def _dedent(line: str, by: int) -> str:
    return line[min(by, len(line) - len(line.lstrip(" "))) :] if by > 0 else line
