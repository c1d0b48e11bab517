"""The components of the butler: base, mapper, path planner and gripper."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from domains.butler.flat import FURNITURE, ROOMS, Flat, Point
from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.components.parameters import Parameters, parameter
from dsc.errors import SkillError
from dsc.outcomes import Outcome
from dsc.skills import skill
from knowledge_base.facts import Delta, fact

Fault = Callable[..., str | None]
PERSON, SLIPPED = "person in the way", "slipped"


@dataclass
class PathPoint:
    """A point of a path, in metres."""

    x: float
    y: float


class Arrived(Outcome):
    """The robot is at its destination."""


class Stuck(Outcome):
    """The robot cannot continue; it has stopped."""

    reason: str


class PathFound(Outcome):
    """The way through the doors."""

    path: list[PathPoint]


class NoPath(Outcome):
    """No way leads there."""


class Lost(Outcome):
    """The person cannot be seen."""


class Taken(Outcome):
    """The item is in the gripper."""


class Given(Outcome):
    """The person has the item."""


class Slipped(Outcome):
    """The item is where it was."""


class Mapper(Component):
    """The map of the flat, which paths need."""

    name = "mapper"
    modes = ("mapping",)


class PathPlanner(Component):
    """The planner of paths through doors; it needs the map while it navigates."""

    name = "planner_of_paths"
    modes = ("navigating",)
    needs = {"navigating": ("mapper",)}  # noqa: RUF012

    def __init__(self, flat: Flat) -> None:
        super().__init__()
        self._flat = flat

    @skill
    async def find(self, call: SkillCall, x: float, y: float) -> PathFound | NoPath:
        """Return the shortest way to a point."""
        if self.mode != "navigating":
            raise SkillError("the planner of paths is not in the mode 'navigating'")
        await call.clock.sleep(0.5)
        path = self._flat.path((x, y))
        return NoPath() if path is None else PathFound(path=[PathPoint(*point) for point in path])


class BaseParameters(Parameters):
    """The configuration of the base."""

    speed: float = parameter(0.5, least=0.1, most=1.0)
    avoidance: Literal["wide", "narrow"] = "wide"


class Base(Component):
    """The drive with its collision avoidance."""

    name = "base"
    parameters: BaseParameters

    def __init__(self, flat: Flat, fault: Fault) -> None:
        super().__init__()
        self._flat = flat
        self._fault = fault

    @skill
    async def follow_path(self, call: SkillCall, path: list[PathPoint], place: str) -> Arrived | Stuck:
        """Drive along a path."""
        return await self._drive(call, [(stop.x, stop.y) for stop in path], place)

    @skill
    async def go_straight(self, call: SkillCall, x: float, y: float, place: str) -> Arrived | Stuck:
        """Drive to a near point by collision avoidance alone, without a path."""
        return await self._drive(call, [(x, y)], place)

    @skill
    async def follow_person(self, call: SkillCall, seconds: float = 20.0) -> Arrived | Lost:
        """Follow the person for some time."""
        if self._fault(call.action_id, PERSON) is not None:
            return Lost()
        await call.clock.sleep(seconds)
        self._flat.robot = self._flat.person
        return Arrived()

    async def _drive(self, call: SkillCall, stops: list[Point], place: str) -> Arrived | Stuck:
        left = Delta(removed=tuple([fact("robot-at", one) for one in (*ROOMS, *FURNITURE) if one != place]))
        for stop in stops:
            start = self._flat.robot
            if not self._flat.is_free(start, stop):
                return Stuck(reason="a wall is in the way", observed=left)
            steps = max(1, math.ceil(math.dist(start, stop) / (self.parameters.speed * 0.5)))
            narrow = self.parameters.avoidance == "narrow"  # a wide avoidance drives round a person
            blocked = narrow and self._fault(f"{call.action_id} {stop}", PERSON) is not None
            for step in range(1, steps + 1):
                await call.clock.sleep(0.5)
                if blocked and step * 2 > steps:
                    return Stuck(reason="a person is in the way", observed=left)
                part = step / steps
                self._flat.robot = (
                    start[0] + (stop[0] - start[0]) * part,
                    start[1] + (stop[1] - start[1]) * part,
                )
        return Arrived(observed=left.then(Delta(added=(fact("robot-at", place),))))


class TracksParameters(BaseParameters):
    """The configuration of the base on tracks, which is slow."""

    speed: float = parameter(0.2, least=0.05, most=0.3)


class Tracks(Base):
    """A base on tracks: it drives over door sills, and turns on the spot."""

    parameters: TracksParameters


class Gripper(Component):
    """The gripper of the butler."""

    name = "gripper"

    def __init__(self, flat: Flat, fault: Fault) -> None:
        super().__init__()
        self._flat = flat
        self._fault = fault

    @skill
    async def take(self, call: SkillCall, item: str, place: str) -> Taken | Slipped:
        """Take an item from furniture."""
        await call.clock.sleep(3.0)
        if self._fault(call.action_id, SLIPPED) is not None:
            return Slipped()
        self._flat.items[item] = "robot"
        held = Delta(added=(fact("holding", item),), removed=(fact("item-at", item, place),))
        return Taken(observed=held)

    @skill
    async def give(self, call: SkillCall, item: str) -> Given:
        """Give an item to the person."""
        await call.clock.sleep(2.0)
        self._flat.items[item] = "person"
        return Given(observed=Delta(added=(fact("has-person", item),), removed=(fact("holding", item),)))
