"""The simulated room: its state, interference by other people, its true state for reports, and its drawing.

This module contains only data and rules, and uses neither a clock nor asyncio. The robot's verbs are in `table_world`.
"""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Any, Self

from pydantic import TypeAdapter

from domains.clean_up_table.items import (
    CAN,
    CUP,
    HAND,
    OPERATOR,
    PLACES,
    SPOTS,
    SURFACES,
    Inventory,
    Item,
    Spot,
    new_item,
)
from domains.clean_up_table.observations import Result
from domains.clean_up_table.world_faults import ITEM_ADDED, ITEM_MOVED, Draw, FiredFault, Left, WorldFaults, blame
from dsc.chance import choose
from knowledge_base.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

_COLUMNS = 10
_LOWER_EDGE = 0.45  # metres from a place's centre to the robot in front of it
_ITEMS, _FAULTS, _DONE = TypeAdapter(list[Item]), TypeAdapter(WorldFaults), TypeAdapter(dict[str, Result])
_MOVES = {"table": "shelf", "shelf": "table"}


class Room:
    """The state of the world: items, the robot's place, faults so far, and executed actions.

    Attributes:
        items: every item and its place; `items.held` is the item in the hand.
        faults: draws and records faults.
        robot_at: the place of the robot.
        trips: the number of throws.
        said: the sentences that the robot spoke, in order.
        done: the first result of each executed action, by action id.
        departure: the action id of the last drive, and the place where it started.
    """

    def __init__(
        self, items: Iterable[Item] = (), *, seed: int = 0, faults: float = 0.0, robot_at: str = OPERATOR
    ) -> None:
        if robot_at not in PLACES:
            raise UnknownNameError(f"there is no place '{robot_at}'", found=robot_at, valid=PLACES)
        # The room changes its items, so two rooms constructed from one list need separate copies.
        self.items = Inventory(copy.copy(item) for item in items)
        self.faults = WorldFaults(seed, faults)
        self.robot_at = robot_at
        self.trips = 0
        self.said: list[str] = []
        self.done: dict[str, Result] = {}
        self.departure = "", robot_at

    def catch_up(self) -> None:
        """Read the actions of other programs, if programs share the world."""

    def executed(self, action_id: str, result: Result) -> None:
        """Store the result of an executed action."""
        self.done[action_id] = result

    def place_before(self, action_id: str) -> str:
        """Return the start of a drive; a repeated drive has its first start, so that its duration stays equal."""
        drive, place = self.departure
        return place if drive == action_id else self.robot_at

    # Interference by other people

    def add_item(
        self,
        kind: str,
        name: str | None = None,
        surface: str = "table",
        *,
        size: str = "small",
        behind: str | None = None,
    ) -> str:
        """Add a new item on a surface, as another person would, and return its name.

        Args:
            kind: `cup`, `can` or `crisp-can`.
            name: a unique name; by default the next free name of the kind.
            surface: the surface on which the item lies.
            size: `small` or `large`; only for a crisp can.
            behind: the name of the item that hides the new item.

        Raises:
            InputError: the kind, size, surface or front item is unknown, or another item has the name.
        """
        name = name or self.items.free_name(kind)
        self.items.add(new_item(kind, name, surface=surface, size=size, behind=behind))
        return name

    def move_item(self, name: str, surface: str) -> None:
        """Move an item, with all items in it, to another surface, as another person would.

        Raises:
            InputError: the item or the surface is unknown, or the item does not lie directly on a surface.
        """
        item = self.items.get(name)
        if item is None:
            known = [known.name for known in self.items]
            raise UnknownNameError(f"there is no item '{name}'", found=name, valid=known)
        if surface not in SURFACES:
            raise UnknownNameError(f"there is no surface '{surface}'", found=surface, valid=SURFACES)
        if item.where not in SURFACES:
            raise InputError(f"only an item on a surface can be moved; '{name}' is at '{item.where}'")
        self.items.move(item, surface)

    def _interferences(self, keep: str | None) -> dict[str, bool]:
        """Return the possible interferences during a call, none of them permanent; the item `keep` is not moved."""
        kinds = []
        if self._movable(keep) and self.faults.left_for(ITEM_MOVED):
            kinds.append(ITEM_MOVED)
        if self.faults.left_for(ITEM_ADDED):
            kinds.append(ITEM_ADDED)
        return dict.fromkeys(kinds, False)

    def _movable(self, keep: str | None) -> list[Item]:
        return [item for item in self.items if item.seen and item.where in _MOVES and item.name != keep]

    def _interfere(self, draw: Draw, action_id: str, keep: str | None) -> None:
        seed = self.faults.seed
        if draw.kind == ITEM_MOVED:
            item = choose(seed, action_id, "item", self._movable(keep))
            self.items.move(item, _MOVES[item.where])
            self.faults.fire(draw, action_id, item.name)
        else:
            kind = choose(seed, action_id, "item", (CUP, CAN))
            self.faults.fire(draw, action_id, self.add_item(kind))

    # The true state

    @property
    def fired(self) -> list[FiredFault]:
        """The faults that happened, in order."""
        return self.faults.fired

    def touched(self) -> set[str]:
        """Return the items that a permanent fault keeps from their destination.

        Such an item can never be grasped, can never be recognised, or has no path to its destination. Items hidden
        behind such an item count too, and items in a carrier that is stuck in another carrier. Items that were thrown
        away, e.g. in their carrier, do not count.
        """
        return {item.name for item in self.items if blame(item, self.items, self.faults)}

    def left(self) -> list[Left]:
        """Return the items that were ever on the table and are not in their destination, in the order of addition."""
        return [
            Left(item.name, self._whereabouts(item), blame(item, self.items, self.faults))
            for item in self.items
            if item.on_table and not item.disposed
        ]

    def _whereabouts(self, item: Item) -> str:
        return f"in {item.where}" if self.items.get(item.where) else item.where

    @property
    def goal_reached(self) -> bool:
        """Whether every item that was ever on the table is in its destination, even if the robot never saw the item."""
        return not self.left()

    # The drawing

    def scene(self) -> list[dict[str, Any]]:
        """Return every place, the robot and every item as `id`, `shape`, `x`, `y` and `label`, with lengths in metres.

        Places also have `width` and `depth`. An item in a carrier or in the hand has `in`, the id of the carrier or the
        robot. An item keeps its position on a surface when other items are added or removed.
        """
        places = [
            {"id": name, "shape": name, "x": at.x, "y": at.y, "label": name, "width": at.width, "depth": at.depth}
            for name, at in SPOTS.items()
        ]
        x, y = self._hand()
        robot = {"id": "robot", "shape": "robot", "x": x, "y": y, "label": "robot"}
        slots = {item.name: slot for slot, item in enumerate(self.items)}
        return [*places, robot, *(self._drawn(item, slots) for item in self.items)]

    def _hand(self) -> tuple[float, float]:
        at = SPOTS[self.robot_at]
        return at.x, at.y - _LOWER_EDGE

    def _drawn(self, item: Item, slots: Mapping[str, int]) -> dict[str, Any]:
        top = self.items.outermost(item)
        x, y = self._hand() if top.where == HAND else _position(SPOTS[top.where], slots[top.name], len(slots))
        drawn = {"id": item.name, "shape": item.kind, "x": x, "y": y, "label": item.name}
        if item.where not in PLACES:
            drawn["in"] = "robot" if item.where == HAND else item.where
        return drawn

    # Conversion to and from data

    def state(self) -> dict[str, Any]:
        """Return the whole state as JSON data."""
        return {
            "robot_at": self.robot_at,
            "items": _ITEMS.dump_python(list(self.items), mode="json"),
            "trips": self.trips,
            "said": list(self.said),
            "faults": _FAULTS.dump_python(self.faults, mode="json"),
            "departure": list(self.departure),
            "done": _DONE.dump_python(self.done, mode="json"),
        }

    @classmethod
    def from_state(cls, state: Mapping[str, Any]) -> Self:
        """Return the room with a state that `state` returned.

        Raises:
            InputError: `state` is not the state of a world.
        """
        room = cls()
        room.become(state)
        return room

    def become(self, state: Mapping[str, Any]) -> None:
        """Replace the state of this room by a state that `state` returned.

        Raises:
            InputError: `state` is not the state of a world.
        """
        try:
            Room.__init__(self, _ITEMS.validate_python(state["items"]), robot_at=state["robot_at"])
            self.trips = state["trips"]
            self.said = list(state["said"])
            self.faults = _FAULTS.validate_python(state["faults"])
            drive, place = state["departure"]
            self.departure = drive, place
            self.done = _DONE.validate_python(state["done"])
        except (AttributeError, KeyError, TypeError, ValueError) as wrong:
            raise InputError(f"this is not the state of a clean-up-table world: {wrong!r}") from wrong


def _position(at: Spot, slot: int, count: int) -> tuple[float, float]:
    """Return the position of the item with number `slot` in a place, on a grid for `count` items."""
    row, column = divmod(slot, _COLUMNS)
    rows = -(-count // _COLUMNS)
    across, along = (column + 0.5) / _COLUMNS - 0.5, (row + 0.5) / rows - 0.5
    return round(at.x + across * at.width, 3), round(at.y + along * at.depth, 3)
