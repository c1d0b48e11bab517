"""A robot that takes what its camera sees: lists, records, choices, optional values and conversions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Annotated, Literal, NewType

from pydantic import BaseModel

from dsc import Component, Outcome, SkillCall, conversion, skill
from knowledge_base import Delta, fact
from planning import Bundle

Item = NewType("Item", str)
Place = NewType("Place", str)
Speed = Annotated[float, "number from 0 to 1 in m/s"]


class Kind(Enum):
    CUP = "cup"
    CAN = "can"


@dataclass
class Detection:
    item: Item
    score: float
    kind: Kind
    pose: list[float] | None = None


class Area(BaseModel):
    x: float
    size: float = 1.0


class Seen(Outcome):
    items: list[Detection]


class Taken(Outcome):
    weight: float | None = None


class Put(Outcome): ...


class Camera(Component):
    name = "camera"

    @skill
    async def look(self, call: SkillCall, area: Area) -> Seen:
        await call.clock.sleep(area.size)
        cup = Detection(item=Item("cup1"), score=0.9, kind=Kind.CUP, pose=[area.x, 1.0])
        can = Detection(item=Item("can1"), score=0.3, kind=Kind.CAN)
        known = Delta(nodes={"cup1": "item", "can1": "item"})
        return Seen(items=[cup, can], observed=known)


class Arm(Component):
    name = "arm"

    @skill
    async def take(self, call: SkillCall, item: Item, hand: Literal["left", "right"] | None = None) -> Taken:
        await call.clock.sleep(2.0 if hand is None else 1.0)
        return Taken(weight=0.2)

    @skill
    async def put(self, call: SkillCall, item: Item, to: Place, speed: Speed) -> Put:
        await call.clock.sleep(1.0 / speed)
        return Put(observed=Delta(added=(fact("in", item, to),)))


@conversion
def certain(items: list[Detection], least: float) -> list[Detection]:
    return [one for one in items if one.score >= least]


@conversion
def names(items: list[Detection]) -> list[Item]:
    return [one.item for one in items]


def devices() -> Iterable[Component]:
    return [Camera(), Arm()]


robot = Bundle.in_folder(
    Path(__file__).parent, name="seeing", components=devices, main="tidy", conversions=(certain, names)
)
