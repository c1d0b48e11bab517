"""The part of the house that skills use: its true state, and the faults that hit them."""

from __future__ import annotations

from typing import Protocol


class World(Protocol):
    """The house as skills see it; `place` has the room of each parcel, or `gripper`."""

    robot_in: str
    place: dict[str, str]

    def fault(self, action: str, *kinds: str) -> str | None:
        """Return the kind of the fault that hits an action; `None` without a fault."""
