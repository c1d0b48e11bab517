"""Kinds of the files of a robot project, by name and text; half-written texts have a kind, too."""

from __future__ import annotations

import re
from enum import Enum
from pathlib import Path

_KEY = re.compile(r"^(plot|profile|deployment|monitor|experience)\s*:", re.MULTILINE)


class Kind(Enum):
    """The kind of a file."""

    PLOT = "plot"
    PROFILE = "profile"
    SCENARIO = "scenario"
    PDDL = "pddl"
    OTHER = "other"


def kind_of(file: Path, text: str) -> Kind:
    """Return the kind of a file: by its ending, by its first distinctive key, else by its folder."""
    if file.suffix == ".pddl":
        return Kind.PDDL
    if file.suffix not in {".yaml", ".yml"}:
        return Kind.OTHER
    key = _KEY.search(text)
    if key is None:
        return _BY_FOLDER.get(file.parent.name, Kind.OTHER)
    return Kind(key[1]) if key[1] in {"plot", "profile"} else Kind.OTHER


_BY_FOLDER = {"plots": Kind.PLOT, "profiles": Kind.PROFILE, "scenarios": Kind.SCENARIO}
