"""Rooms of the mutation test as data: rooms.toml names the modules of each, and the tests that have to notice a mutant."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
ROOMS = Path(__file__).with_name("rooms.toml")


@dataclass(frozen=True)
class Room:
    """Modules that are mutated, and their test files; paths are relative to the repository."""

    name: str
    modules: tuple[str, ...]
    tests: tuple[str, ...]


def read_rooms() -> dict[str, Room]:
    """All rooms by name.

    Raises:
        ValueError: a pattern matches no file, or two rooms mutate one module.
    """
    form = tomllib.loads(ROOMS.read_text())
    rooms = {name: Room(name, _files(said["modules"]), _files(said["tests"])) for name, said in form.items()}
    modules = [module for room in rooms.values() for module in room.modules]
    twice = sorted({module for module in modules if modules.count(module) > 1})
    if twice:
        raise ValueError(f"{ROOMS.name}: more than one room mutates {', '.join(twice)}")
    return rooms


def _files(patterns: Iterable[str]) -> tuple[str, ...]:
    found: set[str] = set()
    for pattern in patterns:
        matches = {str(path.relative_to(ROOT)) for path in ROOT.glob(pattern.removeprefix("!"))}
        if not matches:
            raise ValueError(f"{ROOMS.name}: no file matches {pattern!r}")
        found = found - matches if pattern.startswith("!") else found | matches
    return tuple(sorted(found))
