"""Attention by arcs as a bundle, which robots list in `needs`."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from planning.robot.bundles import Bundle

NAME = "attention"


def bundle() -> Bundle:
    """Return the bundle: the arcs `want-see` and their plot, for a component `attention`."""
    return Bundle.in_folder(
        Path(str(files("domains.attention"))), name=NAME, about="look in turn at what the robot wants to see"
    )
