"""Names of a plot: those of states are unique, those of data are declared once and can be written in conditions."""

from __future__ import annotations

import re
from collections.abc import Iterable

from pydantic_core import PydanticCustomError

from dsc.model.reading import LOCATED, FormPath
from knowledge_base.spelling import is_plain_name

_STATE_NAME = re.compile(r"[^/#][^/]*")
# Slashes separate state names in paths. In a stored state, a name that begins with # identifies a region.


def check_states(states: Iterable[tuple[str, object, FormPath]]) -> None:
    """Raise `PydanticCustomError` for a name that is not valid for a state, or that two states have."""
    seen: set[str] = set()
    for name, _, path in states:
        if _STATE_NAME.fullmatch(name) is None:
            wrong = "'{name}' is not a name for a state: it has a slash, begins with # or is empty"
            raise PydanticCustomError(LOCATED, wrong, {"name": name, "path": path})
        if name in seen:
            twice = "two states are named '{name}'; names are unique in a plot"
            raise PydanticCustomError(LOCATED, twice, {"name": name, "path": path})
        seen.add(name)


def check_variables(paths: Iterable[FormPath]) -> None:
    """Raise `PydanticCustomError` for a name that conditions and terms cannot read as `?name` or `?event.name`."""
    for path in paths:
        if not is_plain_name(str(path[-1])):
            wrong = "'{name}' is not a name for a variable: the language folds names to lower case"
            raise PydanticCustomError(LOCATED, wrong, {"name": path[-1], "path": path})


def check_declarations(paths: Iterable[FormPath]) -> None:
    """Raise `PydanticCustomError` for a name that is declared twice; the group of a name is before it in the path."""
    seen: dict[str | int, str] = {}
    for path in paths:
        name, kind = path[-1], str(path[-2]).removesuffix("s")
        if name in seen:
            context = {"name": name, "other": seen[name], "kind": kind, "path": path}
            raise PydanticCustomError(LOCATED, "'{name}' is declared twice: as {other} and as {kind}", context)
        seen[name] = kind
