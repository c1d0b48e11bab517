"""The simulated house: its true state, the initial knowledge of the robot, and what is left to do."""

from __future__ import annotations

from collections.abc import Sequence

from dsc import Component
from knowledge_base import Delta, fact
from planning import Left, Setup, Simulation

from .skills import Base, Gripper

ROOMS = ("hall", "kitchen", "office")
BELONGS = {"letter": "office", "bread": "kitchen", "book": "office"}


class House(Simulation):
    """Rooms and parcels; all parcels lie in the hall at first."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.robot_in = "kitchen"
        self.place = dict.fromkeys(BELONGS, "hall")

    def components(self) -> Sequence[Component]:
        """Return the components that act on this house."""
        return [Base(self), Gripper(self)]

    def knowledge(self) -> Delta:
        """Return what the robot knows at the start."""
        return Delta(
            nodes={**dict.fromkeys(ROOMS, "room"), **dict.fromkeys(BELONGS, "parcel")},
            added=(
                fact("robot-in", self.robot_in),
                fact("empty"),
                *(fact("lies-in", parcel, room) for parcel, room in self.place.items()),
                *(fact("belongs-in", parcel, room) for parcel, room in BELONGS.items()),
            ),
        )

    def left(self) -> Sequence[Left]:
        """Return the parcels that are in a wrong place, in truth: `goal_reached` does not depend on beliefs."""
        wrong = [parcel for parcel, room in BELONGS.items() if self.place[parcel] != room]
        return [Left(parcel, where=self.place[parcel]) for parcel in wrong]
