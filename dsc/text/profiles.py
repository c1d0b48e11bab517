"""Settings profiles: values of parameters for one robot or simulation, for a common set of plots (S2.10, S1.11)."""

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
    """A settings profile: a robot, and values of parameters for this robot.

    Attributes:
        name: name of the profile (`profile`).
        robot: name of a robot in the world; without it, the world's default robot.
        components: values by component and parameter, within the range that the component's builder declares.
        plots: new defaults by plot and parameter; plots that use the plot may pass another value.
    """

    name: str = Field(alias="profile", pattern=r"^[a-zA-Z_][\w\-]*$")
    about: str | None = None
    robot: str | None = None
    components: Settings = Field(default_factory=dict)
    plots: Settings = Field(default_factory=dict)

    @property
    def digest(self) -> str:
        """Hash of the content as 12 hexadecimal digits."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()[:12]


def parse_profile(text: str, source: str | None = None) -> Profile:
    """Return the profile that YAML text contains; `source` is the file name in messages.

    Raises:
        InputError: the text is not a profile; the message has the place and the nearest valid key.
    """
    document = load_document(text, source)
    return read_model(Profile, document).written_at(document.places)


def load_profile(path: Path | str) -> Profile:
    """Return the profile in a profile file; errors as for `parse_profile` and `read_file`."""
    return parse_profile(read_file(path), str(path))


def profile_to_yaml(profile: Profile) -> str:
    """Return the profile as YAML; `parse_profile` returns an equal profile."""
    return dump(profile.model_dump(mode="json", by_alias=True, exclude_defaults=True))


def find_profile(name: str, folder: Path) -> Profile:
    """Return the profile `name` of a folder; if the folder has none, `name` is the path of a profile file.

    Raises:
        InputError: neither file exists, or the file is not a profile; the message has the nearest name.
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
