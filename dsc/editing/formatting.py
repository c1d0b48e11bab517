"""Formatting of YAML texts: blanks at the ends of lines, blank lines, and the end of the text; all else stays."""

from __future__ import annotations

import re
from collections.abc import Iterator

from dsc.editing.surgery.text_edits import TextEdit, patch
from dsc.text.yaml import Spans, load_document
from knowledge_base.errors import InputError

_BLANKS = re.compile(r"[ \t]+(?=\r?$)", re.MULTILINE)
_BLANK_LINES = re.compile(r"(?:^[ \t]*\r?\n)+(?=[ \t]*\r?\n)", re.MULTILINE)
"""Blank lines before another blank line."""
_END = re.compile(r"\s*\Z")


def format_edits(text: str) -> list[TextEdit]:
    """Return the edits that format a text; none for a text that is not read.

    Texts of several lines keep their bytes, as blanks may belong to them.
    """
    spans = Spans()
    try:
        before = load_document(text, spans=spans).data
        outer = {path[:-1] for path in spans.values}
        single = [span for path, span in spans.values.items() if path not in outer]
        kept = [span for span in single if text[span[0]] not in "{[" and "\n" in text[slice(*span)]]
        edits = [one for one in _edits(text) if not any(one.begin < end and begin < one.end for begin, end in kept)]
        return edits if load_document(patch(text, edits)).data == before else []
    except InputError:
        return []


def _edits(text: str) -> Iterator[TextEdit]:
    """Yield edits in the order of the text, none inside another."""
    last = _END.search(text)
    stop = last.start() if last is not None else len(text)
    done = 0
    found = sorted(
        (match.span() for pattern in (_BLANK_LINES, _BLANKS) for match in pattern.finditer(text)),
        key=lambda span: (span[0], -span[1]),
    )
    for begin, end in found:
        if done <= begin and end <= stop:
            yield TextEdit(begin, end, "")
            done = end
    ending = "\r\n" if "\r\n" in text else "\n"
    if stop and text[stop:] != ending:
        yield TextEdit(stop, len(text), ending)
