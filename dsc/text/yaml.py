"""Plots and scenarios as YAML 1.2: read with places, refused where YAML is cleverer than people expect.

Duplicate keys, tags, anchors and aliases are refused; so are files too large or nested too deeply to be
anybody's plot. Every error names file, line and column.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent, NodeEvent, ScalarEvent
from ruamel.yaml.scanner import RoundTripScanner

from knowledge_base.errors import InputError, ParseError, Place

MAX_BYTES = 500_000
MAX_DEPTH = 64

FormPath = tuple[str | int, ...]


class _Scanner(RoundTripScanner):
    """Reads `{table: ?table}` as YAML 1.2 has it (7.3.3): `?` before a non-space begins a plain scalar.

    The library keeps YAML 1.1's reading inside braces, where `?` always begins a complex key.
    """

    def check_key(self) -> Any:
        return self.reader.peek(1) in _SPACES

    def check_plain(self) -> Any:
        if self.reader.peek() == "?":
            return self.reader.peek(1) not in _SPACES
        return super().check_plain()


_SPACES = "\0 \t\r\n\x85\u2028\u2029"


@dataclass(frozen=True, slots=True)
class Document:
    """A YAML file as plain data.

    Attributes:
        data: dicts, lists and scalars.
        places: where each part stands, by its path of keys and positions; a key's place is the key's own.
    """

    data: Any
    places: Mapping[FormPath, Place] = field(default_factory=dict)

    def place(self, path: FormPath) -> Place | None:
        """Where the part at `path`, or the closest known part around it, stands."""
        for length in range(len(path), -1, -1):
            if path[:length] in self.places:
                return self.places[path[:length]]
        return None


def read_file(path: Path | str) -> str:
    """The text of a file; raises `InputError` if it cannot be read or is not UTF-8."""
    file = Path(path)
    try:
        if file.stat().st_size > MAX_BYTES:
            raise InputError(f"the file is larger than {MAX_BYTES} bytes", place=Place(str(file)))
        return file.read_text(encoding="utf-8")
    except FileNotFoundError:
        siblings = [str(other) for other in file.parent.glob("*")] if file.parent.is_dir() else []
        raise InputError(f"there is no file '{file}'", found=str(file), valid=siblings[:200]) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read the file: {error}", place=Place(str(file))) from None


def load_document(text: str, source: str | None = None) -> Document:
    """Read one YAML document.

    Raises:
        ParseError: it is not YAML, or uses a feature that is refused.
    """
    if len(text) > MAX_BYTES:
        raise ParseError(f"the text is larger than {MAX_BYTES} bytes", place=Place(source))
    try:
        _refuse_surprises(text, source)
        tree = _yaml().load(text)
    except MarkedYAMLError as error:
        raise _parse_error(error, source) from None
    except (YAMLError, ValueError) as error:
        problem = str(error).split("\n", maxsplit=1)[0]
        raise ParseError(f"not readable as YAML: {problem}", place=Place(source, 1)) from None
    places: dict[FormPath, Place] = {(): Place(source, 1)}
    return Document(_plain(tree, (), places, source), places)


def dump(data: Mapping[str, Any]) -> str:
    """Plain data as YAML in the house's style; `load_document` reads it back."""
    stream = StringIO()
    yaml = YAML()
    yaml.default_flow_style = None
    yaml.width = 110
    yaml.indent(mapping=2, sequence=4, offset=2)
    yaml.dump(dict(data), stream)
    return stream.getvalue()


def _yaml() -> YAML:
    yaml = YAML(typ="rt", pure=True)
    yaml.Scanner = _Scanner
    yaml.allow_duplicate_keys = False
    return yaml


def _refuse_surprises(text: str, source: str | None) -> None:
    depth = 0
    for event in _yaml().parse(text):
        mark = event.start_mark
        place = Place(source, mark.line + 1, mark.column + 1)
        if isinstance(event, AliasEvent) or (isinstance(event, NodeEvent) and event.anchor):
            raise ParseError("anchors and aliases are not used here; write it out", place=place)
        if getattr(event, "tag", None):
            raise ParseError("YAML tags are not used here", place=place, found=str(event.tag))
        if isinstance(event, ScalarEvent) and event.value == "<<" and event.implicit[0]:
            raise ParseError("merge keys are not used here; write it out", place=place, found="<<")
        depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
        if depth > MAX_DEPTH:
            raise ParseError(f"nested deeper than {MAX_DEPTH} levels", place=place)


def _parse_error(error: MarkedYAMLError, source: str | None) -> ParseError:
    mark = error.problem_mark or error.context_mark
    place = Place(source, mark.line + 1, mark.column + 1) if mark else Place(source)
    problem = str(error.problem or error.context or "not readable as YAML").strip().split("\n")[0]
    problem = problem.split(" with value ")[0]  # a duplicate key's values may be whole plots
    return ParseError(f"not readable as YAML: {problem}", place=place)


def _plain(node: Any, path: FormPath, places: dict[FormPath, Place], source: str | None) -> Any:
    if isinstance(node, Mapping):
        return {
            name: _plain(value, (*path, name), places, source)
            for name, value in _entries(node, path, places, source)
        }
    if isinstance(node, list):
        for position in range(len(node)):
            line, column = node.lc.item(position)  # type: ignore[attr-defined]
            places[(*path, position)] = Place(source, line + 1, column + 1)
        return [_plain(value, (*path, position), places, source) for position, value in enumerate(node)]
    return _scalar(node)


def _entries(
    node: Mapping[Any, Any], path: FormPath, places: dict[FormPath, Place], source: str | None
) -> Iterator[tuple[str | int, Any]]:
    """A mapping's entries, each with its key as plain data and the key's place noted."""
    for key, value in node.items():
        line, column = node.lc.key(key)  # type: ignore[attr-defined]
        place = Place(source, line + 1, column + 1)
        if not isinstance(key, str | int | float):
            raise ParseError("a key is a name; this is none", place=place)
        name = key if isinstance(key, int) else str(key)
        places[(*path, name)] = place
        yield name, value


def _scalar(node: Any) -> Any:
    for kind in (bool, int, float, str):
        if isinstance(node, kind):
            return kind(node)
    return None if node is None else str(node)
