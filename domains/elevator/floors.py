"""The floors of the house, looked up from a file: their words and places (S4.14)."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from pydantic import ConfigDict, RootModel

from dsc.model.reading import Form
from dsc.text.yaml import load_document, read_file, read_model

FILE = Path(str(files("domains.elevator"))) / "floors.yaml"


class Floor(Form):
    """A floor.

    Attributes:
        words: the words of persons for it, besides its number.
        place: x and y of the place next to the lift, in metres.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    words: tuple[str, ...]
    place: tuple[float, float]


class Floors(RootModel[dict[str, Floor]]):
    """All floors by their names, from below."""


FLOORS = read_model(Floors, load_document(read_file(FILE), str(FILE))).root
"""The floors by their names, from below."""
