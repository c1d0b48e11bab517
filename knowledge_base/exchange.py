"""Worlds, changes and schemas as JSON, for stores and other programs; without loss, and in order.

A fact is `["on", "cup1", "table"]`, a value `["weight", "cup1", 0.2]`; a geometry is a list. JSON distinguishes `1`,
`1.0` and `true`, so that values keep their Python types. Functions that read a form do not check it: a wrong form
raises one of `FORM_ERRORS`. `read_json` checks the form.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

from knowledge_base.errors import InputError, ParseError, Place, SchemaError
from knowledge_base.facts import Content, Delta, Fact
from knowledge_base.language.checking.vocabulary import Signature
from knowledge_base.language.syntax.expression import TypedVariable
from knowledge_base.language.syntax.text import parse_condition, to_text
from knowledge_base.pddl.files import read_text
from knowledge_base.world.axioms import Axiom
from knowledge_base.world.overlay import check_delta
from knowledge_base.world.schema import Schema
from knowledge_base.world.schema_compatibility import missing_constants, require_extension
from knowledge_base.world.state import WorldState

Form = dict[str, Any]
FORM_ERRORS = (AttributeError, IndexError, KeyError, TypeError, ValueError, RecursionError)
"""Errors from reading a wrong form, including errors of the JSON parser."""
FORMAT = "dsc-knowledge/2"
MAX_WORLD_BYTES = 64 * 1024 * 1024
"""Maximum size of a world in JSON, in bytes: about a million facts.

