"""The truth about a run, for its validation: the remaining items, and the permanent faults that explain them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from domains.clean_up_table.world_faults import GRASP_FAILED, NO_INVERSE_KINEMATICS, WorldFaults

if TYPE_CHECKING:
    from domains.clean_up_table.items import Inventory, Item

_REASONS = {GRASP_FAILED: "every grasp of it fails", NO_INVERSE_KINEMATICS: "the arm cannot reach it"}


@dataclass(frozen=True, slots=True)
class Left:
    """An item that was on the table and is not in its destination.

    Attributes:
        item: its name.
        where: the surface it lies on, `hand`, or `in CARRIER`.
        reason: the permanent fault that keeps it from its destination; `None` without one.
    """

    item: str
    where: str
    reason: str | None


def blame(item: Item, items: Inventory, faults: WorldFaults) -> str | None:
    """Return the permanent fault that keeps an item from its destination, in words, or `None`."""
    if item.disposed:
        return None
    if item.name in faults.ungraspable:
        return _REASONS[faults.ungraspable[item.name]]
    if item.name in faults.unrecognisable:
        return "it cannot be recognised"
    if item.destination in faults.unreachable:
        return f"no path leads to the {item.destination}"
    if items.hidden(item) and item.behind and blame(items[item.behind], items, faults):
        return f"it is hidden behind {item.behind}"
    return _stuck(item, items, faults)


def _stuck(item: Item, items: Inventory, faults: WorldFaults) -> str | None:
    """Return why a carrier cannot release an item: the arm unloads carriers on a surface only."""
    carrier = items.get(item.where)
    outer = items.get(carrier.where) if carrier else None
    if carrier and outer and blame(carrier, items, faults) and blame(outer, items, faults):
        return f"it is in {carrier.name}, which is stuck in {outer.name}"
    return None


def left(items: Inventory, faults: WorldFaults) -> list[Left]:
    """Return the items that were ever on the table and are not in their destination, in order of addition."""
    return [
        Left(item.name, _where(item, items), blame(item, items, faults))
        for item in items
        if item.on_table and not item.disposed
    ]


def _where(item: Item, items: Inventory) -> str:
    return f"in {item.where}" if items.get(item.where) else item.where
