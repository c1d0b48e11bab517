"""The robot of clean-up-table as components over one world: base, arm, camera, voice (S0.7, S0.8).

A skill takes its time first and acts on the world after it, in one go: a call that is cancelled on the way
changes nothing. It hands over what the robot observes, never the world's truth.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from domains.clean_up_table.observations import initial_knowledge, learned
from domains.clean_up_table.places import PLACES, distance
from dsc.skills import Component, Outcome, SkillCall, skill

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from domains.clean_up_table.results import Result
    from domains.clean_up_table.world import World
    from dsc.skills import AfterCrash

__all__ = ["Arm", "Base", "Camera", "Voice", "initial_knowledge"]

SPEED = 0.5  # metres a second
STARTING = 1.0  # seconds until the base moves
GRASPING, PUTTING, STACKING, THROWING = 4.0, 3.0, 5.0, 3.0  # seconds
RECOGNISING, LOOKING = 2.0, 1.5  # seconds
CHARACTERS_A_SECOND = 15.0

_ITEM_AT = {"item": "item", "surface": "surface"}
_ITEM_IN = {"item": "item", "carrier": "item", "surface": "surface"}
_CARRIER_AT = {"carrier": "item", "surface": "surface"}
_ONCE: AfterCrash = "same_id"  # the world does each id once
_NOT_POSSIBLE: dict[str, str | None] = {"reason": None}


class Base(Component):
    """The mobile base."""

    name = "base"

    def __init__(self, world: World, name: str | None = None) -> None:
        super().__init__(name)
        self.world = world

    @skill(
        outcomes={
            "arrived": {"to": "place"},
            "no_path": {"to": "place"},
            "slipped": {"item": "item", "surface": "surface", "to": "place"},
            "not_possible": _NOT_POSSIBLE,
        },
        types={"to": "place"},
        after_crash=_ONCE,
    )
    async def drive(self, call: SkillCall, to: str) -> Outcome:
        """Drive to a place; a held item may slip, and then robot and item are at the floor."""
        metres = distance(self.world.place_before(call.action_id), to) if to in PLACES else 0.0
        await call.clock.sleep(STARTING + metres / SPEED)
        return _outcome(self.world.drive(call.action_id, to))


class Arm(Component):
    """The arm with its one hand."""

    name = "arm"

    def __init__(self, world: World, name: str | None = None) -> None:
        super().__init__(name)
        self.world = world

    @skill(
        outcomes={
            "picked_up": _ITEM_AT,
            "grasp_failed": _ITEM_AT,
            "no_ik": _ITEM_AT,
            "gone": _ITEM_AT,
            "not_possible": _NOT_POSSIBLE,
        },
        types=_ITEM_AT,
        after_crash=_ONCE,
    )
    async def pick_up(self, call: SkillCall, item: str, surface: str) -> Outcome:
        """Pick an item, with everything in it, up from a surface."""
        await call.clock.sleep(GRASPING)
        return _outcome(self.world.pick_up(call.action_id, item, surface))

    @skill(outcomes={"put_down": _ITEM_AT, "not_possible": _NOT_POSSIBLE}, types=_ITEM_AT, after_crash=_ONCE)
    async def put_down(self, call: SkillCall, item: str, surface: str) -> Outcome:
        """Put the held item on a surface."""
        await call.clock.sleep(PUTTING)
        return _outcome(self.world.put_down(call.action_id, item, surface))

    @skill(
        outcomes={
            "stacked": _ITEM_IN,
            "stack_fell": {**_ITEM_IN, "items": None},
            "gone": _ITEM_AT,
            "not_possible": _NOT_POSSIBLE,
        },
        types=_ITEM_IN,
        after_crash=_ONCE,
    )
    async def stack(self, call: SkillCall, item: str, carrier: str, surface: str) -> Outcome:
        """Put the held item into a carrier on a surface; `gone` names the carrier."""
        await call.clock.sleep(STACKING)
        return _outcome(self.world.stack(call.action_id, item, carrier, surface))

    @skill(
        outcomes={
            "taken_out": _ITEM_IN,
            "grasp_failed": _ITEM_IN,
            "no_ik": _ITEM_IN,
            "gone": _ITEM_AT,
            "not_possible": _NOT_POSSIBLE,
        },
        types=_ITEM_IN,
        after_crash=_ONCE,
    )
    async def take_out(self, call: SkillCall, item: str, carrier: str, surface: str) -> Outcome:
        """Take an item out of its carrier on a surface; `gone` names the carrier."""
        await call.clock.sleep(GRASPING)
        return _outcome(self.world.take_out(call.action_id, item, carrier, surface))

    @skill(
        outcomes={
            "thrown_away": {"item": "item", "destination": "destination"},
            "not_possible": _NOT_POSSIBLE,
        },
        types={"item": "item", "destination": "destination"},
        after_crash=_ONCE,
    )
    async def throw_away(self, call: SkillCall, item: str, destination: str) -> Outcome:
        """Throw the held item, with everything in it, into its destination."""
        await call.clock.sleep(THROWING)
        return _outcome(self.world.throw_away(call.action_id, item, destination))


class Camera(Component):
    """The camera, which also reports what it misses.

    Args:
        world: what it looks at.
        believed: the items that the robot believes to lie on a surface, asked at the moment of the look.
        name: how charts address it.
    """

    name = "camera"

    def __init__(
        self, world: World, believed: Callable[[str], Iterable[str]], name: str | None = None
    ) -> None:
        super().__init__(name)
        self.world = world
        self.believed = believed

    @skill(
        outcomes={
            "recognised": {"surface": "surface", "count": None},
            "nothing_found": {"surface": "surface"},
            "not_possible": _NOT_POSSIBLE,
        },
        types={"surface": "surface"},
        after_crash=_ONCE,
    )
    async def recognise(self, call: SkillCall, surface: str) -> Outcome:
        """Recognise what stands on a surface; `count` is how many items do, without what is in them."""
        await call.clock.sleep(RECOGNISING)
        return _outcome(self.world.recognise(call.action_id, surface), self.believed)

    @skill(
        outcomes={"looked": _CARRIER_AT, "gone": _ITEM_AT, "not_possible": _NOT_POSSIBLE},
        types=_CARRIER_AT,
        after_crash=_ONCE,
    )
    async def look_into(self, call: SkillCall, carrier: str, surface: str) -> Outcome:
        """Look into a carrier on a surface, giving up one unit of its room; `gone` names the carrier."""
        await call.clock.sleep(LOOKING)
        return _outcome(self.world.look_into(call.action_id, carrier, surface))


class Voice(Component):
    """The loudspeaker."""

    name = "voice"

    def __init__(self, world: World, name: str | None = None) -> None:
        super().__init__(name)
        self.world = world

    @skill(outcomes={"said": {"text": None}}, after_crash=_ONCE)
    async def say(self, call: SkillCall, text: str) -> Outcome:
        """Tell the operator something."""
        await call.clock.sleep(1.0 + len(text) / CHARACTERS_A_SECOND)
        return _outcome(self.world.say(call.action_id, text))


def _outcome(result: Result, believed: Callable[[str], Iterable[str]] = lambda _surface: ()) -> Outcome:
    attributes = {k: list(v) if isinstance(v, tuple) else v for k, v in result.attributes.items()}
    return Outcome(result.outcome, attributes, learned(result, believed))
