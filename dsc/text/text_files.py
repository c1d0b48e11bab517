"""Files of plots, profiles, scenarios and charts, read up to a bounded size."""

from __future__ import annotations

from pathlib import Path

from knowledge_base.errors import InputError, Place
from knowledge_base.language.checking.inputs import shown
from knowledge_base.pddl.files import read_text, require_size

MAX_BYTES = 250_000
"""A hundred times the longest plot of this project; a larger file would delay its author's error message."""


def read_file(path: Path | str) -> str:
    """Return the text of a file.

    Raises:
        InputError: it cannot be read, is not UTF-8, or has more than `MAX_BYTES`; as `knowledge_base.pddl.files`.
    """
    return read_text(path_of(path), most=MAX_BYTES)


def path_of(path: object) -> Path:
    """Return the path of that name; raise `InputError` for any value except a text or path."""
    if not isinstance(path, str | Path):
        raise InputError(f"a file or folder is named by a text or a Path, not {shown(path)}")
    return Path(path)


def check_size(size: int, place: Place) -> None:
    """Raise `InputError` for a text of more than `MAX_BYTES`."""
    require_size(size, MAX_BYTES, place.source)
