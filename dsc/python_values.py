"""Values of Python in data of plots and back: records, enumerations, tuples."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum, EnumType
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel

from dsc.annotations import FoundRecords, Namespace, is_record, parameter_annotations, record_fields, type_of
from knowledge_base.errors import InputError
from knowledge_base.user_objects import described

Builder = Callable[[Any], Any]
"""Function that makes the value of Python for plain data."""


def plain_value(value: Any) -> Any:
    """Return a value as plain data: a record as a mapping, an enumeration as its value, a tuple as a list."""
    if value is None or type(value) in {str, int, float, bool}:  # the common case
        return value
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, BaseModel):
        value = {name: getattr(value, name) for name in type(value).model_fields}
    elif is_dataclass(value) and not isinstance(value, type):
        value = {one.name: getattr(value, one.name) for one in fields(value)}
    if isinstance(value, dict):
        return {key: plain_value(one) for key, one in value.items()}
    return [plain_value(one) for one in value] if isinstance(value, list | tuple) else value


def builder(annotation: object) -> Builder | None:
    """Return a function that makes values for an annotation with records or enumerations; `None` without these."""
    if not any(is_record(one) or isinstance(one, EnumType) for one in _parts(annotation)):
        return None

    def build(value: Any) -> Any:
        try:
            return _build(annotation, value)
        except (ValueError, TypeError) as error:  # of a class's own checks, e.g. those of pydantic
            raise InputError(f"{value!r} is refused: {described(error)}") from error

    return build


def typed_parameters(
    body: Callable[..., Any], first: int, names: Namespace, records: FoundRecords
) -> tuple[dict[str, str | None], dict[str, Builder]]:
    """Return the types and the builders of a function's parameters from number `first`, by name.

    Raises:
        SchemaError: an annotation has no valid type, or a parameter cannot be passed by name.
    """
    annotations = parameter_annotations(body, first, names)
    types = {name: type_of(annotation, records) for name, annotation in annotations.items()}
    built = {name: builder(annotation) for name, annotation in annotations.items()}
    return types, {name: build for name, build in built.items() if build is not None}


def _parts(annotation: object) -> list[object]:
    return [annotation, *(part for inside in get_args(annotation) for part in _parts(inside))]


def _build(annotation: Any, value: Any) -> Any:
    """Return the value of Python for checked data; an unset field has the default of its class, or `None`."""
    inside = [one for one in get_args(annotation) if one is not type(None)]
    if isinstance(value, Mapping) and is_record(annotation):
        own = record_fields(annotation)
        given = {name: field for name, field in own.items() if field.required or name in value}
        return annotation(**{name: _build(field.annotation, value.get(name)) for name, field in given.items()})
    if isinstance(annotation, EnumType) and value is not None:
        return annotation(value)
    if isinstance(value, list) and inside:
        return [_build(inside[0], one) for one in value]
    if isinstance(value, Mapping) and get_origin(annotation) is dict:
        return {key: _build(inside[1], one) for key, one in value.items()}
    return _build(inside[0], value) if get_origin(annotation) in _WRAPPERS and inside else value


_WRAPPERS = (Annotated, Union, UnionType)
