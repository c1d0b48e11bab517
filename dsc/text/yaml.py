"""Reader and writer of YAML 1.2 for plots and scenarios; the reader records places and refuses error-prone features.

Refused are duplicate keys, tags, anchors, aliases and merge keys, and texts that are too large or nested too deeply for
a plot. Scalars follow the core schema of YAML 1.2 (10.3): `yes`, `off`, `1_000` and `2024-01-01` are text. Every error
has file, line and column. One pass over the parser's events builds the data, in time proportional to their size.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    Event,
    MappingEndEvent,
    MappingStartEvent,
    NodeEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)
from ruamel.yaml.reader import ReaderError
from ruamel.yaml.scalarstring import DoubleQuotedScalarString
from ruamel.yaml.scanner import Scanner, ScannerError

from dsc.model.reading import FormPath, in_yaml, misread
from knowledge_base.errors import InputError, ParseError, Place
from knowledge_base.language.checking.inputs import require_text
from knowledge_base.origin import Origin
from knowledge_base.pddl.files import read_text, require_size
from knowledge_base.user_objects import shown

MAX_DEPTH = 128
MAX_PARTS = 18_000
"""Upper bound of keys, values and collections in a document.

A plot of 1,000 states has 16,000 of these parts; they are read and checked within a second.
"""

_SPACES = "\0 \t\r\n\x85\u2028\u2029"


class _Scanner(Scanner):
    """Scanner that reads `{table: ?table}` as YAML 1.2 does (7.3.3): `?` before a non-space begins a plain scalar.

    Inside braces, the library's scanner follows YAML 1.1, where `?` always begins a complex key.
    """

    def check_key(self) -> Any:
        return self.reader.peek(1) in _SPACES

    def check_plain(self) -> Any:
        if self.reader.peek() == "?":
            return self.reader.peek(1) not in _SPACES
        return super().check_plain()

    def fetch_flow_collection_start(self, *args: Any, **named: Any) -> None:
        if self.flow_level > MAX_DEPTH:  # the search for a key takes longer at each level
            raise ScannerError(None, None, _TOO_DEEP, self.reader.get_mark())
        super().fetch_flow_collection_start(*args, **named)

    def scan_yaml_directive_number(self, *args: Any) -> Any:
        try:
            return super().scan_yaml_directive_number(*args)
        except ValueError:
            raise ScannerError(None, None, "the version is too long", self.reader.get_mark()) from None

    def scan_flow_scalar_non_spaces(self, *args: Any) -> Any:
        try:
            return super().scan_flow_scalar_non_spaces(*args)
        except (ValueError, OverflowError):
            problem = "an escape that stands for no character"
            raise ScannerError(None, None, problem, self.reader.get_mark()) from None


_TOO_DEEP = f"nested deeper than {MAX_DEPTH} levels"


@dataclass(frozen=True, slots=True)
class Document:
    """A YAML file as plain data.

    Attributes:
        data: the content as dicts, lists and scalars.
        places: place of each part, by its path of keys and positions; a value in a mapping has the place of its key.
    """

    data: Any
    places: Mapping[FormPath, Place] = field(default_factory=dict)

    def place(self, path: FormPath) -> Place | None:
        """Return the place of the part at `path`, or of the closest outer part with a known place; else `None`."""
        for length in range(len(path), -1, -1):
            if path[:length] in self.places:
                return self.places[path[:length]]
        return None


Span = tuple[int, int]
"""Begin and end of a part of a text, as offsets in characters."""


@dataclass(frozen=True, slots=True)
class Spans:
    """Spans of the parts of a YAML text by path, quotes included.

    Attributes:
        keys: the spans of the keys of mappings, by the path of the value.
        values: the spans of the values; a mapping or list without brackets ends with its last part.
    """

    keys: dict[FormPath, Span] = field(default_factory=dict)
    values: dict[FormPath, Span] = field(default_factory=dict)


def load_document(text: str, source: str | Origin | None = None, spans: Spans | None = None) -> Document:
    """Return the one YAML document in a text from the file `source`, or with that origin; `spans` receives all spans.

    Raises:
        ParseError: the text is not YAML, or uses a refused feature.
        InputError: the text is too large.
    """
    require_text(text, "the YAML text")
    origin = source if isinstance(source, Origin) else Origin(source)
    check_size(len(text), Place(origin.source))
    places: dict[FormPath, Place] = {(): Place(origin.source, origin.line)}
    reader = _Reader(text, origin, places, spans)
    try:
        return Document(reader.document(), places)
    except MarkedYAMLError as error:
        raise _parse_error(error, origin) from None
    except ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        column = error.position - text.rfind("\n", 0, error.position)
        problem = f"not readable as YAML: the character U+{ord(text[error.position]):04X} is not allowed in a text"
        raise ParseError(problem, place=origin.place(line, column)) from None


def dump(data: Mapping[str, Any]) -> str:
    """Return plain data as YAML in the project's style; `load_document` returns equal data."""
    stream = StringIO()
    yaml = YAML()
    yaml.default_flow_style = None
    yaml.width = 110
    yaml.indent(mapping=2, sequence=4, offset=2)
    yaml.dump(_quote(dict(data)), stream)
    return stream.getvalue()


