"""The text of a plot file with its data, and the extents of its parts in lines and brackets."""

from __future__ import annotations

import re
from typing import Any

from dsc.editing.surgery.edits import part
from dsc.model.reading import FormPath
from dsc.text.yaml import Spans, inline, load_document

_COLON = re.compile(r"[^\S\n]*:")
_OWN_COMMENT = re.compile(r"( *)#[^\n]*(?:\n|$)")


class Sheet:
    """A text with its data; the text of an entry has key and value, or the dash and value of an item.

    Args:
        text: YAML.
        source: the file in messages.

    Raises:
        InputError: the text is not read.
    """

    def __init__(self, text: str, source: str | None = None) -> None:
        self.text = text
        self.spans = Spans()
        self.document = load_document(text, source, self.spans)
        self.data: Any = self.document.data

    def in_brackets(self, path: FormPath) -> bool:
        """Return whether a mapping or list has brackets."""
        return self.text[self.spans.values[path][0] :][:1] in {"{", "["}

    def in_lines(self, path: FormPath) -> bool:
        """Return whether a part is a mapping or list without brackets."""
        return isinstance(part(self.data, path), dict | list) and not self.in_brackets(path)

    def begin(self, path: FormPath) -> int:
        """Return where an entry begins: at its key, at the dash of an item, else at the value."""
        if path in self.spans.keys:
            return self.spans.keys[path][0]
        value = self.spans.values[path][0]
        if self.in_brackets(path[:-1]):
            return value
        first = self.spans.values[path[:-1]][0]
        at = self.text.rfind("-", first, value)
        while self.column(at) != self.column(first):
            at = self.text.rfind("-", first, at)
        return at

    def value_begin(self, path: FormPath) -> int:
        """Return where the text after the colon or dash of an entry begins."""
        if path not in self.spans.keys:
            return self.begin(path) + (not self.in_brackets(path[:-1]))
        return self._after_colon(self.spans.keys[path][1])

    def end(self, path: FormPath) -> int:
        """Return where an entry ends; the colon before an empty value belongs to the entry."""
        begin, end = self.spans.values[path]
        inside = part(self.data, path)
        if inside and self.in_lines(path):
            return self.end((*path, [*inside][-1] if isinstance(inside, dict) else len(inside) - 1))
        return self._after_colon(end) if begin == end and path in self.spans.keys else end

    def stop(self, path: FormPath) -> int:
        """Return the begin of the line after an entry in lines; comments with a deeper indentation belong to it."""
        end = self.end(path)
        stop = end if self.text[:end].endswith("\n") else self._next_line(end)
        depth = self.column(self.begin(path))
        while (found := _OWN_COMMENT.match(self.text, stop)) and len(found[1]) > depth:
            stop = found.end()
        return stop

    def lead(self, path: FormPath) -> int:
        """Return where an entry in lines begins with its comments: those directly above, at its column."""
        begin = self.begin(path)
        if not self.owns_line(path):
            return begin
        column, lead = self.column(begin), self.line_start(begin)
        while lead and (found := _OWN_COMMENT.fullmatch(self.text, self.line_start(lead - 1), lead)):
            at = found.end(1)
            if len(found[1]) != column or not self.has_comment(at, at + 1):
                break
            lead = found.start()
        return lead

    def column(self, offset: int) -> int:
        """Return the number of characters before an offset in its line."""
        return offset - self.line_start(offset)

    def line_start(self, offset: int) -> int:
        """Return where the line of an offset begins."""
        return self.text.rfind("\n", 0, offset) + 1

    def owns_line(self, path: FormPath) -> bool:
        """Return whether only spaces precede an entry in its line."""
        begin = self.begin(path)
        return not self.text[self.line_start(begin) : begin].strip()

    def rest_of_line(self, offset: int) -> str:
        """Return the text from an offset to the end of the line, without the line break."""
        return self.text[offset : self._next_line(offset)].rstrip("\r\n")

    def indentation(self, offset: int) -> int:
        """Return the number of spaces at the begin of the line of an offset."""
        line = self.text[self.line_start(offset) : offset]
        return len(line) - len(line.lstrip(" "))

    def flow_text(self, path: FormPath) -> str:
        """Return the text of a value for a place inside brackets: as it is written, or else its data in one line."""
        begin, end = self.spans.values[path]
        text, value = self.text[begin:end], part(self.data, path)
        is_scalar = not isinstance(value, dict | list)
        if text[:1] in {"'", '"'} if is_scalar else self.in_brackets(path):
            return text
        return text if text and is_scalar and self.in_brackets(path[:-1]) else inline(value)

    def has_comment(self, begin: int, end: int) -> bool:
        """Return whether a span has a comment."""
        scalars = [*self.spans.keys.values()]
        scalars += [
            span for path, span in self.spans.values.items() if not isinstance(part(self.data, path), dict | list)
        ]
        return any(
            not any(first <= at < last for first, last in scalars) for at in range(begin, end) if self.text[at] == "#"
        )

    def siblings(self, path: FormPath) -> tuple[FormPath | None, FormPath | None]:
        """Return the paths of the entries before and after an entry."""
        around, inside = path[:-1], part(self.data, path[:-1])
        keys = [*inside] if isinstance(inside, dict) else list(range(len(inside)))
        at = keys.index(path[-1])
        before = (*around, keys[at - 1]) if at else None
        return before, (*around, keys[at + 1]) if at + 1 < len(keys) else None

    def _next_line(self, offset: int) -> int:
        found = self.text.find("\n", offset)
        return len(self.text) if found < 0 else found + 1

    def _after_colon(self, offset: int) -> int:
        found = _COLON.match(self.text, offset)
        return offset if found is None else found.end()
