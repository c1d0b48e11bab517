"""Skills of the robot. A real robot replaces the lines that use the house by calls of its drivers."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from dsc import Component, Outcome, Parameter, SkillCall, skill
from knowledge_base import Delta, fact

if TYPE_CHECKING:
    from .simulation import House


class Base(Component):
    """Wheels and navigation."""

    name = "base"
    declares: ClassVar = {"speed": Parameter("number", default=1.0, least=0.1, most=2.0)}

    def __init__(self, house: House) -> None:
        super().__init__()
        self.house = house

    @skill(outcomes={"arrived": {}, "door_closed": {}}, types={"start": "room", "to": "room"})
    async def drive(self, call: SkillCall, start: str, to: str) -> Outcome:
        await call.clock.sleep(10.0 / self.parameters["speed"])  # run time: simulated, or real with --real-time
        if self.house.fault(call.action_id, "door_closed"):
            return Outcome("door_closed")
        self.house.robot_in = to
        # Observations become knowledge, which conditions and plans read.
        return Outcome("arrived", observed=Delta(removed=(fact("robot-in", start),), added=(fact("robot-in", to),)))


class Gripper(Component):
    """An arm with a gripper."""

    name = "gripper"

    def __init__(self, house: House) -> None:
        super().__init__()
        self.house = house

    @skill(outcomes={"picked_up": {}}, types={"parcel": "parcel", "room": "room"})
    async def pick_up(self, call: SkillCall, parcel: str, room: str) -> Outcome:
        await call.clock.sleep(3.0)
        self.house.place[parcel] = "gripper"
        gone = (fact("lies-in", parcel, room), fact("empty"))
        return Outcome("picked_up", observed=Delta(removed=gone, added=(fact("carries", parcel),)))

    @skill(outcomes={"put_down": {}}, types={"parcel": "parcel", "room": "room"})
    async def put_down(self, call: SkillCall, parcel: str, room: str) -> Outcome:
        await call.clock.sleep(3.0)
        self.house.place[parcel] = room
        seen = (fact("lies-in", parcel, room), fact("empty"))
        return Outcome("put_down", observed=Delta(removed=(fact("carries", parcel),), added=seen))
