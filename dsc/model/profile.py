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
    """Which robot is used, and what its parameters are worth.

    Attributes:
        name: its name (`profile`).
        robot: which of the robots that a world has; its usual one if left out.
        components: component -> parameter -> value, within what its builder declares.
        plots: plot -> parameter -> value, in place of the parameter's default; who uses the plot may say another.
    """

    name: str = Field(alias="profile", pattern=r"^[a-zA-Z_][\w\-]*$")
    about: str | None = None
    robot: str | None = None
    components: Settings = Field(default_factory=dict)
    plots: Settings = Field(default_factory=dict)
    _places: Mapping[Path, Place] = PrivateAttr(default_factory=dict)

    def written_at(self, places: Mapping[Path, Place]) -> Profile:
        """The same profile that remembers where its parts stand in the text it was read from."""
        self._places = places
        return self

    @property
    def digest(self) -> str:
        """A hash of what it says."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()[:12]

    def place(self, *path: str) -> Place | None:
        """Where the part at `path`, or the closest part around it that is known, was written."""
        known = (path[:length] for length in range(len(path), -1, -1))
        return next((self._places[part] for part in known if part in self._places), None)
