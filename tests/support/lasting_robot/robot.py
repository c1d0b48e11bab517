"""A delivery robot with a simulated house that survives a crash: a file next to the store keeps the executed actions."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any

from dsc import Component, Outcome, SkillCall, skill
from knowledge_base import Delta, KnowledgeBase, fact
from planning import Bundle, Fault, Left, Setup, Simulation

ROOMS = ("hall", "lab", "ward")
WANTED = {"blood": "lab", "pills": "ward"}


class House(Simulation):
    """Rooms, parcels and a cart; `WANTED` lists the deliveries."""

    lasts = True

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.done: dict[str, str] = {}
        self.lies: dict[str, str] = dict.fromkeys(WANTED, "hall")
        self.cart_in = "hall"
        if setup.resumes:
            self.done, self.lies, self.cart_in, fired = json.loads(self.file.read_text())
            self.fired = [Fault(*one) for one in fired]

    @property
    def file(self) -> Path:
        assert self.setup.store is not None
        return self.setup.store.with_name(self.setup.store.name + ".house")

    def begin(self) -> None:
        """Replace the file as a whole, so that a crash leaves the old or the new world."""
        new = self.file.with_suffix(".new")
        new.write_text(json.dumps([self.done, self.lies, self.cart_in, [(one.kind, one.action) for one in self.fired]]))
        new.replace(self.file)

    def components(self) -> Iterable[Component]:
        return [Cart(self)]

    def knowledge(self) -> Delta:
        lies = [fact("lies-in", *one) for one in self.lies.items()]
        wanted = [fact("wanted-in", *one) for one in WANTED.items()]
        return Delta(
            nodes={**dict.fromkeys(ROOMS, "room"), **dict.fromkeys(WANTED, "parcel")},
            added=(fact("cart-in", self.cart_in), fact("empty"), *lies, *wanted),
        )

    def left(self) -> list[Left]:
        return [Left(one, where=self.lies[one]) for one, room in WANTED.items() if self.lies[one] != room]

    def own_report(self, knowledge: KnowledgeBase, end: object) -> Mapping[str, Any]:
        return {"delivered": len(WANTED) - len(self.left())}

    def act(self, action: str, outcome: str, *faults: str) -> str:
        """Return the outcome of an action; an action that was executed before is not executed again."""
        return self.done.get(action) or self.fault(action, *faults) or outcome

    def executed(self, action: str, outcome: str) -> None:
        self.done[action] = outcome
        if self.setup.store is not None:
            self.begin()


Room = Annotated[str, "room"]
Parcel = Annotated[str, "parcel"]


class Arrived(Outcome): ...


class Loaded(Outcome): ...


class Jammed(Outcome): ...


class Unloaded(Outcome): ...


class Beeped(Outcome): ...


class Cart(Component):
    name = "cart"

    def __init__(self, house: House) -> None:
        super().__init__()
        self.house = house

    @skill(after_crash="same_id")
    async def drive(self, call: SkillCall, start: Room, to: Room) -> Arrived:
        await call.clock.sleep(10.0)
        self.house.cart_in = to
        self.house.executed(call.action_id, "arrived")
        return Arrived(observed=Delta(removed=(fact("cart-in", start),), added=(fact("cart-in", to),)))

    @skill(after_crash="same_id")
    async def load(self, call: SkillCall, parcel: Parcel, room: Room) -> Loaded | Jammed:
        await call.clock.sleep(2.0)
        outcome = self.house.act(call.action_id, "loaded", "jammed")
        if outcome == "loaded":
            self.house.lies[parcel] = "cart"
        self.house.executed(call.action_id, outcome)
        here, held = fact("lies-in", parcel, room), fact("loaded", parcel)
        if outcome == "jammed":
            return Jammed()
        return Loaded(observed=Delta(removed=(here, fact("empty")), added=(held,)))

    @skill(after_crash="same_id")
    async def unload(self, call: SkillCall, parcel: Parcel, room: Room) -> Unloaded | Jammed:
        await call.clock.sleep(2.0)
        outcome = self.house.act(call.action_id, "unloaded", "jammed")
        if outcome == "unloaded":
            self.house.lies[parcel] = room
        self.house.executed(call.action_id, outcome)
        here, held = fact("lies-in", parcel, room), fact("loaded", parcel)
        if outcome == "jammed":
            return Jammed()
        return Unloaded(observed=Delta(removed=(held,), added=(here, fact("empty"))))

    @skill(after_crash="same_id")
    async def beep(self, call: SkillCall, times: float, loud: bool = False) -> Beeped:
        await call.clock.sleep(float(times))
        return Beeped()


robot = Bundle.in_folder(
    Path(__file__).parent, name="porter", about="deliver parcels", main="deliver", simulation=House
)
