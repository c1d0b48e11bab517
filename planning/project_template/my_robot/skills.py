"""Skills of the robot. A real robot replaces the lines that use the world by calls of its drivers."""

from __future__ import annotations

from collections.abc import Callable
from typing import NewType

from dsc import Component, Outcome, Parameters, SkillCall, parameter, skill
from knowledge_base import Delta, fact

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

    def __init__(self, world: World, fault: Callable[[str, str], str | None]) -> None:
        super().__init__()
        self.world = world
        self.fault = fault

    @skill
    async def drive(self, call: SkillCall, start: Room, to: Room) -> Arrived | DoorClosed:
        await call.clock.sleep(10.0 / self.parameters.speed)  # run time: simulated, or real with --real-time
        if self.fault(call.action_id, "door_closed"):
            return DoorClosed()
        self.world.robot_in = to
        # Observations become knowledge, which conditions and plans read.
        return Arrived(observed=Delta(removed=(fact("robot-in", start),), added=(fact("robot-in", to),)))


class Gripper(Component):
    """An arm with a gripper."""

    name = "gripper"

    def __init__(self, world: World) -> None:
        super().__init__()
        self.world = world

    @skill
    async def pick_up(self, call: SkillCall, parcel: Parcel, room: Room) -> PickedUp:
        await call.clock.sleep(3.0)
        self.world.place[parcel] = "gripper"
        gone = (fact("lies-in", parcel, room), fact("empty"))
        return PickedUp(observed=Delta(removed=gone, added=(fact("carries", parcel),)))

    @skill
    async def put_down(self, call: SkillCall, parcel: Parcel, room: Room) -> PutDown:
        await call.clock.sleep(3.0)
        self.world.place[parcel] = room
        seen = (fact("lies-in", parcel, room), fact("empty"))
        return PutDown(observed=Delta(removed=(fact("carries", parcel),), added=seen))
