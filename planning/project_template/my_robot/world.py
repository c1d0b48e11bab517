"""The true state of the house, which skills change."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class World:
    """The room of the robot, and the room of each parcel, or `gripper`."""

    robot_in: str
    place: dict[str, str]