def inline(data: Any) -> str:
    """Return plain data as YAML in one line, which is also valid inside brackets."""
    stream = StringIO()
    yaml = YAML()
    yaml.default_flow_style = True
    yaml.width = sys.maxsize
    yaml.dump({"": _quote(data)}, stream)
    return stream.getvalue().strip().removeprefix("{'': ").removesuffix("}")


class _Reader:
    """Builder of one document's data from the parser's events."""

    def __init__(self, text: str, origin: Origin, places: dict[FormPath, Place], spans: Spans | None) -> None:
        yaml = YAML(typ="safe", pure=True, plug_ins=[])
        yaml.Scanner = _Scanner
        self._events: Iterator[Any] = yaml.parse(text)
        self._origin = origin
        self._places = places
        self._spans = spans
        self._parts = 0
        self._end = 0

    def document(self) -> Any:
        data, begun = None, False
        for event in self._events:
            if isinstance(event, DocumentStartEvent):
                self._directives(event)
                if begun:
                    raise ParseError("another document begins here; a file holds one", place=self._place(event))
                begun = True
            elif isinstance(event, NodeEvent):
                self._places[()] = self._place(event)
                data = self._node(event, ())
        return data

    def _node(self, event: Event, path: FormPath) -> Any:
        self._refuse_surprises(event, path)
        data: Any
        begin = event.start_mark.index
        if isinstance(event, MappingStartEvent):
            data = self._mapping(path)
        elif isinstance(event, SequenceStartEvent):
            data = self._sequence(path)
        else:
            data = self._scalar(event)
            self._end_of(event)
            begin = min(begin, self._end)  # an empty value has the mark of the next part
        if self._spans is not None:
            self._spans.values[path] = (begin, self._end)
        return data

    def _mapping(self, path: FormPath) -> dict[str | int, Any]:
        found: dict[str | int, Any] = {}
        while not isinstance(event := next(self._events), MappingEndEvent):
            name = self._key(event, path)
            here = (*path, name)
            if name in found:
                first = self._places[here].line
                message = f'not readable as YAML: duplicate key "{event.value}", which is in line {first} too'
                raise ParseError(message, place=self._place(event))
            self._places[here] = self._place(event)
            self._end_of(event)
            if self._spans is not None:
                self._spans.keys[here] = (event.start_mark.index, event.end_mark.index)
            found[name] = self._node(next(self._events), here)
        self._end_of(event)
        return found

    def _end_of(self, event: Any) -> None:
        """Note the end of a part; an empty value, and a list or mapping without brackets, end with the part before."""
        if event.end_mark.index > event.start_mark.index:
            self._end = event.end_mark.index

    def _key(self, event: Event, path: FormPath) -> str | int:
        """Return a key; only the cases of a `select` may be numbers or truth values, any other key must be a name."""
        self._refuse_surprises(event, path)
        key = self._scalar(event) if isinstance(event, ScalarEvent) else None
        if isinstance(key, str):
            return key
        if path[-1:] == ("cases",) and isinstance(key, int | float) and math.isfinite(key):
            return key if isinstance(key, int) else repr(key)
        written = f"'{event.value}'" if isinstance(event, ScalarEvent) and event.value else "this"
        message = f"a key is a name; {written} is none (in quotes it would be)"
        raise ParseError(message, place=self._place(event))

    def _sequence(self, path: FormPath) -> list[Any]:
        found: list[Any] = []
        while not isinstance(event := next(self._events), SequenceEndEvent):
            here = (*path, len(found))
            self._places[here] = self._place(event)
            found.append(self._node(event, here))
        self._end_of(event)
        return found

    def _scalar(self, event: Any) -> Any:
        value: str = event.value
        if not event.implicit[0]:  # the scalar is quoted or a block
            if _SURROGATE.search(value):
                raise ParseError("an escape that stands for no character", place=self._place(event))
            return value
        if len(value) > _LONGEST_NUMBER and _NUMBER.fullmatch(value):
            raise ParseError(f"a number has at most {_LONGEST_NUMBER} characters", place=self._place(event))
        return _plain(value)

    def _refuse_surprises(self, event: Any, path: FormPath) -> None:
        self._parts += 1
        if self._parts > MAX_PARTS:
            raise ParseError(f"more than {MAX_PARTS} keys and values, the most that are read", place=self._place(event))
        if isinstance(event, AliasEvent) or event.anchor:
            raise ParseError("anchors and aliases are not used here; write it out", place=self._place(event))
        if event.tag:
            raise ParseError("YAML tags are not used here", place=self._place(event), found=str(event.tag))
        if isinstance(event, ScalarEvent):
            if event.value == "<<" and event.implicit[0]:
                message = "merge keys are not used here; write it out"
                raise ParseError(message, place=self._place(event), found="<<")
        elif len(path) >= MAX_DEPTH:
            raise ParseError(_TOO_DEEP, place=self._place(event))

    def _directives(self, event: DocumentStartEvent) -> None:
        if event.tags or event.version not in {None, (1, 2)}:
            raise ParseError("only YAML 1.2 without tags is read here", place=self._place(event))

    def _place(self, event: Event) -> Place:
        return self._origin.place(event.start_mark.line + 1, event.start_mark.column + 1)


