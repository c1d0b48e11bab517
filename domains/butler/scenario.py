"""The scenario of the butler: the spoken sentences, and the closed doors, as a YAML file."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, Self

from pydantic import ConfigDict

from dsc.model.reading import Form
from dsc.text.yaml import load_document, read_file, read_model


class Scenario(Form):
    """A scenario file.

    Attributes:
        says: the sentences of the person, in order; `prompt` reads them from the terminal, in real time.
        closed: closed doors by their rooms, e.g. `hall-kitchen`.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    says: tuple[str, ...] | Literal["prompt"]
    closed: tuple[str, ...] = ()

    @classmethod
    def of(cls, given: object, default: Path) -> Self:
        """Return a scenario, or that of a file; errors have file and line."""
        if isinstance(given, cls):
            return given
        path = default if given is None else Path(str(given))
        return cls.parse(read_file(path), str(path))

    @classmethod
    def parse(cls, text: str, source: str) -> Self:
        """Return the scenario of a YAML text; errors have the line."""
        return read_model(cls, load_document(text, source))
