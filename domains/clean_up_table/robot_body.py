"""The robot's body in the room: reasons that prevent a verb, and the results of driving, grasping and seeing."""

from __future__ import annotations

from dataclasses import replace

from domains.clean_up_table.items import DESTINATIONS, HAND, Item
from domains.clean_up_table.observations import Attribute, Result, Sighting, gone, not_possible
from domains.clean_up_table.room import Room
from domains.clean_up_table.world_faults import (
    GRASP_FAILED,
    ITEM_ADDED,
    ITEM_MOVED,
    ITEM_SLIPPED,
    NO_INVERSE_KINEMATICS,
    NO_PATH,
    STACK_FELL,
    Draw,
)
from dsc.chance import choose

_OUTCOMES = {GRASP_FAILED: "grasp_failed", NO_INVERSE_KINEMATICS: "no_ik"}


class RobotBody(Room):
    """A room with a robot that is at one place, has one hand, and has one camera."""

    # Methods that return the result of a verb that an obstacle prevents, or `None` without an obstacle.

    def _not_at(self, place: str, places: tuple[str, ...]) -> Result | None:
        if place not in places:
            return not_possible(f"'{place}' is none of {', '.join(places)}")
        if self.robot_at != place:
            return not_possible(f"the robot is at {self.robot_at}, not at {place}")
        return None

    def _hand_full(self) -> Result | None:
        held = self.items.held
        return not_possible(f"the hand holds {held.name}") if held else None

    def _not_held(self, item: str) -> Result | None:
        held = self.items.held
        return None if held and held.name == item else not_possible(f"the hand does not hold '{item}'")

    def _absent(self, name: str, surface: str) -> Result | None:
        """Return `gone` if an item is not on the surface or not recognisable, since the arm needs the camera."""
        item = self.items.get(name)
        if item is None or name in self.faults.unrecognisable:
            return gone(name, surface)
        if item.where == surface:
            return None
        where = self.items.outermost(item).where
        if where in {surface, HAND}:
            return not_possible(f"'{name}' is in {item.where}")
        return gone(name, surface)

    def _not_inside(self, item: str, carrier: str, surface: str) -> Result | None:
        absent = self._absent(carrier, surface)
        if absent:
            return absent
        inside = self.items.get(item)
        return None if inside and inside.where == carrier else not_possible(f"'{item}' is not in {carrier}")

    def _no_room(self, item: str, carrier: str) -> Result | None:
        inner, outer = self.items[item], self.items[carrier]
        if not inner.fits(outer):
            return not_possible(f"a {inner.kind} does not go into '{carrier}'")
        return None if self.items.free_room(outer) else not_possible(f"'{carrier}' is full")

    # Driving

    def _drive_faults(self, to: str) -> dict[str, bool]:
        possible: dict[str, bool] = {}
        if to == self.robot_at:
            return possible
        held = self.items.held
        if self.faults.may_fail("drive", to):
            possible[NO_PATH] = to in DESTINATIONS
        if held and self.faults.may_fail("carry", held.name):
            possible[ITEM_SLIPPED] = False
        return possible

    def _arrive(self, to: str) -> Result:
        held = self.items.held
        if held and to != self.robot_at:
            self.faults.passed("carry", held.name)
        self.faults.passed("drive", to)
        self.robot_at = to
        return Result("arrived", {"to": to})

    def _no_path(self, to: str) -> Result:
        return Result("no_path", {"to": to}, failures=self.faults.failed("drive", to))

    def _block(self, draw: Draw, action_id: str, to: str) -> Result:
        kept: list[str] = []
        if draw.permanent:
            self.faults.unreachable.append(to)
            kept = [item.name for item in self.items if item.destination == to and not item.disposed]
        self.faults.fire(draw, action_id, *kept)
        return self._no_path(to)

    def _slip(self, draw: Draw, action_id: str, held: Item, to: str) -> Result:
        self.faults.fire(draw, action_id, *(item.name for item in self.items.stack(held)))
        failures = self.faults.failed("carry", held.name)
        self.items.move(held, "floor")
        self.robot_at = "floor"
        return Result("slipped", {"item": held.name, "surface": "floor", "to": to}, failures=failures)

    # Handling items

    def _meddle(self, action_id: str, possible: dict[str, bool], keep: str | None = None) -> Draw | None:
        """Draw the fault of a call; apply an interference immediately, and return any other fault."""
        draw = self.faults.draw(action_id, {**possible, **self._interferences(keep)})
        if draw is None or draw.kind not in {ITEM_MOVED, ITEM_ADDED}:
            return draw
        self._interfere(draw, action_id, keep)
        return None

    def _grasp_faults(self, item: str, obstacle: Result | None) -> dict[str, bool]:
        if obstacle or item in self.faults.ungraspable or not self.faults.may_fail("grasp", item):
            return {}
        return {GRASP_FAILED: True, NO_INVERSE_KINEMATICS: True}

    def _grasp(self, draw: Draw | None, action_id: str, item: str, grasped: Result) -> Result:
        if draw:
            self.faults.fire(draw, action_id, item)
            if draw.permanent:
                self.faults.ungraspable[item] = draw.kind
        kind = draw.kind if draw else self.faults.ungraspable.get(item)
        if kind is not None:
            failures = self.faults.failed("grasp", item)
            return Result(_OUTCOMES[kind], grasped.attributes, failures=failures)
        self.faults.passed("grasp", item)
        self.items.move(self.items[item], HAND)
        return grasped

    def _stack_faults(self, carrier: str) -> dict[str, bool]:
        return {STACK_FELL: False} if self.faults.may_fail("stack", carrier) else {}

    def _stack(self, item: str, carrier: str, surface: str) -> Result:
        self.faults.passed("stack", carrier)
        outer = self.items[carrier]
        self.items.move(self.items[item], carrier)
        outer.closed = min(outer.closed, self.items.free_room(outer))
        attributes = {"item": item, "carrier": carrier, "surface": surface}
        return self._with_room(Result("stacked", attributes), carrier)

    def _fall(self, draw: Draw, action_id: str, item: str, carrier: str, surface: str) -> Result:
        fallen = [*self.items.stack(self.items[carrier]), *self.items.stack(self.items[item])]
        apart = tuple((each.name, each.where) for each in fallen if self.items.get(each.where))
        for each in fallen:
            self.items.move(each, surface)
            each.closed = 0
        names = tuple(each.name for each in fallen)
        self.faults.fire(draw, action_id, *names)
        attributes: dict[str, Attribute] = {"item": item, "carrier": carrier, "surface": surface}
        attributes["items"] = names
        sightings = tuple(self._sighting(each) for each in fallen)
        failures = self.faults.failed("stack", carrier)
        return Result("stack_fell", attributes, sightings, apart, failures=failures)

    def _with_room(self, result: Result, carrier: str) -> Result:
        return replace(result, sightings=(self._sighting(self.items[carrier]),))

    # Seeing

    def _visible(self, surface: str) -> list[Item]:
        return [
            item
            for item in self.items.lying(surface)
            if item.name not in self.faults.unrecognisable and not self.items.hidden(item)
        ]

    def _sighting(self, item: Item) -> Sighting:
        return Sighting(item.name, item.kind, item.where, self.items.room(item), new=not item.seen)

    def _overlook(self, draw: Draw, action_id: str, surface: str, bare: list[Item]) -> Result:
        items = []
        if draw.permanent:
            items = [choose(self.faults.seed, action_id, "item", bare).name]
            self.faults.unrecognisable += items
        self.faults.fire(draw, action_id, *items)
        return Result("nothing_found", {"surface": surface}, failures=self.faults.failed("look", surface))

    def _see(self, surface: str, visible: list[Item]) -> Result:
        everything = [each for item in visible for each in self.items.stack(item)]
        sightings = tuple(self._sighting(each) for each in everything)
        fits = self._new_fits([each for each in everything if not each.seen])
        for each in everything:
            each.seen = True
        return Result("recognised", {"surface": surface, "count": len(visible)}, sightings, fits=fits)

    def _new_fits(self, new: list[Item]) -> tuple[tuple[str, str], ...]:
        """Return the fitting pairs among new items, and between new items and known items that are not disposed of."""
        known = [item for item in self.items if item.seen and not item.disposed]
        pairs = [(a, b) for a in new for b in (*known, *new)] + [(a, b) for a in known for b in new]
        return tuple((a.name, b.name) for a, b in pairs if a.fits(b))
