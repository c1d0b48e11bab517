"""The skills of a robot that drives and grasps as a bundle, which robots list in `needs`."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from planning.robot.bundles import Bundle

NAME = "fetch-skills"


def bundle() -> Bundle:
    """Return the bundle: plots and planning actions for the components `base`, `mapper`, `path_planner` and `hand`."""
    folder = Path(str(files("domains.fetch_skills")))
    return Bundle.in_folder(
        folder,
        name=NAME,
        about="skills of any robot that drives and grasps: go, take, put, bring",
        failures=("not_there", "not_taken", "not_released", "not_brought"),
    )
