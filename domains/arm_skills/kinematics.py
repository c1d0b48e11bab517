"""The kinematics of an arm in a plane: joints with limits and speeds, forward and inverse kinematics."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

Point = tuple[float, float]
Angles = Mapping[str, float]
"""Angles of joints by name, in degrees."""
_MOST_TURNS = 400
_NEAR = 0.005  # metres


@dataclass(frozen=True, slots=True)
class Joint:
    """A revolute joint, and the link that it turns.

    Attributes:
        name: the name of the joint.
        length: length of the link in metres.
        least: the smallest angle to the link before, in degrees.
        most: the largest angle, in degrees.
        speed: degrees per second.
    """

    name: str
    length: float
    least: float = -150.0
    most: float = 150.0
    speed: float = 60.0


class Chain:
    """Joints in their order from the base to the tool. The first angle is measured from the x axis.

    Args:
        joints: the joints.
        base: position of the first joint in metres.
    """

    def __init__(self, joints: Iterable[Joint], base: Point = (0.0, 0.0)) -> None:
        self.joints = tuple(joints)
        self.base = base

    def points(self, angles: Angles) -> list[Point]:
        """Return the positions of the base and of each link's end; the last one is the tool."""
        x, y = self.base
        points, direction = [self.base], 0.0
        for joint in self.joints:
            direction += math.radians(angles[joint.name])
            x, y = x + joint.length * math.cos(direction), y + joint.length * math.sin(direction)
            points.append((x, y))
        return points

    def angles_for(
        self, tool: Point, start: Angles, limits: Mapping[str, tuple[float, float]]
    ) -> dict[str, float] | None:
        """Return angles within the limits that bring the tool to a point; `None` if the point is out of reach.

        Cyclic coordinate descent: each joint in turn points the tool at the target, from the last joint to the first.
        """
        angles = {joint.name: _bound(start[joint.name], limits[joint.name]) for joint in self.joints}
        for _ in range(_MOST_TURNS):
            if math.dist(self.points(angles)[-1], tool) < _NEAR:
                return angles
            for index, joint in reversed([*enumerate(self.joints)]):
                points = self.points(angles)
                turn = _direction(points[index], tool) - _direction(points[index], points[-1])
                wanted = angles[joint.name] + (turn + 180.0) % 360.0 - 180.0
                angles[joint.name] = _bound(wanted, limits[joint.name])
        return None


def _direction(start: Point, end: Point) -> float:
    return math.degrees(math.atan2(end[1] - start[1], end[0] - start[0]))


def _bound(angle: float, limits: tuple[float, float]) -> float:
    least, most = limits
    return min(max(angle, least), most)
