"""A world as one JSON text: schema, version, things, facts and values, lossless both ways."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from io import StringIO
from pathlib import Path
from typing import Any

from knowledge_base.errors import InputError, ParseError, Place, SchemaError
from knowledge_base.exchange.json_forms import (
    FORM_ERRORS,
    Form,
    schema_form,
    schema_hash,
    schema_of,
    world_form,
    world_of,
)
from knowledge_base.facts import Delta
from knowledge_base.pddl.files import read_text
from knowledge_base.world.change_checks import check_delta
from knowledge_base.world.schema import Schema
from knowledge_base.world.schema_compatibility import missing_constants, require_extension
from knowledge_base.world.state import WorldState

FORMAT = "dsc-knowledge/2"
MAX_WORLD_BYTES = 64 * 1024 * 1024
"""Of a world in JSON: a million facts. Reading takes about ten bytes of memory for each."""
_PARTS = ("format", "version", "schema_hash", "schema", "nodes", "facts", "values")


def to_json(state: WorldState, version: int) -> str:
    """The world as JSON text; `exchange.json_forms` describes facts and values."""
    said = {
        "format": FORMAT,
        "version": version,
        "schema_hash": schema_hash(state.schema),
        "schema": schema_form(state.schema),
        **world_form(state),
    }
    text = StringIO()
    json.dump(said, text, indent=1, allow_nan=False)  # `dumps` keeps millions of pieces until the end
    return text.getvalue()


def read_json(
    text_or_path: str | Path, schema: Schema | None = None, source: str | None = None
) -> tuple[WorldState, int]:
    """The world and its version, from JSON text or a file (a `Path`).

    Args:
        text_or_path: what `to_json` wrote, or somebody by hand.
        schema: what it is read with, when that is more than what it was written with.
        source: the name of the text in messages.

    Raises:
        InputError: the file cannot be read, has more than `MAX_WORLD_BYTES`, or it holds a number that is not finite.
        ParseError: it does not have this form.
        SchemaMismatchError: `schema` is no extension of the text's own.
        SchemaError: the facts contradict the schema, or it itself.
        UnknownNameError: a name that is not declared, or a thing that is not there.
    """
    if isinstance(text_or_path, Path):
        text, place = read_text(text_or_path, most=MAX_WORLD_BYTES), Place(source or str(text_or_path))
    else:
        text, place = text_or_path, Place(source)
    try:
        return _world(_form(text, place), schema, place)
    except InputError as error:
        raise error.located(place) from None


def _form(text: str, place: Place) -> Form:
    try:
        form = json.loads(text, object_pairs_hook=_without_repetition, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        where = Place(place.source, error.lineno, error.colno)
        raise ParseError(f"this is not JSON: {error.msg}", place=where) from None
    except (RecursionError, ValueError) as error:
        raise ParseError(f"this is not JSON that can be read: {error}", place=place) from None
    if not isinstance(form, dict) or form.get("format") != FORMAT:
        raise ParseError(f'a world in JSON is an object with "format": "{FORMAT}"', place=place)
    for part in form.keys() ^ set(_PARTS):
        if part in form:
            raise ParseError(f"a world in JSON has no part '{part}'", place=place, found=part, valid=_PARTS)
        raise ParseError(f"the part '{part}' is missing", place=place)
    return form


def _world(form: Form, schema: Schema | None, place: Place) -> tuple[WorldState, int]:
    try:
        written = schema_of(form["schema"])
    except FORM_ERRORS:
        raise ParseError("'schema' does not have the form that `to_json` writes", place=place) from None
    if schema_hash(written) != form["schema_hash"]:
        raise SchemaError("'schema_hash' is not that of 'schema': one of the two was changed", place=place)
    if schema is not None:
        require_extension(written, schema, place)
    _require_parts(form, written, place)
    state = world_of(form, schema or written)
    _require_admissible(state)
    state.commit(missing_constants(state, place))
    return state, form["version"]


def _require_parts(form: Form, schema: Schema, place: Place) -> None:
    version = form["version"]
    if type(version) is not int or version < 0:
        raise ParseError(f"'version' is a whole number from 0, not {version!r}", place=place)
    if not isinstance(form["nodes"], dict):
        raise ParseError("'nodes' is an object of things with their types", place=place)
    for type_name in form["nodes"].values():
        schema.require_type(str(type_name), place)
    for part, least, means in (("facts", 1, '["NAME", ARGUMENT...]'), ("values", 2, '["NAME", ARGUMENT..., CONTENT]')):
        for number, item in enumerate(_items(form[part], part, place)):
            if not _is_item(item, least, content=part == "values"):
                raise ParseError(f"{part}[{number}] is of the form {means}, not {json.dumps(item)}", place=place)


def _items(said: Any, part: str, place: Place) -> Iterable[Any]:
    if not isinstance(said, list):
        raise ParseError(f"'{part}' is a list", place=place)
    return said


def _is_item(item: Any, least: int, *, content: bool) -> bool:
    if not (isinstance(item, list) and len(item) >= least and isinstance(item[0], str)):
        return False
    values = item[:-1] if content and isinstance(item[-1], list) else item
    return all(isinstance(value, str | int | float) for value in values)


def _require_admissible(state: WorldState) -> None:
    """What was read is judged like a change that makes it all."""
    check_delta(Delta(state.nodes, (), tuple(state.facts), state.values), WorldState.of(state.schema, {}, (), {}))


def _without_repetition(pairs: list[tuple[str, Any]]) -> Mapping[str, Any]:
    made = dict(pairs)
    if len(made) < len(pairs):
        times = Counter(name for name, _ in pairs)
        twice = next(name for name in made if times[name] > 1)
        raise ValueError(f"'{twice}' is there twice in one object")
    return made


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is no number")
