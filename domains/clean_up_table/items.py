"""Places and items of the room: cups, cans and crisp cans, with their carriers and destinations."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from knowledge_base.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

OPERATOR = "operator"


@dataclass(frozen=True, slots=True)
class Spot:
    """A place as seen from above, in metres; x points to the right, y away from the viewer.

    Attributes:
        type: the type of the place in the planning domain.
        x, y: the centre of the place.
        width, depth: the extent of the place in x and y.
    """

    type: str
    x: float
    y: float
    width: float
    depth: float


SPOTS = {
    "table": Spot("surface", 0.0, 0.0, 2.0, 1.0),
    "shelf": Spot("surface", -3.0, 0.0, 2.0, 0.6),
    "floor": Spot("surface", 0.0, -2.0, 2.0, 1.0),
    "sink": Spot("destination", 3.0, 1.0, 0.8, 0.6),
    "bin": Spot("destination", 3.0, -2.0, 0.6, 0.6),
    OPERATOR: Spot("place", -3.0, -3.0, 0.6, 0.6),
}
PLACES = tuple(SPOTS)
SURFACES, DESTINATIONS = (
    tuple(name for name, spot in SPOTS.items() if spot.type == wanted) for wanted in ("surface", "destination")
)


def distance(start: str, end: str) -> float:
    """Return the distance between two places in metres, measured in a straight line."""
    here, there = SPOTS[start], SPOTS[end]
    return math.dist((here.x, here.y), (there.x, there.y))


CUP, CAN, CRISP_CAN = "cup", "can", "crisp-can"
KINDS = (CUP, CAN, CRISP_CAN)
"""The kinds of items; the planning domain has a type with the name of each kind."""

DESTINATION_OF = {CUP: "sink", CAN: "bin", CRISP_CAN: "bin"}
SIZES = {"small": 1, "large": 2}
"""The number of cans that fit into a crisp can of each size."""

ROOMS = ("none", "one", "two")
"""The names of 0, 1 and 2 units of free room in the planning domain."""

HAND = "hand"
RESERVED = frozenset({*PLACES, *ROOMS, HAND})
_NAME = re.compile(r"[a-z][a-z0-9_-]{0,59}")


def check_name(name: str) -> None:
    """Raise `InputError` if `name` is not a valid name of an item in PDDL, or is the name of a place or a room size."""
    if not _NAME.fullmatch(name):
        usual = re.sub(r"[^a-z0-9_-]+", "_", name.lower())
        raise InputError(
            f"'{name}' cannot name an item (lower-case letters, digits, '_', '-'; a letter first; up to 60)",
            found=name,
            valid=[usual] if _NAME.fullmatch(usual) else [],
        )
    if name in RESERVED:
        raise InputError(f"'{name}' cannot name an item: it is taken", found=name)


def check_behind(name: str, fronts: Mapping[str, str | None]) -> None:
    """Raise `InputError` if the item is behind a missing item, or if items hide each other in a cycle.

    Args:
        name: the name of the item.
        fronts: for the name of each item, the name of the item in front of it, or `None`.
    """
    passed = {name}
    front = fronts[name]
    while front is not None:
        if front not in fronts:
            raise UnknownNameError(f"'{name}' is behind '{front}', which does not exist", found=front, valid=fronts)
        if front in passed:
            raise InputError(f"'{name}' is behind items that hide each other", found=front)
        passed.add(front)
        front = fronts[front]


@dataclass(slots=True)
class Item:
    """An item and its place.

    Attributes:
        name: the name, which is unique and not the name of a place.
        kind: one of `KINDS`.
        capacity: the number of items that fit directly into the item.
        where: a surface, the name of the carrier, `HAND`, or the destination into which the item was thrown.
        behind: the item that hides this item while both are on one surface.
        on_table: whether the item was ever on the table, so that it counts for the goal.
        seen: whether the camera has ever reported the item.
        closed: the units of room that `check-room` has closed; only a fall of the stack opens them again.
    """

    name: str
    kind: str
    capacity: int
    where: str
    behind: str | None = None
    on_table: bool = False
    seen: bool = False
    closed: int = 0

    @property
    def destination(self) -> str:
        """The destination of all items of this kind."""
        return DESTINATION_OF[self.kind]

    @property
    def disposed(self) -> bool:
        """Whether the item is in its destination."""
        return self.where == self.destination

    def fits(self, carrier: Item) -> bool:
        """Return whether items of this kind fit into items of the carrier's kind, regardless of free room."""
        return self is not carrier and (self.kind, carrier.kind) in {(CUP, CUP), (CAN, CRISP_CAN)}


