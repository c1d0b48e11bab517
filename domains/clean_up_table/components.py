"""The components of two robots for one world: base, arm, camera and voice (S0.7, S0.8).

A skill first waits for its duration, and then acts on the world in one call, so that a cancelled call changes nothing.
Its outcome contains the robot's observations, and never the true state of the world.

The second robot has a base on tracks, a suction arm, and a camera that repeats a recognition without a result. Its
skills have the names and outcomes that the plots expect, with other implementations; only `vent` is additional.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Literal

from domains.clean_up_table.items import PLACES, distance
from domains.clean_up_table.outcomes import (
    Arrived,
    Destination,
    Gone,
    GraspFailed,
    Item,
    Looked,
    NoIk,
    NoIkInside,
    NoPath,
    NothingFound,
    NotPossible,
    OutOfReach,
    PickedUp,
    Place,
    PutDown,
    Recognised,
    Said,
    Slipped,
    Stacked,
    StackFell,
    Surface,
    TakenOut,
    ThrownAway,
    Vented,
    outcome_of,
    untyped_outcome,
)  # fmt: skip
from dsc.calls import Ended, SkillCall
from dsc.components.component import Component
from dsc.components.parameters import Parameters, parameter
from dsc.skills import skill

if TYPE_CHECKING:
    from domains.clean_up_table.observations import Result
    from domains.clean_up_table.table_world import TableWorld


def seconds(default: float) -> float:
    """Declare a parameter for a duration in seconds, which the profile of the integrator sets, and not a plot."""
    return parameter(default, least=0.1, most=60.0, changed_by="profile")


class TablePart(Component):
    """A component of the robot that acts on the world.

    Args:
        world: the world, which keeps the results of actions.
        name: the name of the component in charts; by default the name of its class.
    """

    def __init__(self, world: TableWorld, name: str | None = None) -> None:
        super().__init__(name)
        self.world = world

    async def abandon(self, action_id: str, skill_name: str, arguments: Mapping[str, Any]) -> Ended | None:  # noqa: ARG002
        """Return the outcome of an executed action; `None` otherwise, since no action continues in the world."""
        self.world.catch_up()
        results = [self.world.done.get(one) for one in (again(action_id), action_id)]
        return next((Ended(untyped_outcome(result)) for result in results if result is not None), None)


class BaseParameters(Parameters):
    """Settings of the mobile base."""

    navigation: Literal["planned", "reactive"] = "planned"
    speed: float = parameter(0.5, least=0.05, most=1.5)  # metres per second
    starting: float = seconds(1.0)  # the time before the base moves


class Base(TablePart):
    """The mobile base on wheels."""

    name = "base"
    parameters: BaseParameters

    @skill(after_crash="same_id")
    async def drive(self, call: SkillCall, to: Place) -> Arrived | NoPath | Slipped | NotPossible:
        """Drive to a place; if the held item slips, the robot and the item are at the floor."""
        metres = distance(self.world.place_before(call.action_id), to) if to in PLACES else 0.0
        await call.clock.sleep(self.parameters.starting + metres / self.parameters.speed)
        return outcome_of(self.world.drive(call.action_id, to), Arrived, NoPath, Slipped, NotPossible)


class ArmParameters(Parameters):
    """Settings of the arm."""

    approach: Literal["above", "side"] = "above"
    grasping: float = seconds(4.0)
    putting: float = seconds(3.0)
    stacking: float = seconds(5.0)
    throwing: float = seconds(3.0)


class Arm(TablePart):
    """The arm with one hand."""

    name = "arm"
    parameters: ArmParameters

    @skill(after_crash="same_id")
    async def pick_up(
        self, call: SkillCall, item: Item, surface: Surface
    ) -> PickedUp | GraspFailed | NoIk | Gone | NotPossible:
        """Pick up an item, with all items in it, from a surface."""
        await call.clock.sleep(self.parameters.grasping)
        return outcome_of(
            self.world.pick_up(call.action_id, item, surface), PickedUp, GraspFailed, NoIk, Gone, NotPossible
        )

    @skill(after_crash="same_id")
    async def put_down(self, call: SkillCall, item: Item, surface: Surface) -> PutDown | NotPossible:
        """Put the held item on a surface."""
        await call.clock.sleep(self.parameters.putting)
        return outcome_of(self.world.put_down(call.action_id, item, surface), PutDown, NotPossible)

    @skill(after_crash="same_id")
    async def stack(
        self, call: SkillCall, item: Item, carrier: Item, surface: Surface
    ) -> Stacked | StackFell | Gone | NotPossible:
        """Put the held item into a carrier on a surface; the outcome `gone` contains the carrier."""
        await call.clock.sleep(self.parameters.stacking)
        return outcome_of(
            self.world.stack(call.action_id, item, carrier, surface), Stacked, StackFell, Gone, NotPossible
        )

    @skill(after_crash="same_id")
    async def take_out(
        self, call: SkillCall, item: Item, carrier: Item, surface: Surface
    ) -> TakenOut | OutOfReach | NoIkInside | Gone | NotPossible:
        """Take an item out of its carrier on a surface; the outcome `gone` contains the carrier."""
        await call.clock.sleep(self.parameters.grasping)
        return outcome_of(
            self.world.take_out(call.action_id, item, carrier, surface),
            TakenOut,
            OutOfReach,
            NoIkInside,
            Gone,
            NotPossible,
        )

    @skill(after_crash="same_id")
    async def throw_away(self, call: SkillCall, item: Item, destination: Destination) -> ThrownAway | NotPossible:
        """Throw the held item, with all items in it, into its destination."""
        await call.clock.sleep(self.parameters.throwing)
        return outcome_of(self.world.throw_away(call.action_id, item, destination), ThrownAway, NotPossible)


class CameraParameters(Parameters):
    """Settings of the camera."""

    recognising: float = seconds(2.0)
    looking: float = seconds(1.5)


class Camera(TablePart):
    """The camera, which reports only visible items; plots compare these with the expected items."""

    name = "camera"
    parameters: CameraParameters

    @skill(after_crash="same_id")
    async def recognise(self, call: SkillCall, surface: Surface) -> Recognised | NothingFound | NotPossible:
        """Recognise the items on a surface; `count` is the number of visible items that are in no carrier."""
        await call.clock.sleep(self.parameters.recognising)
        return outcome_of(self.world.recognise(call.action_id, surface), Recognised, NothingFound, NotPossible)

    @skill(after_crash="same_id")
    async def look_into(self, call: SkillCall, carrier: Item, surface: Surface) -> Looked | Gone | NotPossible:
        """Look into a carrier on a surface, which closes one unit of its free room; `gone` contains the carrier."""
        await call.clock.sleep(self.parameters.looking)
        return outcome_of(self.world.look_into(call.action_id, carrier, surface), Looked, Gone, NotPossible)


class VoiceParameters(Parameters):
    """Settings of the loudspeaker."""

    pace: float = parameter(15.0, least=1.0, most=100.0)  # characters per second


class Voice(TablePart):
    """The loudspeaker, which speaks texts to the operator."""

    name = "voice"
    parameters: VoiceParameters

    @skill(after_crash="same_id")
    async def say(self, call: SkillCall, text: str) -> Said:
        """Speak a text to the operator."""
        await call.clock.sleep(1.0 + len(text) / self.parameters.pace)
        return outcome_of(self.world.say(call.action_id, text), Said)


class TracksParameters(BaseParameters):
    """Settings of the base on tracks."""

    speed: float = parameter(0.2, least=0.05, most=0.4)
    turning: float = seconds(3.0)
    patience: float = seconds(8.0)


class Tracks(Base):
    """A base on tracks, which is slow, turns before it drives, and tries a blocked path a second time."""

    parameters: TracksParameters

    @skill(after_crash="same_id")
    async def drive(self, call: SkillCall, to: Place) -> Arrived | NoPath | Slipped | NotPossible:
        """Turn and drive to a place; if the path is blocked, wait and try a second time."""
        metres = distance(self.world.place_before(call.action_id), to) if to in PLACES else 0.0
        await call.clock.sleep(self.parameters.turning + metres / self.parameters.speed)
        result = self.world.drive(call.action_id, to)
        if result.outcome == "no_path":
            await call.clock.sleep(self.parameters.patience)
            result = self.world.drive(again(call.action_id), to)
        return outcome_of(result, Arrived, NoPath, Slipped, NotPossible)


class SuctionArmParameters(ArmParameters):
    """Settings of the suction arm."""

    vacuum: float = parameter(least=20.0, most=80.0, changed_by="profile")  # kPa below the air pressure
    lifts: float = parameter(1.0, least=0.1, most=2.0, changed_by="profile")  # kilograms
    relations = ("(<= ?lifts (* 0.025 ?vacuum))",)


class SuctionArm(Arm):
    """A suction arm, which pumps before a grasp, and tries a failed grasp a second time."""

    parameters: SuctionArmParameters

    @skill(after_crash="same_id")
    async def pick_up(
        self, call: SkillCall, item: Item, surface: Surface
    ) -> PickedUp | GraspFailed | NoIk | Gone | NotPossible:
        """Pick up an item, with all items in it, from a surface."""
        return outcome_of(
            await self._held(call, lambda action_id: self.world.pick_up(action_id, item, surface)),
            PickedUp,
            GraspFailed,
            NoIk,
            Gone,
            NotPossible,
        )

    @skill(after_crash="same_id")
    async def take_out(
        self, call: SkillCall, item: Item, carrier: Item, surface: Surface
    ) -> TakenOut | OutOfReach | NoIkInside | Gone | NotPossible:
        """Take an item out of its carrier on a surface; the outcome `gone` contains the carrier."""
        return outcome_of(
            await self._held(call, lambda action_id: self.world.take_out(action_id, item, carrier, surface)),
            TakenOut,
            OutOfReach,
            NoIkInside,
            Gone,
            NotPossible,
        )

    @skill(after_crash="repeat")
    async def vent(self, call: SkillCall) -> Vented:
        """Let air into the suction cup; the arm then holds no item."""
        await call.clock.sleep(0.5)
        return Vented()

    async def _held(self, call: SkillCall, grasp: Callable[[str], Result]) -> Result:
        pumping = self.parameters.vacuum / 20.0
        await call.clock.sleep(pumping + self.parameters.grasping)
        result = grasp(call.action_id)
        if result.outcome == "grasp_failed":
            await call.clock.sleep(pumping)
            result = grasp(again(call.action_id))
        return result


class PatientCamera(Camera):
    """A camera that looks a second time before it reports an empty surface."""

    @skill(after_crash="same_id")
    async def recognise(self, call: SkillCall, surface: Surface) -> Recognised | NothingFound | NotPossible:
        """Recognise the items on a surface; `count` is the number of visible items that are in no carrier."""
        await call.clock.sleep(self.parameters.recognising)
        result = self.world.recognise(call.action_id, surface)
        if result.outcome == "nothing_found":
            await call.clock.sleep(self.parameters.recognising)
            result = self.world.recognise(again(call.action_id), surface)
        return outcome_of(result, Recognised, NothingFound, NotPossible)


def again(action_id: str) -> str:
    """Return the id of the second attempt in one call, so that faults are drawn separately."""
    return f"{action_id}/again"
