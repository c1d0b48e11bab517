"""What the robot has been told of each item, worked out beside its knowledge.

It is worked out from what the world did, never from what the robot made of it. So the robot's knowledge can be judged
exactly, also that of items which others have moved since.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from domains.clean_up_table.items import DESTINATION_OF, HAND
from domains.clean_up_table.places import DESTINATIONS, SURFACES
from domains.clean_up_table.results import Result
from domains.clean_up_table.table_world import TableWorld
from domains.clean_up_table.world_faults import ITEM_MOVED
from dsc.sequencer.reactor import CHART
from dsc.testing.invariants import KeptRun
from dsc.trace import Record
from knowledge_base.facts import Fact, fact

_PLACED = {"put_down": "surface", "stacked": "carrier", "slipped": "surface"}
"""Which attribute of a result says where the item is now."""


class Told:
    """The robot's items as it was told of them, message by message of a run.

    Args:
        run: what was taken, in order.
        world: what became of each action, by its id.

    Attributes:
        where: a surface, a carrier, the hand or a destination by item; `None` if it was not where it was last.
        missing: items that were not found where they had been.
        stale: items that others have moved since the robot was told of them.
    """

    def __init__(self, run: KeptRun, world: TableWorld) -> None:
        self.where: dict[str, str | None] = {}
        self.missing: set[str] = set()
        self.stale: set[str] = set()
        self._world = world
        self._moves = {one.action_id: one.items for one in world.fired if one.kind == ITEM_MOVED}
        heard = set()
        for step in run.steps:
            compared = any(map(_compares, step.records))
            heard.add(self._take(step.message, compared=compared))
            for record in step.records:
                if record.type == "knowledge" and record.data["author"] == CHART:
                    self._conclude(record.data.get("added", ()), compared=compared)
        for action_id, items in self._moves.items():
            if action_id not in heard:
                self.stale.update(items)

    def expected(self) -> Iterator[Fact]:
        """What the robot has to know of the items, in the domain's predicates."""
        for item, where in self.where.items():
            if item in self.missing:
                yield fact("missing", item)
            if where == HAND:
                yield fact("holding", item)
            elif where in SURFACES:
                yield fact("lies-at", item, where)
            elif where in DESTINATIONS:
                yield fact("disposed", item)
            elif where is not None:
                yield fact("inside", item, where)

    def untrue(self) -> Iterator[str]:
        """What it was told, and is not so, though nobody has moved the item since."""
        for item, where in self.where.items():
            is_at = self._world.items[item].where
            if item not in self.missing | self.stale and where != is_at:
                yield f"it was told that {item} is at {where}, and it is at {is_at}"

    def _take(self, message: Mapping[str, Any], *, compared: bool) -> str | None:
        """The id of the action whose answer it is, if it is one that the world gave."""
        match message:
            case {"late": _, "message": inner}:
                return self._take(inner, compared=compared)
            case {"change": change}:
                for predicate, *args in change.get("added", ()):
                    if predicate == "lies-at":
                        self._is_at(*args)
            case {"action": action_id, "outcome": outcome}:
                result = self._world.done.get(action_id)
                if result is not None and result.outcome == outcome:
                    self.stale.update(self._moves.get(action_id, ()))
                    self._acted(result, compared=compared)
                    return str(action_id)
        return None

    def _acted(self, result: Result, *, compared: bool) -> None:
        said = {name: str(value) for name, value in result.attributes.items()}
        match result.outcome:
            case "recognised":
                self._looked(result, said["surface"], compared=compared)
            case "picked_up" | "taken_out":
                self._is_at(said["item"], HAND)
            case "put_down" | "stacked" | "slipped":
                self._is_at(said["item"], said[_PLACED[result.outcome]])
            case "thrown_away":
                for one in result.sightings:
                    self._is_at(one.item, DESTINATION_OF[one.kind])
            case "stack_fell":
                for one in result.sightings:
                    self._is_at(one.item, said["surface"])
            case "gone":
                self._is_lost(said["item"])

    def _looked(self, result: Result, surface: str, *, compared: bool) -> None:
        """Sightings are known however late the answer comes; an item is missed only while a plot compares."""
        seen = {one.item: one.where for one in result.sightings}
        for item in [item for item in self.where if item not in seen and self._outermost(item) == surface]:
            if compared:
                self._is_lost(item)
        for item, where in seen.items():
            self._is_at(item, where)

    def _conclude(self, added: Iterable[list[str]], *, compared: bool) -> None:
        """What the plots themselves make of it: they may give up an item that was looked for in vain.

        What they make of a look is worked out here as well, but for items in what was missing before.
        """
        for item in (one[1] for one in added if one[0] == "missing"):
            if not compared or self.where.get(item) in self.missing:
                self._is_lost(item)

    def _is_at(self, item: str, where: str) -> None:
        self.where[item] = where
        self.missing.discard(item)
        self.stale.discard(item)

    def _is_lost(self, item: str) -> None:
        """What is in another item is still in it, wherever that may be."""
        self.missing.add(item)
        if self.where.get(item) in SURFACES:
            self.where[item] = None

    def _outermost(self, item: str) -> str | None:
        where = self.where.get(item)
        return self._outermost(where) if where in self.where else where


def _compares(record: Record) -> bool:
    """Whether a plot takes the answer of a look."""
    steps = record.data["microsteps"] if record.type == "step" else ()
    return any(one["event"] == "recognised" and one["taken"] for one in steps)