def new_item(kind: str, name: str, *, surface: str = "table", size: str = "small", behind: str | None = None) -> Item:
    """Return a new item on a surface; `size` applies only to a crisp can.

    Raises:
        UnknownNameError: the kind, size or surface is unknown.
        InputError: the name is not a valid name of an item.
    """
    check_name(name)
    for what, found, valid in (("kind", kind, KINDS), ("size", size, SIZES), ("surface", surface, SURFACES)):
        if found not in valid:
            raise UnknownNameError(f"there is no {what} '{found}'", found=found, valid=valid)
    capacity = {CUP: 1, CAN: 0, CRISP_CAN: SIZES[size]}[kind]
    return Item(name, kind, capacity, surface, behind, on_table=surface == "table")


class Inventory:
    """All items of the room, in the order in which they were added.

    Raises:
        InputError: two items have equal names, an item is behind a missing item, or items hide each other in a cycle.
    """

    def __init__(self, items: Iterable[Item] = ()) -> None:
        self._items: dict[str, Item] = {}
        for item in items:
            self._put(item)
        self._check_behind()

    def __iter__(self) -> Iterator[Item]:
        return iter(self._items.values())

    def __len__(self) -> int:
        return len(self._items)

    def __getitem__(self, name: str) -> Item:
        return self._items[name]

    def get(self, name: str) -> Item | None:
        """Return the item with this name, or `None`."""
        return self._items.get(name)

    def add(self, item: Item) -> None:
        """Add a new item at the place that it contains.

        Raises:
            InputError: another item has this name, or the item is behind a missing item.
        """
        check_behind(item.name, {**{known.name: known.behind for known in self}, item.name: item.behind})
        self._put(item)

    def _put(self, item: Item) -> None:
        if item.name in self._items:
            raise InputError(f"there is already an item '{item.name}'", found=item.name)
        self._items[item.name] = item

    def _check_behind(self) -> None:
        fronts = {item.name: item.behind for item in self}
        for name in fronts:
            check_behind(name, fronts)

    def free_name(self, kind: str) -> str:
        """Return the first unused name of the kind: cup1, cup2, … or can1, … or crisp_can1, …."""
        stem, number = kind.replace("-", "_"), 1
        while f"{stem}{number}" in self._items:
            number += 1
        return f"{stem}{number}"

    @property
    def held(self) -> Item | None:
        """The item that the hand itself holds; `None` if the hand is free."""
        return next((item for item in self if item.where == HAND), None)

    def lying(self, surface: str) -> list[Item]:
        """Return the items that lie directly on a surface, including hidden items."""
        return [item for item in self if item.where == surface]

    def contents(self, carrier: Item) -> list[Item]:
        """Return the items that are directly in a carrier."""
        return [item for item in self if item.where == carrier.name]

    def stack(self, item: Item) -> list[Item]:
        """Return the item and all items in it, each carrier before its contents."""
        return [item, *(deep for inner in self.contents(item) for deep in self.stack(inner))]

    def outermost(self, item: Item) -> Item:
        """Return the outermost carrier of an item; the item itself if no carrier contains it."""
        carrier = self._items.get(item.where)
        return item if carrier is None else self.outermost(carrier)

    def free_room(self, carrier: Item) -> int:
        """Return the number of items that still fit directly into a carrier."""
        return carrier.capacity - len(self.contents(carrier))

    def room(self, carrier: Item) -> str:
        """Return the free room of a carrier without closed units, as the planning domain names it."""
        return ROOMS[max(0, self.free_room(carrier) - carrier.closed)]

    def hidden(self, item: Item) -> bool:
        """Return whether the item in front of this item is on the same surface."""
        front = self._items.get(item.behind) if item.behind else None
        return front is not None and item.where in SURFACES and front.where == item.where

    def move(self, item: Item, where: str) -> None:
        """Move an item, with all items in it, to another place."""
        item.where = where
        if self.outermost(item).where == "table":
            for moved in self.stack(item):
                moved.on_table = True
