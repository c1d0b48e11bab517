"""The scenario of the elevator as a YAML file: the floors, the persons, and the source of the answers."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, Self

from pydantic import ConfigDict

from dsc.model.reading import Form
from dsc.text.yaml import load_document, read_file, read_model

Floor = Literal["floor0", "floor1", "floor2", "floor3", "floor4"]

Person = Literal["anna", "bert", "cleo", "dora", "emil"]


class Scenario(Form):
    """A scenario file.

    Attributes:
        start: the floor on which the robot waits.
        destination: the floor that is assigned to the robot.
        persons: the persons who take the lift, of anna, bert, cleo, dora and emil.
        answers: `persons` for simulated answers, or `console` for yours, in real time.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    start: Floor = "floor0"
    destination: Floor = "floor3"
    persons: tuple[Person, ...] = ("anna", "bert", "cleo", "dora", "emil")
    answers: Literal["persons", "console"] = "persons"

    @classmethod
    def of(cls, given: object) -> Self:
        """Return a scenario, or that of a file, or the usual one without either; errors have file and line."""
        if isinstance(given, cls):
            return given
        if given is None:
            return cls()
        path = Path(str(given))
        return read_model(cls, load_document(read_file(path), str(path)))
