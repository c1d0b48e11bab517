"""Search for the project around a file, as an editor opens it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from dsc.editing.projects import Project
from knowledge_base.errors import InputError
from planning.robot.targets import ROBOT, entry_points_of

PROJECT_FILE = "pyproject.toml"


def project_around(file: Path) -> Project | None:
    """Return the project of the closest folder above a file that has a `pyproject.toml` or a `robot.py`.

    The `robot.py` of a package belongs to the project around the package.

    Of several bundles of one project, the one whose module is closest to the file is checked. `None` without a project.
    """
    file = file.absolute()
    for folder in file.parents:
        in_package = (folder / "__init__.py").is_file()
        for main in (folder / PROJECT_FILE, folder / f"{ROBOT}.py"):
            if main.is_file() and not (in_package and main.name != PROJECT_FILE):
                return Project(folder, main, _target(folder, file))
    return None


def _target(folder: Path, file: Path) -> str:
    """Return the folder, or `MODULE:NAME` of one of its bundles."""
    try:
        points = entry_points_of(folder)
    except InputError:  # the check of the folder reports it
        return str(folder)
    if len(points) < 2:
        return str(folder)
    homes = {value: home for value in points.values() for home in _homes(folder, value)}
    around = [value for value, home in homes.items() if home in file.parents]
    return max(around, key=lambda value: len(homes[value].parts), default=str(folder))


def _homes(folder: Path, value: str) -> Iterator[Path]:
    """Yield the folder of the module in an entry point `MODULE:NAME`."""
    parts = value.partition(":")[0].split(".")
    for inside in (folder / "src", folder):
        if (inside.joinpath(*parts)).with_suffix(".py").is_file():
            yield inside.joinpath(*parts).parent
