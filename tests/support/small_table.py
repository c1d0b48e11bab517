"""A small table with something of every kind, for the tests of the world."""

from __future__ import annotations

from domains.clean_up_table.items import new_item
from domains.clean_up_table.table_world import TableWorld

NAMES = ("cup1", "cup2", "cup3", "can1", "can2", "crisp_can1", "crisp_can2")


def make_world(faults: float = 0.0, seed: int = 0) -> TableWorld:
    items = [
        new_item("cup", "cup1"),
        new_item("cup", "cup2"),
        new_item("cup", "cup3"),
        new_item("can", "can1"),
        new_item("can", "can2", behind="crisp_can2"),
        new_item("crisp-can", "crisp_can1", size="small"),
        new_item("crisp-can", "crisp_can2", size="large"),
    ]
    return TableWorld(items, faults=faults, seed=seed)
