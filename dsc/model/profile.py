"""Profiles: values of parameters for one robot or simulation, over one set of plots (S2.10, S1.11)."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

from pydantic import Field, PrivateAttr

from dsc.model.language import Frozen, Setting
from knowledge_base.errors import Place

Path = tuple[str | int, ...]


Settings = dict[str, dict[str, Setting]]


class Profile(Frozen):
    """A robot and the values of its parameters.

    Attributes:
        name: its name (`profile`).
        robot: one of the world's robots; by default its usual one.
        components: component -> parameter -> value, within the range that its builder declares.
        plots: plot -> parameter -> value, as the parameter's new default; users of the plot may set another value.
    """

    name: str = Field(alias="profile", pattern=r"^[a-zA-Z_][\w\-]*$")
    about: str | None = None
    robot: str | None = None
    components: Settings = Field(default_factory=dict)
    plots: Settings = Field(default_factory=dict)
    _places: Mapping[Path, Place] = PrivateAttr(default_factory=dict)

    def written_at(self, places: Mapping[Path, Place]) -> Profile:
        """Return the profile with the places of its parts in the text it was read from."""
        self._places = places
        return self

    @property
    def digest(self) -> str:
        """A hash of the content."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()[:12]

    def place(self, *path: str) -> Place | None:
        """Return the place in the text of the part at `path`, or of the closest known part around it."""
        known = (path[:length] for length in range(len(path), -1, -1))
        return next((self._places[part] for part in known if part in self._places), None)
