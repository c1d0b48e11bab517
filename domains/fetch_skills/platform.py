"""The platform of any robot, and its paths: typed skills with speeds and limits from the profile (S2.15)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

from domains.fetch_skills.drivers import Avoidance, PathFinder, PlatformDriver, Point
from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.components.parameters import Parameters, parameter
from dsc.errors import SkillError
from dsc.outcomes import Outcome
from dsc.skills import skill
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta, fact
from knowledge_base.language.checking.inputs import require_methods
from knowledge_base.user_objects import shown

Position = Annotated[list[float], "geometry"]
"""Coordinates x and y in metres, from the knowledge base."""


@dataclass
class PathPoint:
    """A stop of a path, in metres."""

    x: float
    y: float


class Arrived(Outcome):
    """The platform is at its destination."""


class Stuck(Outcome):
    """The platform cannot continue; it has stopped."""

    reason: str


class PathFound(Outcome):
    """The stops of the path."""

    path: list[PathPoint]


class NoPath(Outcome):
    """No path leads there."""


class Mapper(Component):
    """The map that paths need. A robot that builds its map overrides `switched`."""

    name = "mapper"
    modes = ("mapping",)


class PathPlanner(Component):
    """The planner of paths; it needs the map while it navigates.

    Args:
        finder: searches the paths.
    """

    name = "path_planner"
    modes = ("navigating",)
    needs = {"navigating": ("mapper",)}  # noqa: RUF012

    def __init__(self, finder: PathFinder) -> None:
        super().__init__()
        self._finder = require_methods(finder, PathFinder)

    @skill
    async def find(self, call: SkillCall, target: Position) -> PathFound | NoPath:
        """Return the path to a position."""
        if self.mode != "navigating":
            raise SkillError("the planner of paths is not in the mode 'navigating'")
        end = target[0], target[1]
        path = await self._finder.path(call, end)
        if path is None:
            return NoPath()
        stops = [*path] if path and path[-1] == end else [*path, end]
        return PathFound(path=[_path_point(stop) for stop in stops])


class PlatformParameters(Parameters):
    """The configuration of the platform: plots set speed and avoidance, and a profile limits the speed."""

    speed: float = parameter(0.5, least=0.01, most=10.0)
    fastest: float = parameter(10.0, least=0.01, most=10.0, changed_by="profile")
    avoidance: Avoidance = "wide"


class Platform(Component):
    """The drive with its collision avoidance.

    The robot learns `(robot-at ?place)` at the end of a drive. A plot that starts a drive retracts the place before.

    Args:
        driver: moves the platform.
    """

    name = "base"
    parameters: PlatformParameters

    def __init__(self, driver: PlatformDriver) -> None:
        super().__init__()
        self._driver = require_methods(driver, PlatformDriver)

    @skill
    async def follow_path(self, call: SkillCall, path: list[PathPoint], place: str) -> Arrived | Stuck:
        """Drive along a path."""
        return await self._drive(call, [(stop.x, stop.y) for stop in path], place)

    @skill
    async def go_straight(self, call: SkillCall, target: Position, place: str) -> Arrived | Stuck:
        """Drive to a near position by collision avoidance alone, without a path."""
        return await self._drive(call, [(target[0], target[1])], place)

    async def _drive(self, call: SkillCall, stops: Iterable[Point], place: str) -> Arrived | Stuck:
        speed = min(self.parameters.speed, self.parameters.fastest)
        for stop in stops:
            reason = await self._driver.drive(call, stop, speed, self.parameters.avoidance)
            if reason is not None:
                return Stuck(reason=reason)
        return Arrived(observed=Delta(added=(fact("robot-at", place),)))


def _path_point(stop: object) -> PathPoint:
    """Return a stop of a path; raise `InputError` for another object, e.g. the name of a place."""
    match stop:
        case (int() | float() as x, int() | float() as y):
            return PathPoint(float(x), float(y))
        case _:
            raise InputError(f"the stops of a path are pairs (x, y) in metres, not {shown(stop)}")
