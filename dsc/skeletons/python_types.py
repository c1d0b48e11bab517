"""Types of plots in generated Python: annotations, sample values, and the definitions that they need."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from dsc.annotations import type_class
from dsc.data_types import ANY, WORDS, DataType, data_type, names_in
from dsc.text.typed_plots import annotation_of, with_supertypes
from knowledge_base.facts import GEOMETRY
from knowledge_base.language.checking.vocabulary import ROOT_TYPE
from knowledge_base.world.schema import Schema

_PLAIN = {"number": "float", "integer": "int", "boolean": "bool", "text": "str", ANY: "Any"}
_SAMPLES: Mapping[str, Any] = {
    GEOMETRY: [], "list": [], "map": {}, "plot": {}, "optional": None, ANY: None, "boolean": True, "condition": "(and)",
}  # fmt: skip
NOT_OBJECTS = frozenset((*WORDS, GEOMETRY, ROOT_TYPE, ANY))
"""Names of types whose values are not objects of the domain."""


def annotation(text: str | None) -> str:
    """Return the annotation of Python for a type of plots; `None` is any value."""
    return "Any" if text is None else annotation_of(data_type(text), _annotation_of_name)


def _annotation_of_name(kind: DataType) -> str:
    if kind.kind == "name" and kind.name not in NOT_OBJECTS:
        return type_class(kind.name)
    if str(kind) in _PLAIN:
        return _PLAIN[str(kind)]
    plain = {"geometry": "list[float]", "plot": "dict[str, Any]"}.get(kind.name or kind.kind, "str")
    return f'Annotated[{_PLAIN.get(kind.kind, plain)}, "{kind}"]'


def sample(text: str | None, schema: Schema | None = None) -> str:
    """Return an expression of Python with a value of a type; an object is the first one of its type."""
    value = sample_value(text)
    made = f'"{value}"' if isinstance(value, str) else repr(value)
    for name in object_types([text], ()):
        if value == first_object(name):
            for one in with_types_above([name], schema):
                made = f"{type_class(one)}({made})"
    return made


def sample_value(text: str | None) -> Any:
    """Return a value of a type as plain data."""
    kind = data_type(ANY if text is None else text)
    if kind.kind == "name" and kind.name not in NOT_OBJECTS:
        return first_object(kind.name)
    if kind.kind == "choice":
        return kind.values[0]
    if kind.kind in {"number", "integer"}:
        bound = kind.least if kind.least is not None else kind.most
        return 1 if bound is None else bound
    return _SAMPLES.get(kind.name or kind.kind, "text")


def first_object(type_name: str) -> str:
    """Return the name of the sample object of a type."""
    return f"{type_name}_1"


def object_types(texts: Iterable[str | None], records: Iterable[str]) -> set[str]:
    """Return the names of the types of objects in types of plots."""
    named = {name for text in texts if text is not None for name in names_in(data_type(text))}
    return named - set(records) - NOT_OBJECTS


def with_types_above(types: Iterable[str], schema: Schema | None) -> list[str]:
    """Return types of objects, each after its supertypes."""
    return [name for name in with_supertypes(types, schema) if name not in NOT_OBJECTS]


def record_class(name: str, fields: Mapping[str, str]) -> str:
    """Return the dataclass of a record."""
    lines = [f"    {field}: {annotation(text)}" for field, text in fields.items()]
    return "\n".join(["@dataclass", f"class {type_class(name)}:", f'    """The record `{name}`."""', "", *lines])
