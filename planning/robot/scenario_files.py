"""Scenario files of a project: the robot's simulation reads each of them, so that `dsc check` finds their mistakes."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from dsc.components.hooks import contained
from dsc.errors import ProgrammingError
from knowledge_base.errors import InputError, tolerated
from planning.robot.bringup import simulated
from planning.robot.bundles import Bundle
from planning.robot.project_files import YAML
from planning.robot.simulation import Setup

FOLDER = "scenarios"
"""The name of the folders whose YAML files are scenarios."""


def check_scenarios(bundle: Bundle, files: Iterable[Path]) -> None:
    """Add an error for each scenario that the simulation of a robot refuses; used inside `collecting`.

    Args:
        bundle: the robot; without a simulation that reads scenarios, nothing is checked.
        files: the files of the project, of which those in a folder `scenarios` are read.
    """
    if bundle.simulation is None or not bundle.simulation.reads_scenarios:
        return
    for file in files:
        if file.parent.name == FOLDER and file.suffix in YAML:
            with tolerated():
                _simulate(bundle, file)


def _simulate(bundle: Bundle, file: Path) -> None:
    """Make the simulation of a scenario, and close it; raise `InputError` for a mistake."""
    try:
        with contained(f"the simulation of '{file}'", (InputError,)):
            simulation = simulated(bundle, Setup(scenario=file))
    except ProgrammingError as error:
        raise InputError(f"programming error in {error}") from error
    if simulation is not None:
        simulation.close()
