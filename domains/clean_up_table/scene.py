"""The world drawn from above: the content of a `scene` record in the trace."""

from __future__ import annotations

from typing import Any

from domains.clean_up_table.items import HAND, Inventory, Item
from domains.clean_up_table.places import PLACES, POSITIONS, SIZES

_COLUMNS = 10
_LOWER_EDGE = 0.45  # metres from a place's centre to the robot in front of it


def scene(items: Inventory, robot_at: str) -> list[dict[str, Any]]:
    """Return every place, the robot and every item: `id, shape, x, y, label` in metres.

    Places also have `width` and `depth`. An item inside another or in the hand has `in`, the id of its holder. An item
    keeps its spot on a surface while others come and go.
    """
    places = [_place(name) for name in PLACES]
    x, y = POSITIONS[robot_at]
    robot = {"id": "robot", "shape": "robot", "x": x, "y": y - _LOWER_EDGE, "label": "robot"}
    return [*places, robot, *(_item(item, slot, items, robot_at) for slot, item in enumerate(items))]


def _place(name: str) -> dict[str, Any]:
    (x, y), (width, depth) = POSITIONS[name], SIZES[name]
    return {"id": name, "shape": name, "x": x, "y": y, "label": name, "width": width, "depth": depth}


def _item(item: Item, slot: int, items: Inventory, robot_at: str) -> dict[str, Any]:
    top = items.outermost(item)
    top_slot = slot if top is item else list(items).index(top)
    x, y = _spot(top.where, top_slot, len(items), robot_at)
    drawn = {"id": item.name, "shape": item.kind, "x": x, "y": y, "label": item.name}
    if item.where not in PLACES:
        drawn["in"] = "robot" if item.where == HAND else item.where
    return drawn


def _spot(where: str, slot: int, count: int, robot_at: str) -> tuple[float, float]:
    """Return the position of the item with that number, on a grid for all items."""
    if where == HAND:
        x, y = POSITIONS[robot_at]
        return x, y - _LOWER_EDGE
    (x, y), (width, depth) = POSITIONS[where], SIZES[where]
    rows = -(-count // _COLUMNS)
    column, row = slot % _COLUMNS, slot // _COLUMNS
    across = (column + 0.5) / _COLUMNS - 0.5
    along = (row + 0.5) / rows - 0.5
    return round(x + across * width, 3), round(y + along * depth, 3)
