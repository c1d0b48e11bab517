"""Profiles: values of parameters for one robot or simulation, over one set of plots (S2.10, S1.11)."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from pydantic import Field

from dsc.model.language import Setting, Written
from dsc.text.yaml import dump, load_document, read_file, read_model
from knowledge_base.errors import InputError

Settings = dict[str, dict[str, Setting]]


class Profile(Written):
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

    @property
    def digest(self) -> str:
        """A hash of the content."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()[:12]


def parse_profile(text: str, source: str | None = None) -> Profile:
    """Read a profile from YAML text.

    Raises:
        InputError: it is not a profile; the message has the place and the nearest valid key.
    """
    document = load_document(text, source)
    return read_model(Profile, document).written_at(document.places)


def load_profile(path: Path | str) -> Profile:
    """Read a profile file; see `parse_profile`."""
    return parse_profile(read_file(path), str(path))


def profile_to_yaml(profile: Profile) -> str:
    """Return the profile as YAML; reading it gives the same profile."""
    return dump(profile.model_dump(mode="json", by_alias=True, exclude_defaults=True))


def find_profile(name: str, folder: Path) -> Profile:
    """Return the profile of that name in a folder, or else in the file of that path.

    Raises:
        InputError: both are missing, or the file is not a profile; the message has the nearest name.
    """
    known = {file.stem: file for file in sorted(folder.glob("*.yaml"))}
    if name in known:
        return load_profile(known[name])
    if Path(name).suffix in {".yaml", ".yml"}:
        return load_profile(name)
    raise InputError(f"there is no profile '{name}', nor a file (*.yaml) of that name", found=name, valid=known)


def profile_schema() -> dict[str, Any]:
    """Return the JSON Schema of profile files, for editors."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "profile",
        **Profile.model_json_schema(by_alias=True),
    }
