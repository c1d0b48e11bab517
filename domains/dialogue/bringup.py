"""Dialogue by arcs as a bundle, which robots list in `needs`."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from planning.robot.bundles import Bundle

NAME = "dialogue"


def bundle() -> Bundle:
    """Return the bundle: arcs and plots of a dialogue, for a component `dialogue`."""
    return Bundle.in_folder(
        Path(str(files("domains.dialogue"))),
        name=NAME,
        about="speak, ask and listen by arcs of the knowledge base",
        failures=("unanswered", "nothing_heard"),
    )
