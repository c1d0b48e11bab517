"""Keys that are valid at a path of a plot, profile or scenario, with their descriptions, by the JSON Schema."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import Any

from dsc.model.plot import ActionPlot
from dsc.text.plot_files import json_schema
from dsc.text.profiles import Profile, profile_schema

Schema = Mapping[str, Any]
_ENTRY = re.compile(r"^    ([\w, ]+): (.*(?:\n {5,}.*)*)", re.MULTILINE)


@cache
def plot_form() -> Schema:
    """Return the JSON Schema of plots."""
    return json_schema()


@cache
def profile_form() -> Schema:
    """Return the JSON Schema of profiles."""
    return profile_schema()


def keys_at(form: Schema, path: Iterable[str | int]) -> dict[str, str]:
    """Return the keys that are valid at a path, each with its description; empty where names are free."""
    found: dict[str, str] = {}
    for schema in _at(form, tuple(path)):
        about = _attributes(schema.get("description", ""))
        names = _fields(str(schema.get("title", "")))
        for key in schema.get("properties", {}):
            found.setdefault(key, about.get(names.get(key, key), about.get(key, "")))
    return found


def values_at(form: Schema, path: Iterable[str | int]) -> list[str]:
    """Return the values that are valid at a path, if the schema lists them."""
    schemas = list(_at(form, tuple(path)))
    listed = [str(value) for schema in schemas for value in (*schema.get("enum", ()), *_constant(schema))]
    return listed + [word for schema in schemas if schema.get("type") == "boolean" for word in ("true", "false")]


def _constant(schema: Schema) -> list[Any]:
    return [schema["const"]] if "const" in schema else []


def _at(form: Schema, path: tuple[str | int, ...]) -> Iterator[Schema]:
    schemas = list(_alternatives(form, form))
    for key in path:
        inner = [one for schema in schemas for one in _inside(schema, key)]
        schemas = [one for schema in inner for one in _alternatives(schema, form)]
    yield from schemas


def _inside(schema: Schema, key: str | int) -> list[Schema]:
    if isinstance(key, int):
        return [schema["items"]] if isinstance(schema.get("items"), dict) else []
    if key in schema.get("properties", {}):
        return [schema["properties"][key]]
    more = schema.get("additionalProperties")
    return [more] if isinstance(more, dict) else []


def _alternatives(schema: Schema, form: Schema) -> Iterator[Schema]:
    """Yield a schema and its alternatives, with references replaced."""
    reference = schema.get("$ref")
    if isinstance(reference, str):
        yield from _alternatives(form["$defs"][reference.rpartition("/")[2]], form)
        return
    yield schema
    for word in ("anyOf", "oneOf", "allOf"):
        for one in schema.get(word, ()):
            yield from _alternatives(one, form)


@cache
def _attributes(docstring: str) -> dict[str, str]:
    """Return the entries of `Attributes:` in a docstring, by name."""
    _, _, section = docstring.partition("Attributes:\n")
    return {
        name.strip(): " ".join(match[2].split()) for match in _ENTRY.finditer(section) for name in match[1].split(",")
    }


@cache
def _fields(title: str) -> dict[str, str]:
    """Return the names of a class's attributes by their keys in files."""
    for model in (ActionPlot, Profile):
        by_key, by_name = (model.model_json_schema(by_alias=alias) for alias in (True, False))
        every = [(by_key, by_name), *((one, by_name["$defs"][name]) for name, one in by_key.get("$defs", {}).items())]
        for keys, names in every:
            if keys.get("title") == title:
                return dict(zip(keys.get("properties", {}), names.get("properties", {}), strict=True))
    return {}
