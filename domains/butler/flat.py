"""The simulated flat: rooms with walls and doors, furniture, things and a person, and what a robot can reach."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import networkx as nx

Point = tuple[float, float]
_STEP = 0.05  # metres


@dataclass(frozen=True, slots=True)
class Room:
    """A rectangular room with walls around; `low` and `high` are its corners in metres."""

    low: Point
    high: Point

    @property
    def middle(self) -> Point:
        """The middle of the room."""
        return (self.low[0] + self.high[0]) / 2, (self.low[1] + self.high[1]) / 2

    def contains(self, point: Point) -> bool:
        """Return whether the point is inside."""
        return self.low[0] <= point[0] <= self.high[0] and self.low[1] <= point[1] <= self.high[1]


ROOMS = {
    "hall": Room((0, 0), (6, 2)),
    "kitchen": Room((0, 2), (3, 5)),
    "dining_room": Room((3, 2), (6, 5)),
    "living_room": Room((0, -3), (6, 0)),
}
DOORS: dict[tuple[str, str], Point] = {
    ("hall", "kitchen"): (1.5, 2),
    ("hall", "dining_room"): (4.5, 2),
    ("hall", "living_room"): (3, 0),
}
FURNITURE: dict[str, Point] = {"shelf": (5.4, 1.5), "fridge": (0.5, 4.5), "sofa": (1, -2.5), "table": (5, 4)}
ITEMS = {"juice": "fridge", "book": "shelf", "cup": "table"}
HOME = "hall"


def spots() -> dict[str, Point]:
    """Return the position of each location: the middle of a room, or a piece of furniture."""
    return {**{name: room.middle for name, room in ROOMS.items()}, **FURNITURE}


class Flat:
    """The state of the flat.

    Attributes:
        robot: position of the robot in metres.
        items: the place of each item: a location, `robot` or `person`.
        closed: doors that are closed, by their rooms.
        person: the person who walks through the flat, and the places where this person stops.
    """

    def __init__(self) -> None:
        self.robot: Point = ROOMS[HOME].middle
        self.items = dict(ITEMS)
        self.closed: set[tuple[str, str]] = set()
        self.person: Point = (2.0, 1.0)

    def room_of(self, point: Point) -> str:
        """Return the room of a point."""
        return next(name for name, room in ROOMS.items() if room.contains(point))

    def path(self, target: Point) -> list[Point] | None:
        """Return the shortest way through open doors, from the robot to the target; `None` without a way."""
        graph: nx.Graph[str] = nx.Graph()
        stops = {"start": (self.robot, {self.room_of(self.robot)}), "target": (target, {self.room_of(target)})}
        stops |= {f"{a}-{b}": (door, {a, b}) for (a, b), door in DOORS.items() if (a, b) not in self.closed}
        names = list(stops)
        for number, one in enumerate(names):
            for other in names[number + 1 :]:
                if stops[one][1] & stops[other][1]:
                    graph.add_edge(one, other, weight=math.dist(stops[one][0], stops[other][0]))
        try:
            return [stops[name][0] for name in nx.shortest_path(graph, "start", "target", weight="weight")]
        except (nx.NetworkXNoPath, nx.NodeNotFound):
            return None

    def is_free(self, start: Point, end: Point) -> bool:
        """Return whether the straight line meets no wall and no closed door."""
        steps = max(1, round(math.dist(start, end) / _STEP))
        points = [
            (start[0] + (end[0] - start[0]) * n / steps, start[1] + (end[1] - start[1]) * n / steps)
            for n in range(steps + 1)
        ]
        return all(self._connects(one, other) for one, other in pairwise(points))

    def _connects(self, one: Point, other: Point) -> bool:
        rooms = {self.room_of(one), self.room_of(other)}
        if len(rooms) == 1:
            return True
        door = next((at for between, at in DOORS.items() if {*between} == rooms and between not in self.closed), None)
        return door is not None and math.dist(door, one) < 0.5

    def scene(self) -> list[dict[str, Any]]:
        """Return rooms, furniture, items, person and robot for the page."""
        things: list[dict[str, Any]] = []
        for name, room in ROOMS.items():
            x, y = room.middle
            size = {"width": room.high[0] - room.low[0], "depth": room.high[1] - room.low[1]}
            things.append({"id": name, "shape": "room", "x": x, "y": y, "label": name, **size})
        for name, (x, y) in FURNITURE.items():
            things.append({"id": name, "shape": "furniture", "x": x, "y": y, "label": name, "width": 0.7, "depth": 0.4})
        at = {**spots(), "robot": self.robot, "person": self.person}
        for name, place in self.items.items():
            inside = {"in": "robot"} if place == "robot" else {}
            things.append({"id": name, "shape": "item", "x": at[place][0], "y": at[place][1], "label": name, **inside})
        things.append(
            {"id": "person", "shape": "operator", "x": self.person[0], "y": self.person[1], "label": "person"}
        )
        things.append({"id": "robot", "shape": "robot", "x": self.robot[0], "y": self.robot[1], "label": "butler"})
        return things
