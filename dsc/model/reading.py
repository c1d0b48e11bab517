"""Reading of data as values of the model; each error has the path in the data and the nearest valid key."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, Self

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from knowledge_base.errors import InputError, UnknownNameError, shortened

UNKNOWN_FORM = "unknown_form"
"""Type of the validation error for data that have none of a union's distinctive keys."""
LOCATED = "located"
"""Type of a validation error whose context contains the `path` of the wrong part in the data."""

FormPath = tuple[str | int, ...]
"""Path of a part in data: keys of mappings and positions in lists, outermost first."""
_Schema = Mapping[str, Any]
_Location = tuple[str | int, ...]
"""Location of a pydantic error: keys and positions, with tags of union members between them."""


class Form(BaseModel):
    """Base of data that people write, in files or in Python."""

    @classmethod
    def model_validate(cls, obj: Any, **options: Any) -> Self:
        """Return data as a value of this class; `options` are the options of pydantic's `model_validate`.

        Raises:
            InputError: the data do not match the class; the message has the path in the data and the nearest valid key.
        """
        try:
            return super().model_validate(obj, **options)
        except ValidationError as error:
            wrong, path = misread(error, cls, obj)
            wrong.message = f"{'.'.join(map(str, path))}: {wrong.message}" if path else wrong.message
            raise wrong from None


def misread(error: ValidationError, model: type[BaseModel], data: Any) -> tuple[InputError, FormPath]:
    """Return a pydantic error about data for `model` as an `InputError`, with the path of the wrong part."""
    # The error with the longest path is the most specific one.
    details = max(error.errors(include_url=False), key=lambda one: (one["type"] != "missing", len(one["loc"])))
    kind, loc, context = details["type"], details["loc"], details.get("ctx", {})
    schema = _schema(model)
    path = (*_follow(loc, data, schema)[0], *context.get("path", ()))
    if kind == "extra_forbidden":
        key, around = str(loc[-1]), _follow(loc[:-1], data, schema)[1]
        valid = {name for form in around for name in form.get("properties", {})}
        return UnknownNameError(f"unknown key '{key}'", found=key, valid=valid), path
    if kind == UNKNOWN_FORM:
        keys = list(details["input"]) if isinstance(details["input"], Mapping) else [str(details["input"])]
        found = str(next(iter(keys), ""))
        return UnknownNameError(_message(details), found=found, valid=context["keys"].split()), path
    return InputError(_message(details)), path


_PLAIN = {
    "missing": "the key '{key}' is missing",
    "string_type": "text was expected",
    "invalid_key": "a key is a name",
    "dict_type": "a mapping of names was expected",
    "model_type": "a mapping was expected",
    "model_attributes_type": "a mapping was expected",
    "int_type": "a whole number was expected",
    "float_type": "a number was expected",
    "bool_type": "true or false was expected",
    "tuple_type": "a list was expected",
    "too_short": "at least one entry is needed",
    "string_pattern_mismatch": "'{key}' is not of the form expected here, e.g. arm.grasp or fetch_item",
}


@cache
def _schema(model: type[BaseModel]) -> _Schema:
    """Return a model's JSON schema, cached: its construction takes fifty times as long as the reading of a plot."""
    return model.model_json_schema()


def _message(details: ErrorDetails) -> str:
    kind = details["type"]
    if kind == "value_error":
        return _said_by(details["ctx"]["error"])
    if kind == LOCATED:
        return details["msg"]
    if kind == UNKNOWN_FORM:
        return f"{details['msg']}; found {in_yaml(details['input'])}"
    if kind in _PLAIN:
        found = "" if kind == "missing" else f"; found {in_yaml(details['input'])}"
        return _PLAIN[kind].format(key=next(reversed(details["loc"]), "")) + found
    text = details["msg"].replace("Input should be", "it should be").replace("True", "true").replace("False", "false")
    return f"{text}; found {in_yaml(details['input'])}"


def in_yaml(value: Any) -> str:
    """Return a value's text as in YAML, for messages; for a collection only its kind and size or keys."""
    if isinstance(value, bool | None):
        return {True: "true", False: "false", None: "nothing"}[value]
    if isinstance(value, Mapping):
        return f"a mapping with the keys {', '.join(map(str, list(value)[:5]))}" if value else "an empty mapping"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}" if value else "an empty list"
    return shortened(repr(value), 100)


def _said_by(error: ValueError) -> str:
    """Return the parser's message about a text in the data, with line and column inside this text."""
    cause = error.__cause__
    if not isinstance(cause, InputError):
        return str(error)
    text = str(cause).removeprefix(f"{cause.place}: ")
    line, column = (cause.place.line, cause.place.column) if cause.place else (None, None)
    return text if line is None else f"{text} (line {line}, column {column} of the text)"


def _follow(loc: _Location, data: Any, schema: _Schema) -> tuple[FormPath, list[_Schema]]:
    """Follow a pydantic location; return its path in the data and the schemas that describe the part at the path.

    At a tagged union of the schema, the next element of the location is a member's tag instead of a key.
    """
    path: list[str | int] = []
    nodes = [schema]
    for element in loc:
        members = [member for node in nodes for member in _resolve(node, schema).get("oneOf", ())]
        if members:
            nodes = _find_tagged(members, str(element), schema)
            continue
        if isinstance(data, list | tuple):
            data = dict(enumerate(data))
        # The model stores the keys of `cases` as text; in the file these keys may be numbers and truth values.
        for key in data if isinstance(data, Mapping) else ():
            if element in {key, in_yaml(key)}:
                data = data[key]
                path.append(key)
                break
        nodes = [inner for node in nodes for inner in _into(node, element, schema)] or nodes
    return tuple(path), [form for node in nodes for form in _alternatives(node, schema)]


def _find_tagged(members: list[_Schema], tag: str, schema: _Schema) -> list[_Schema]:
    """Return the members whose distinctive key is the tag or whose title begins with the tag; all if none matches."""
    resolved = [_resolve(member, schema) for member in members]
    return [
        form for form in resolved if tag in form.get("properties", {}) or form["title"].lower().startswith(tag)
    ] or resolved


def _resolve(node: _Schema, schema: _Schema) -> _Schema:
    while "$ref" in node:
        node = schema["$defs"][node["$ref"].rsplit("/", 1)[1]]
    return node


def _alternatives(node: _Schema, schema: _Schema) -> list[_Schema]:
    node = _resolve(node, schema)
    many = node.get("oneOf") or node.get("anyOf")
    return [a for one in many for a in _alternatives(one, schema)] if many else [node]


def _into(node: _Schema, element: str | int, schema: _Schema) -> list[_Schema]:
    """Return the schemas of the part at a key or position; an empty list if the schema has no such part."""
    further = []
    for one in _alternatives(node, schema):
        if element in one.get("properties", {}):
            further.append(one["properties"][element])
        elif isinstance(element, int) and "items" in one:
            further.append(one["items"])
        elif isinstance(one.get("additionalProperties"), Mapping):
            further.append(one["additionalProperties"])
    return further
