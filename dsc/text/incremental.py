"""Incremental reader of YAML: an edit of a long plot costs the reading of the changed state, not of the whole text.

The text is cut before each key of the outermost mapping, and before each key directly under `states`. A piece that is
YAML by itself, with one key, has the same content inside the whole text; the pieces of one mapping have equal
indentation. Any other text is read as a whole, so that the result always equals that of `load_document`.
"""

from __future__ import annotations

import re
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from dsc.model.reading import FormPath
from dsc.text.yaml import MAX_PARTS, Document, Spans, check_size, load_document
from knowledge_base.errors import InputError, Place

MOST_PIECES = 20_000
"""Maximum number of pieces whose content is stored."""
_STATES = re.compile(r"states:[ ]*(#[^\n]*)?\n")
_LINE = re.compile(r"(?P<indent> *)(?P<rest>[^\n]*)\n?")
_KEY = re.compile(r"[A-Za-z_][\w.\-]*:(\s|$)")
_EMPTY_ITEM = re.compile(r"^\s*-\s*(#|$)", re.MULTILINE)
_UNUSUAL_BREAK = re.compile("[\r\x85\u2028\u2029\ufeff]")


class _Read(NamedTuple):
    """A piece as read: its key, and its parts with places in the piece."""

    key: str
    value: Any
    places: Mapping[FormPath, Place]
    spans: Spans


class _Piece(NamedTuple):
    """A piece of the text: its place, and whether it belongs to the mapping of states."""

    text: str
    start: int
    line: int
    state: bool


class IncrementalReader:
    """Reader of versions of the same texts; it stores the content of their pieces."""

    def __init__(self) -> None:
        self._known: OrderedDict[str, _Read | None] = OrderedDict()

    def load(self, text: str, source: str | None = None) -> tuple[Document, Spans]:
        """Return the document in a text, and the spans of its parts; results and errors as for `load_document`."""
        check_size(len(text), Place(source))
        return self._join(text, source) or _whole(text, source)

    def _join(self, text: str, source: str | None) -> tuple[Document, Spans] | None:
        """Return the document of a text that is read in pieces; `None` for any other text."""
        pieces = None if _UNUSUAL_BREAK.search(text) else _cut(text)
        if not pieces:
            return None
        first = pieces[0]
        data: dict[str | int, Any] = {}
        spans = Spans()
        places: dict[FormPath, Place] = {(): Place(source, first.line + 1, 1)}
        for piece in pieces:
            read = self._read(piece.text)
            if read is None:
                return None
            path: FormPath = ("states",) if piece.state else ()
            into = data["states"] if piece.state else data
            if into is None:  # the first state of the piece `states:`
                into = data["states"] = {}
            if read.key in into:
                return None
            into[read.key] = read.value
            _add(read, piece, path, source, places, spans)
        if len(spans.keys) + len(spans.values) + 2 > MAX_PARTS:
            return None
        states = [span for path, span in spans.values.items() if len(path) == 2 and path[0] == "states"]
        if any(piece.state for piece in pieces):
            spans.values["states",] = (spans.keys["states", next(iter(data["states"]))][0], max(states)[1])
        spans.values[()] = (first.start, max(end for _, end in spans.values.values()))
        return Document(data, places), spans

    def _read(self, text: str) -> _Read | None:
        """Return the content of a piece; `None` if it is not one key by itself."""
        if text not in self._known:
            self._known[text] = _piece(text)
            if len(self._known) > MOST_PIECES:
                self._known.popitem(last=False)
        else:
            self._known.move_to_end(text)
        return self._known[text]


def _piece(text: str) -> _Read | None:
    if _EMPTY_ITEM.search(text):  # it has the place of the next part, perhaps in another piece
        return None
    spans = Spans()
    try:
        document = load_document(text, None, spans)
    except InputError:
        return None
    if not isinstance(document.data, dict) or len(document.data) != 1:
        return None
    ((key, value),) = document.data.items()
    return _Read(str(key), value, document.places, spans) if isinstance(key, str) else None


def _whole(text: str, source: str | None) -> tuple[Document, Spans]:
    spans = Spans()
    return load_document(text, source, spans), spans


def _add(
    read: _Read, piece: _Piece, path: FormPath, source: str | None, places: dict[FormPath, Place], spans: Spans
) -> None:
    """Add the places and spans of a piece to those of the text."""
    for inside, place in read.places.items():
        if inside:
            places[(*path, *inside)] = Place(source, piece.line + (place.line or 0), place.column)
    for own, whole in ((read.spans.keys, spans.keys), (read.spans.values, spans.values)):
        for inside, (begin, end) in own.items():
            if inside:
                whole[(*path, *inside)] = (piece.start + begin, piece.start + end)


def _cut(text: str) -> list[_Piece] | None:
    """Return the pieces of a text in order; `None` if a line begins none of them and is outside of all."""
    pieces: list[_Piece] = []
    for piece in _blocks(text, 0, 0, 0, state=False):
        if piece is None:
            return None
        head = _STATES.match(piece.text)
        inside = None if head is None else _states(piece, head.end())
        if inside is None:
            pieces.append(piece)
        else:
            pieces += inside
    return pieces


def _states(piece: _Piece, begin: int) -> list[_Piece] | None:
    """Return the pieces of the block `states`; `None` if it is not a mapping in lines."""
    first = next((m for m in _LINE.finditer(piece.text, begin) if _has_content(m)), None)
    if first is None or not first["indent"]:
        return None
    body = piece.text[begin:]
    found: list[_Piece] = [_Piece(piece.text[:begin], piece.start, piece.line, state=False)]
    for one in _blocks(body, len(first["indent"]), piece.start + begin, piece.line + 1, state=True):
        if one is None:
            return None
        found.append(one)
    return found


def _blocks(text: str, indent: int, start: int, line: int, *, state: bool) -> Iterator[_Piece | None]:
    """Yield the blocks of lines that begin with a key at an indentation; `None` for another line of that depth.

    Comments and empty lines belong to the block before them, as the text of a block scalar may.
    """
    begin, first = 0, 0
    begun = False
    for number, match in enumerate(_LINE.finditer(text)):
        inside = begun and len(match["indent"]) > indent
        if match.start() == len(text) or not _has_content(match) or inside:
            continue
        if len(match["indent"]) != indent or _KEY.match(match["rest"]) is None:
            yield None
            return
        if begun:
            yield _Piece(text[begin : match.start()], start + begin, line + first, state)
        begin, first, begun = match.start(), number, True
    if begun:
        yield _Piece(text[begin:], start + begin, line + first, state)


def _has_content(match: re.Match[str]) -> bool:
    return match["rest"].strip() != "" and not match["rest"].startswith("#")
