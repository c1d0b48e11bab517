"""Values of Python in data of plots and back: records, enumerations, tuples."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any, get_args, get_origin

from pydantic import BaseModel, TypeAdapter, ValidationError

from dsc.annotations import is_record, record_fields
from knowledge_base.errors import InputError

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
    if not any(is_record(one) or (isinstance(one, type) and issubclass(one, Enum)) for one in _parts(annotation)):
        return None
    adapter: TypeAdapter[Any] = TypeAdapter(annotation)  # type: ignore[arg-type]  # any annotation may be one

    def build(value: Any) -> Any:
        try:
            return adapter.validate_python(_complete(annotation, value))
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(map(str, first["loc"]))
            raise InputError(f"{where}: {first['msg']}" if where else first["msg"]) from None

    return build


def _parts(annotation: object) -> list[object]:
    return [annotation, *(part for inside in get_args(annotation) for part in _parts(inside))]


def _complete(annotation: object, value: Any) -> Any:
    """Return the data with `None` for each unset field of a record that has no default in its class."""
    inside = [one for one in get_args(annotation) if one is not type(None)]
    if is_record(annotation) and isinstance(value, Mapping):
        own = record_fields(annotation)
        unset = {name: None for name, field in own.items() if field.required and name not in value}
        return {**unset, **{key: _complete(own[key].annotation, one) for key, one in value.items()}}
    if isinstance(value, list) and inside:
        return [_complete(inside[0], one) for one in value]
    if isinstance(value, Mapping) and get_origin(annotation) is dict:
        return {key: _complete(inside[1], one) for key, one in value.items()}
    return _complete(inside[0], value) if len(inside) == 1 else value
