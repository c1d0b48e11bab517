"""The drivers of a platform and a hand, and the search of paths: the only parts that a new robot implements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, Protocol

from dsc.calls import SkillCall

Point = tuple[float, float]
"""A position in metres."""
Avoidance = Literal["wide", "narrow"]


class PlatformDriver(Protocol):
    """The drive of a mobile platform."""

    async def drive(self, call: SkillCall, stop: Point, speed: float, avoidance: Avoidance) -> str | None:
        """Drive in a straight line from the present position to a stop. A cancelled drive stops the platform.

        Args:
            call: the execution of the skill; its clock is the clock of the movement.
            stop: the end of the line.
            speed: metres per second.
            avoidance: whether the platform leaves its line for obstacles (`wide`), or stops (`narrow`).

        Returns:
            The reason why the platform cannot continue; `None` at the stop.

        Raises:
            SkillError: the device has failed.
        """
        ...


class PathFinder(Protocol):
    """The search of a path for the platform, e.g. on a map."""

    async def path(self, call: SkillCall, target: Point) -> Sequence[Point] | None:
        """Return the stops from the present position to the target; `None` if no path leads there.

        The present position and the target may be omitted.
        """
        ...


class HandDriver(Protocol):
    """A hand, a gripper or a suction cup, which holds one item."""

    async def grasp(self, call: SkillCall, item: str) -> str | None:
        """Grasp an item in front of the robot; return the reason why the hand does not hold it, or `None`.

        Raises:
            SkillError: the device has failed.
        """
        ...

    async def release(self, call: SkillCall, item: str, place: str | None) -> str | None:
        """Put the item down at a place; without a place, give it to a person.

        Returns:
            The reason why the hand still holds the item, or `None`.

        Raises:
            SkillError: the device has failed.
        """
        ...
