"""The drivers of the butler's flat, and the base that follows a person."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from domains.butler.flat import Flat
from domains.fetch_skills.drivers import Avoidance, PlatformDriver, Point
from domains.fetch_skills.platform import Arrived, Platform
from dsc.calls import SkillCall
from dsc.outcomes import Outcome
from dsc.skills import skill

Fault = Callable[..., str | None]
PERSON, SLIPPED = "person in the way", "slipped"


class Lost(Outcome):
    """The person cannot be seen."""


class Butler:
    """The robot in the flat: a platform, its paths, and a gripper.

    Args:
        flat: the true state.
        fault: draws the faults of an action.
        turning: seconds that a turn takes at each stop.
    """

    def __init__(self, flat: Flat, fault: Fault, turning: float = 0.0) -> None:
        self._flat = flat
        self._fault = fault
        self._turning = turning

    async def drive(self, call: SkillCall, stop: Point, speed: float, avoidance: Avoidance) -> str | None:
        """Drive in a straight line; a wide avoidance drives round a person."""
        start = self._flat.robot
        if not self._flat.is_free(start, stop):
            return "a wall is in the way"
        if self._turning:
            await call.clock.sleep(self._turning)
        steps = max(1, math.ceil(math.dist(start, stop) / (speed * 0.5)))
        blocked = avoidance == "narrow" and self._fault(f"{call.action_id} {stop}", PERSON) is not None
        for step in range(1, steps + 1):
            await call.clock.sleep(0.5)
            if blocked and step * 2 > steps:
                return "a person is in the way"
            part = step / steps
            self._flat.robot = (start[0] + (stop[0] - start[0]) * part, start[1] + (stop[1] - start[1]) * part)
        return None

    async def path(self, call: SkillCall, target: Point) -> Sequence[Point] | None:
        """Return the shortest way through open doors."""
        await call.clock.sleep(0.5)
        return self._flat.path(target)

    async def grasp(self, call: SkillCall, item: str) -> str | None:
        """Take an item from furniture."""
        await call.clock.sleep(3.0)
        if self._fault(call.action_id, SLIPPED) is not None:
            return "it slipped"
        self._flat.items[item] = "robot"
        return None

    async def release(self, call: SkillCall, item: str, place: str | None) -> str | None:
        """Put the item down, or give it to the person."""
        await call.clock.sleep(2.0)
        self._flat.items[item] = place or "person"
        return None


class Base(Platform):
    """A platform that also follows a person."""

    def __init__(self, driver: PlatformDriver, flat: Flat, fault: Fault) -> None:
        super().__init__(driver)
        self._flat = flat
        self._fault = fault

    @skill
    async def follow_person(self, call: SkillCall, seconds: float = 20.0) -> Arrived | Lost:
        """Follow the person for some time."""
        if self._fault(call.action_id, PERSON) is not None:
            return Lost()
        await call.clock.sleep(seconds)
        self._flat.robot = self._flat.person
        return Arrived()
