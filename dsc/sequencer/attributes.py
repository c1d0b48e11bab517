"""The attributes of outcomes, held against their declaration: on the way of every answer."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.language.inputs import shown
from knowledge_base.language.world import World

Declared = Mapping[str, str | None]
"""Names of attributes -> types; `None` is anything."""


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_text(value: object) -> bool:
    return isinstance(value, str)


_FITS: Mapping[str | None, tuple[str, Callable[[object], bool]]] = {
    "number": ("a finite number", _is_number),
    "boolean": ("a truth value", lambda value: isinstance(value, bool)),
    "text": ("text", _is_text),
    "symbol": ("a name", _is_text),
}  # what is no thing, in words; for things somebody has to be asked who knows them


def require_declared(event: str, attributes: Mapping[str, Any], declared: Declared) -> None:
    """Whether an outcome may have these attributes, as far as that can be said without knowing the world.

    Raises:
        UnknownNameError: one is not declared.
        InputError: one is missing, or is of another type.
    """
    if attributes.keys() != declared.keys():
        _refuse_names(event, attributes, declared)
    for name, type_ in declared.items():
        wanted = _FITS.get(type_)
        if wanted is not None and not wanted[1](attributes[name]):
            raise InputError(f"the attribute '{name}' of '{event}' is {wanted[0]}, not {shown(attributes[name])}")


def _refuse_names(event: str, attributes: Mapping[str, Any], declared: Declared) -> None:
    for name in attributes:
        if name not in declared:
            message = f"the outcome '{event}' has no attribute {shown(name)}"
            raise UnknownNameError(message, found=str(name), valid=declared)
    missing = next(name for name in declared if name not in attributes)
    kind = declared[missing]
    raise InputError(f"the outcome '{event}' needs its attribute '{missing}'" + (f" of type {kind}" if kind else ""))


def require_things(event: str, attributes: Mapping[str, Any], declared: Declared, *worlds: World) -> None:
    """Whether what is declared as a thing is one that is known in one of these worlds, e.g. before and after a change.

    Raises:
        InputError: it is no name, there is no such thing, or it is of another type.
    """
    schema = worlds[0].schema
    for name, wanted in declared.items():
        if wanted is None or wanted not in schema.types:
            continue
        value = attributes.get(name)
        known = [world.type_of(value) for world in worlds] if isinstance(value, str) else []
        found = next((type_ for type_ in known if type_ is not None), None)
        if found is not None and schema.is_a(found, wanted):
            continue
        said = f"the attribute '{name}' of '{event}' is of type {wanted}, and"
        if not isinstance(value, str):
            raise InputError(f"{said} {shown(value)} is no name")
        if found is not None:
            raise SchemaError(f"{said} '{value}' is of type {found}", found=value)
        valid = {thing for world in worlds for thing in world.objects(wanted)}
        raise UnknownNameError(f"{said} there is no object '{value}'", found=value, valid=valid)