_PLAIN: Mapping[str, bool | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
_NUMBER = re.compile(r"""
    (?P<int>[-+]?[0-9]+) | 0o(?P<octal>[0-7]+) | 0x(?P<hex>[0-9a-fA-F]+)
    | (?P<float>[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?)
    | (?P<none>[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN))
""", re.VERBOSE)  # fmt: skip
_LONGEST_NUMBER = 40
_SURROGATE = re.compile("[\ud800-\udfff]")


def _plain(text: str) -> Any:
    """Return the value of an unquoted scalar according to the core schema of YAML 1.2 (10.3.2)."""
    if text in _PLAIN:
        return _PLAIN[text]
    match = _NUMBER.fullmatch(text)
    if match is None:
        return text
    if match["octal"] or match["hex"]:
        return int(match["octal"] or match["hex"], 8 if match["octal"] else 16)
    if match["none"]:
        return float(text.replace(".", "", 1))
    return int(text) if match["int"] else float(text)


def _quote(data: Any) -> Any:
    """Return the data with double quotes around each text that YAML would otherwise read as another type."""
    if isinstance(data, Mapping):
        return {_quote(key): _quote(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_quote(one) for one in data]
    # YAML reads ':0' as a mapping, and single quotes fold line breaks.
    if isinstance(data, str) and (_plain(data) != data or not data.isprintable() or data.startswith(":")):
        return DoubleQuotedScalarString(data)
    return data


_PLAINER = {
    r"found character '\\t' that cannot start any token": "a tab in place of spaces",
    r"found a tab character that violates indentation": "a tab in place of spaces",
    r"expected <block end>, but found '<block \w+ start>'": "the line is indented differently from those above it",
    r"expected <block end>, but found '-'": "a list item among the keys of a mapping",
    r"expected <block end>, but found '\?'": "a key among the items of a list",
    r"expected <block end>, but found (.*)": r"\1 does not belong there",
    r"expected ',' or '(.)', but got .*": r"a ',' or '\1' is missing",
    r"expected the node content, but found (.*)": r"no value begins with \1",
    r"expected '<document start>', but found .*": "text after the end of the document",
    r"could not find expected ':'": "a key without ':'",
    r"mapping values are not allowed here": "a ':' is misplaced; is the indentation right?",
    r"found unexpected end of stream": "a quote is never closed",
    r"'<stream end>'": "the end of the text",
}
"""Clearer messages, by the message of the YAML library."""


def _parse_error(error: MarkedYAMLError, origin: Origin) -> ParseError:
    mark, begun = error.problem_mark or error.context_mark, error.context_mark
    place = origin.place(mark.line + 1, mark.column + 1) if mark else Place(origin.source)
    problem = str(error.problem or error.context or "").strip().split("\n")[0]
    if problem == _TOO_DEEP:
        return ParseError(problem, place=place)
    for jargon, plainer in _PLAINER.items():
        problem = re.sub(jargon, plainer, problem)
    if begun and mark and begun.line != mark.line:
        problem += f" (of what begins in line {origin.line + begun.line})"
    return ParseError(f"not readable as YAML: {problem}", place=place)


_Model = TypeVar("_Model", bound=BaseModel)


def read_model(model: type[_Model], document: Document) -> _Model:
    """Return the document as a value of `model`.

    Raises:
        InputError: the document does not match `model`; the message has file, line, and the nearest valid key.
    """
    if not isinstance(document.data, Mapping):
        found = in_yaml(document.data)
        raise InputError(f"a mapping of keys was expected; found {found}", place=document.place(()))
    try:
        read: _Model = _adapter(model).validate_python(document.data)
    except ValidationError as error:
        wrong, path = misread(error, model, document.data)
        wrong.place = document.place(path)
        raise wrong from None
    return read


@cache
def _adapter(model: type[_Model]) -> TypeAdapter[_Model]:
    return TypeAdapter(model)


MAX_BYTES = 250_000
"""Upper bound of a file's size in bytes: a hundred times the longest plot of this project.

The check of a larger file would take too long.
"""


def read_file(path: Path | str) -> str:
    """Return the text of a file in UTF-8.

    Raises:
        InputError: the file cannot be read, is not UTF-8, or has more than `MAX_BYTES` bytes.
    """
    return read_text(path_of(path), most=MAX_BYTES)


def path_of(path: object) -> Path:
    """Return a text or path as a path; raise `InputError` for any other value."""
    if not isinstance(path, str | Path):
        raise InputError(f"a file or folder is named by a text or a Path, not {shown(path)}")
    return Path(path)


def check_size(size: int, place: Place) -> None:
    """Raise `InputError` if `size`, in bytes, exceeds `MAX_BYTES`."""
    require_size(size, MAX_BYTES, place.source)