A reader needs about ten bytes of memory for each byte of the file.
"""
_PARTS = ("format", "version", "schema_hash", "schema", "nodes", "facts", "values")


def compact(form: Form) -> str:
    """Return JSON text without spaces, in ASCII: a short form that every program reads."""
    return json.dumps(form, separators=(",", ":"), allow_nan=False)


def delta_form(delta: Delta) -> Form:
    """Return the form of a change, without its empty parts."""
    form: Form = {
        "nodes": dict(delta.nodes),
        "removed_nodes": list(delta.removed_nodes),
        "removed": _fact_forms(delta.removed),
        "added": _fact_forms(delta.added),
        "values": _value_forms(delta.values),
        "replaced": _fact_forms(delta.replaced),
    }
    return {part: said for part, said in form.items() if said}


def delta_of(form: Form) -> Delta:
    """Return the change that a form describes; the inverse of `delta_form`."""
    return Delta(
        nodes=form.get("nodes", {}),
        removed=tuple(_facts(form.get("removed", ()))),
        added=tuple(_facts(form.get("added", ()))),
        values=_values(form.get("values", ())),
        removed_nodes=tuple(form.get("removed_nodes", ())),
        replaced=tuple(_facts(form.get("replaced", ()))),
    )


def world_form(state: WorldState) -> Form:
    """Return the form of a world: all objects (constants too), facts and values."""
    return {"nodes": dict(state.nodes), "facts": _fact_forms(state.facts), "values": _value_forms(state.values)}


def world_of(form: Form, schema: Schema) -> WorldState:
    """Return the world of a form; the inverse of `world_form`.

    `schema` must be the schema of the form, or an extension.
    """
    return WorldState.of(schema, form["nodes"], _facts(form["facts"]), _values(form["values"]))


def schema_form(schema: Schema) -> Form:
    """Return the form of a schema: all declarations, without their places."""
    axioms = [[one.predicate, _type_rows(one.parameters), to_text(one.condition)] for one in schema.axioms]
    return {
        "types": dict(schema.types),
        "constants": dict(schema.constants),
        "predicates": {name: _type_rows(signature.parameters) for name, signature in schema.predicates.items()},
        "functions": {name: [f.result, *_type_rows(f.parameters)] for name, f in schema.functions.items()},
        "functional": sorted(schema.functional),
        **({"axioms": axioms} if axioms else {}),
        **_kinds(schema),
    }


def _kinds(schema: Schema) -> Form:
    """Return the kinds of arcs, unless all are of one kind."""
    kinds = {name: kind for name, kind in schema.kinds.items() if kind}
    return {"kinds": kinds} if len(set(kinds.values())) > 1 else {}


def schema_of(form: Form) -> Schema:
    """Return the schema of a form; the inverse of `schema_form`.

    Raises:
        SchemaError: the declarations contradict each other.
    """
    kinds = form.get("kinds", {})
    predicates = [_signature(name, parameters) for name, parameters in form["predicates"].items()]
    functions = [_signature(name, rest, result) for name, (result, *rest) in form["functions"].items()]
    return Schema(
        types=form["types"],
        constants=form["constants"],
        predicates={one.name: replace(one, kind=kinds.get(one.name, "")) for one in predicates},
        functions={one.name: replace(one, kind=kinds.get(one.name, "")) for one in functions},
        functional=frozenset(form["functional"]),
        axioms=tuple(
            Axiom(name, _signature(name, parameters).parameters, parse_condition(condition))
            for name, parameters, condition in form.get("axioms", ())
        ),
    )


def schema_hash(schema: Schema) -> str:
    """Return the SHA-256 hash of the declarations as hexadecimal text; order and kinds have no influence."""
    form = {key: value for key, value in schema_form(schema).items() if key != "kinds"}
    text = json.dumps(form, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _fact_forms(facts: Iterable[Fact]) -> list[list[Any]]:
    return [[f.predicate, *f.args] for f in facts]


def _facts(forms: Iterable[list[Any]]) -> Iterable[Fact]:
    return (Fact(form[0], tuple(form[1:])) for form in forms)


def _value_forms(values: Mapping[Fact, Content]) -> list[list[Any]]:
    return [[f.predicate, *f.args, content] for f, content in values.items()]


def _values(forms: Iterable[list[Any]]) -> dict[Fact, Content]:
    return {Fact(form[0], tuple(form[1:-1])): _content(form[-1]) for form in forms}


def _content(form: Any) -> Content:
    """Return the value of a form; a geometry is a list in JSON, which has no tuples."""
    return tuple(form) if isinstance(form, list) else form


def _type_rows(parameters: Iterable[TypedVariable]) -> list[list[Any]]:
    return [[p.name, *p.types] for p in parameters]


def _signature(name: str, parameters: list[list[Any]], result: str | None = None) -> Signature:
    return Signature(name, tuple(TypedVariable(p[0], tuple(p[1:])) for p in parameters), result)


def to_json(state: WorldState, version: int) -> str:
    """Return the world as JSON text; the module docstring shows how facts and values are written."""
    said = {
        "format": FORMAT,
        "version": version,
        "schema_hash": schema_hash(state.schema),
        "schema": schema_form(state.schema),
        **world_form(state),
    }
    text = StringIO()
    json.dump(said, text, indent=1, allow_nan=False)  # `dumps` stores millions of pieces until the end
    return text.getvalue()


def read_json(
    text_or_path: str | Path, schema: Schema | None = None, source: str | None = None
) -> tuple[WorldState, int]:
    """Return the world and its version, from JSON text or a file (a `Path`).

    Args:
        text_or_path: text in the form of `to_json`, or the path of its file.
        schema: an extension of the schema in the text; by default the schema in the text.
        source: name of the text in messages.

    Raises:
        InputError: the file cannot be read, has more than `MAX_WORLD_BYTES` bytes, or contains a number that is not
            finite.
        ParseError: the text does not have the form of `to_json`.
        SchemaMismatchError: `schema` does not extend the schema in the text.
        SchemaError: the facts contradict the schema, or declarations contradict each other.
        UnknownNameError: an undeclared name, or an unknown object.
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
    """Check the whole world as a change from an empty world."""
    check_delta(Delta(state.nodes, (), tuple(state.facts), state.values), WorldState.of(state.schema, {}, (), {}))


def _without_repetition(pairs: list[tuple[str, Any]]) -> Mapping[str, Any]:
    made = dict(pairs)
    if len(made) < len(pairs):
        times = Counter(name for name, _ in pairs)
        twice = next(name for name in made if times[name] > 1)
        raise ValueError(f"'{twice}' is there twice in one object")
    return made


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number")
