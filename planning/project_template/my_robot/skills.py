"""Skills of the robot. A real robot replaces the lines that use the house by calls of its drivers."""

from __future__ import annotations

from typing import TYPE_CHECKING, NewType

from dsc import Component, Outcome, Parameters, SkillCall, parameter, skill
from knowledge_base import Delta, fact

if TYPE_CHECKING:
    from .world import World


Room = NewType("Room", str)  # objects of the type `room` of the domain
Parcel = NewType("Parcel", str)


class Arrived(Outcome): ...  # the event `arrived` of plots


class DoorClosed(Outcome): ...


class PickedUp(Outcome): ...


class PutDown(Outcome): ...


class BaseParameters(Parameters):
    """Values that profiles and plots may set, with their permitted range."""

    speed: float = parameter(1.0, least=0.1, most=2.0)


class Base(Component):
    """Wheels and navigation."""

    name = "base"
    parameters: BaseParameters

    def __init__(self, house: World) -> None:
        super().__init__()
        self.house = house

    @skill
    async def drive(self, call: SkillCall, start: Room, to: Room) -> Arrived | DoorClosed:
        await call.clock.sleep(10.0 / self.parameters.speed)  # run time: simulated, or real with --real-time
        if self.house.fault(call.action_id, "door_closed"):
            return DoorClosed()
        self.house.robot_in = to
        # Observations become knowledge, which conditions and plans read.
        return Arrived(observed=Delta(removed=(fact("robot-in", start),), added=(fact("robot-in", to),)))


class Gripper(Component):
    """An arm with a gripper."""

    name = "gripper"

    def __init__(self, house: World) -> None:
        super().__init__()
        self.house = house

    @skill
    async def pick_up(self, call: SkillCall, parcel: Parcel, room: Room) -> PickedUp:
        await call.clock.sleep(3.0)
        self.house.place[parcel] = "gripper"
        gone = (fact("lies-in", parcel, room), fact("empty"))
        return PickedUp(observed=Delta(removed=gone, added=(fact("carries", parcel),)))

    @skill
    async def put_down(self, call: SkillCall, parcel: Parcel, room: Room) -> PutDown:
        await call.clock.sleep(3.0)
        self.house.place[parcel] = room
        seen = (fact("lies-in", parcel, room), fact("empty"))
        return PutDown(observed=Delta(removed=(fact("carries", parcel),), added=seen))
