"""A delivery robot in a simulated house, as a user would write it: skills, a world with faults, and a goal."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

from dsc import Component, Outcome, Parameters, SkillCall, parameter, skill
from knowledge_base import Delta, fact
from planning import Bundle, Left, Setup, Simulation

HERE = Path(__file__).parent


class House(Simulation):
    """Parcels lie in the hall; each belongs into a room."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.at = {"parcel1": "hall", "parcel2": "hall"}
        self.goes_to = {"parcel1": "office", "parcel2": "kitchen"}
        self.robot_at = "hall"

    def components(self):
        return [Wheels(self), Gripper(self)]

    def knowledge(self) -> Delta:
        return Delta(
            nodes={**dict.fromkeys(self.at, "parcel"), **dict.fromkeys(("hall", "office", "kitchen"), "room")},
            added=(
                fact("robot-in", self.robot_at),
                *(fact("in", parcel, room) for parcel, room in self.at.items()),
                *(fact("goes-to", parcel, room) for parcel, room in self.goes_to.items()),
            ),
        )

    def left(self):
        return [Left(one, at, "it was dropped") for one, at in self.at.items() if at != self.goes_to[one]]

    def own_report(self, knowledge, end):
        return {"delivered": [one for one, at in self.at.items() if at == self.goes_to[one]]}


Room = Annotated[str, "room"]
Parcel = Annotated[str, "parcel"]


class Arrived(Outcome): ...


class Blocked(Outcome): ...


class Taken(Outcome): ...


class Put(Outcome): ...


class WheelsParameters(Parameters):
    speed: float = parameter(1.0, least=0.1, most=5.0)


class Wheels(Component):
    name = "wheels"
    parameters: WheelsParameters

    def __init__(self, house: House) -> None:
        super().__init__()
        self.house = house

    @skill
    async def drive(self, call: SkillCall, to: Room) -> Arrived | Blocked:
        await call.clock.sleep(10.0 / self.parameters.speed)
        if os.environ.get("CRASH") == to:
            os._exit(9)
        if self.house.fault(call.action_id, "blocked"):
            return Blocked()
        before, self.house.robot_at = self.house.robot_at, to
        return Arrived(observed=Delta(removed=(fact("robot-in", before),), added=(fact("robot-in", to),)))


class Gripper(Component):
    name = "gripper"

    def __init__(self, house: House) -> None:
        super().__init__()
        self.house = house

    @skill
    async def grasp(self, call: SkillCall, parcel: Parcel) -> Taken:
        room, self.house.at[parcel] = self.house.robot_at, "robot"
        return Taken(observed=Delta(removed=(fact("in", parcel, room),), added=(fact("holding", parcel),)))

    @skill
    async def put(self, call: SkillCall, parcel: Parcel) -> Put:
        room = self.house.at[parcel] = self.house.robot_at
        return Put(observed=Delta(removed=(fact("holding", parcel),), added=(fact("in", parcel, room),)))


robot = Bundle.in_folder(
    HERE,
    name="delivery",
    simulation=House,
    main="deliver_all",
    goal="(forall (?p - parcel) (exists (?r - room) (and (goes-to ?p ?r) (in ?p ?r))))",
)
