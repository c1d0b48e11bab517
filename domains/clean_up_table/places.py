"""The places of the clean-up-table world, their types, and their positions in metres."""

from __future__ import annotations

import math

SURFACES = ("table", "shelf", "floor")
DESTINATIONS = ("sink", "bin")
OPERATOR = "operator"
PLACES = (*SURFACES, *DESTINATIONS, OPERATOR)

TYPES = {
    **dict.fromkeys(SURFACES, "surface"),
    **dict.fromkeys(DESTINATIONS, "destination"),
    OPERATOR: "place",
}
"""A place's type in the planning domain."""

POSITIONS = {
    "table": (0.0, 0.0),
    "shelf": (-3.0, 0.0),
    "floor": (0.0, -2.0),
    "sink": (3.0, 1.0),
    "bin": (3.0, -2.0),
    OPERATOR: (-3.0, -3.0),
}
"""A place's centre, seen from above: x to the right, y away from the viewer, in metres."""

SIZES = {
    "table": (2.0, 1.0),
    "shelf": (2.0, 0.6),
    "floor": (2.0, 1.0),
    "sink": (0.8, 0.6),
    "bin": (0.6, 0.6),
    OPERATOR: (0.6, 0.6),
}
"""A place's width and depth in metres."""


def distance(start: str, end: str) -> float:
    """Return the distance between two places in metres, in a straight line."""
    return math.dist(POSITIONS[start], POSITIONS[end])
