"""The skills of an arm as a bundle, which robots list in `needs`."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from planning.robot.bundles import Bundle

NAME = "arm-skills"


def bundle() -> Bundle:
    """Return the bundle: the plots `move_joints`, `take_pose` and `move_tool`, for a component `arm`."""
    folder = Path(str(files("domains.arm_skills")))
    return Bundle.in_folder(folder, name=NAME, about="skills of any arm: move joints, take a pose, move the tool")
