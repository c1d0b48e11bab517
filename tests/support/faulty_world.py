"""Worlds in which something goes wrong, for the tests of the faults."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from domains.clean_up_table.items import new_item
from domains.clean_up_table.table_world import TableWorld

if TYPE_CHECKING:
    from collections.abc import Callable


def make_world(seed: int, faults: float = 1.0) -> TableWorld:
    names = ["cup1", "cup2", "cup3", "can1", "can2"]
    items = [new_item(name[:3], name) for name in names]
    return TableWorld([*items, new_item("crisp-can", "crisp_can1")], seed=seed, faults=faults)


def at_table(seed: int, faults: float = 1.0) -> TableWorld:
    world = make_world(seed, faults)
    world.robot_at = "table"
    return world


def with_fault(kind: str, *, permanent: bool, play: Callable[[TableWorld], object]) -> TableWorld:
    """The world of the first seed in which `play` makes such a fault fire."""
    for seed in range(3000):
        world = at_table(seed)
        play(world)
        if any(fault.kind == kind and fault.permanent == permanent for fault in world.fired):
            return world
    pytest.fail(f"{kind} never fired")


def put_in_hand(world: TableWorld, name: str) -> None:
    world.items.move(world.items[name], "hand")
