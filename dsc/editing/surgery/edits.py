"""Edits of a plot as values, and their meaning for the plain data of a plot file.

A path leads through the written form of a plot, e.g. `("states", "look", "on", "done", 0)`. In a list of one without
brackets, position 0 is this only element.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

from dsc.editing.roles import PLOT, role_of
from dsc.model.reading import FormPath
from dsc.text.plot_files import may_be_single, place_of_key
from knowledge_base.errors import InputError, UnknownNameError


@dataclass(frozen=True, slots=True)
class Add:
    """Add a part: a state, transition, action, parameter, rule, candidate or any other.

    Attributes:
        path: the path of the new part; missing parts around it are added, too. A number is a position in a list.
        value: the new part as plain data.
        before: name of the part before which the new one is written; by default the usual place of the key, or the end.
    """

    path: FormPath
    value: Any
    before: str | int | None = None


@dataclass(frozen=True, slots=True)
class Remove:
    """Remove the part at a path."""

    path: FormPath


@dataclass(frozen=True, slots=True)
class Replace:
    """Write another value at a path."""

    path: FormPath
    value: Any


@dataclass(frozen=True, slots=True)
class Move:
    """Move a part to another path, which is valid after the removal of the part; see `Add` for `before`."""

    path: FormPath
    to: FormPath
    before: str | int | None = None


@dataclass(frozen=True, slots=True)
class RenameState:
    """Rename the state at a path, and all targets, rules and conditions of the plot that mean it."""

    path: FormPath
    new: str


@dataclass(frozen=True, slots=True)
class RenameVariable:
    """Rename the parameter, variable or output at a path, and all its uses in the plot."""

    path: FormPath
    new: str


Edit = Add | Remove | Replace | Move | RenameState | RenameVariable


def real_path(data: Any, path: FormPath) -> FormPath:
    """Return the path of a part in plain data, without position 0 where a list of one has no brackets.

    Raises:
        UnknownNameError: there is no such part.
    """
    found: list[str | int] = []
    for key in path:
        if key == 0 and not isinstance(data, list | dict) and data is not None:
            continue
        if key == 0 and isinstance(data, dict) and 0 not in data:
            continue
        if not has(data, key):
            valid = [str(one) for one in data] if isinstance(data, dict) else []
            place = "/".join(map(str, found)) or "the plot"
            raise UnknownNameError(f"{place} has no part '{key}'", found=str(key), valid=valid)
        data = data[key]
        found.append(key)
    return tuple(found)


def has(data: Any, key: str | int) -> bool:
    """Return whether a mapping or list has a part."""
    if isinstance(data, list):
        return isinstance(key, int) and 0 <= key < len(data)
    return isinstance(data, dict) and key in data


def part(data: Any, path: FormPath) -> Any:
    """Return the part at a path of `real_path`."""
    for key in path:
        data = data[key]
    return data


def split(data: Any, path: FormPath) -> tuple[FormPath, int]:
    """Return the closest existing part around a new part, and the number of keys of `path` that lead there.

    Raises:
        InputError: the path is empty.
    """
    if not path:
        raise InputError("a path names a part of the plot, and this one is empty")
    for length in range(len(path) - 1, 0, -1):
        try:
            return real_path(data, path[:length]), length
        except UnknownNameError:
            continue
    return (), 0


def missing_parts(path: FormPath, known: int) -> Iterator[tuple[str | int, bool]]:
    """Yield the keys and positions of the missing parts around a new part, innermost first, and whether each is a key.

    Args:
        path: the path of the new part.
        known: the number of keys that lead to an existing part.
    """
    for at in range(len(path) - 1, known, -1):
        if is_key(path[:at], path[at]) or not may_be_single(path[:at]):
            yield path[at], is_key(path[:at], path[at])


def is_key(around: FormPath, key: str | int) -> bool:
    """Return whether a part at a path has this key in a mapping; otherwise the key is a position in a list."""
    return isinstance(key, str) or around[-1:] == ("cases",)


def short_for(path: FormPath) -> str | None:
    """Return the key of a text in short form at a path: the target of a transition, or the type of a declaration."""
    return {"ways": "to", "way": "to", "declaration": "type"}.get(role_of(PLOT, path))


def open_part(inside: Any, around: FormPath, key: str | int) -> dict[str | int, Any] | list[Any]:
    """Return the mapping or list at a path into which a key is inserted; short forms and empty parts become long.

    Raises:
        InputError: a part that is neither gets no parts.
    """
    if not is_key(around, key):
        return inside if isinstance(inside, list) else [] if inside is None else [inside]
    if isinstance(inside, dict | None):
        return inside or {}
    if isinstance(inside, str) and (word := short_for(around)):
        return {word: inside}
    raise InputError(f"{'/'.join(map(str, around))} has no keys, so no '{key}'", found=str(key))


def place(inside: Mapping[Any, Any] | list[Any], around: FormPath, key: str | int, before: str | int | None) -> int:
    """Return the position of a new part among the parts of a mapping or list.

    Raises:
        InputError: the part exists already, or `before` names none.
    """
    if isinstance(inside, list):
        if not isinstance(key, int) or key > len(inside):
            raise InputError(f"the list has {len(inside)} parts, and no place {key}", found=str(key))
        return key
    if key in inside:
        raise InputError(f"there is a part '{key}' already", found=str(key))
    if before is None:
        return place_of_key(inside, key, around)
    if before not in inside:
        valid = [str(one) for one in inside]
        raise UnknownNameError(f"there is no '{before}' before which to write", found=str(before), valid=valid)
    return [*inside].index(before)


def edit_data(data: Any, edit: Add | Remove | Replace | Move) -> Any:
    """Return plain data of a plot file after an edit.

    Raises:
        InputError: the data has no part at a path of the edit, or has the new part already.
    """
    data = deepcopy(data)
    match edit:
        case Add(path, value, before):
            _insert(data, path, deepcopy(value), before)
        case Remove(path):
            _take(data, path)
        case Replace(path, value):
            real = real_path(data, path)
            part(data, real[:-1])[real[-1]] = deepcopy(value)
        case Move(path, to, before):
            _insert(data, to, _take(data, path), before)
    return data


def _take(data: Any, path: FormPath) -> Any:
    real = real_path(data, path)
    return part(data, real[:-1]).pop(real[-1])


def _insert(data: Any, path: FormPath, value: Any, before: str | int | None) -> None:
    around, known = split(data, path)
    key = path[known]
    for missing, in_mapping in missing_parts(path, known):
        value = {missing: value} if in_mapping else [value]
    inside = open_part(part(data, around), around, key)
    at = place(inside, around, key, before)
    if isinstance(inside, list):
        inside.insert(at, value)
    else:
        items = [*inside.items()]
        items.insert(at, (key, value))
        inside.clear()
        inside.update(items)
    if around:
        part(data, around[:-1])[around[-1]] = inside
