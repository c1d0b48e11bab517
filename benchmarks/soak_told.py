"""The reported place of each item, derived independently of the robot's knowledge.

The world's results are the source, never the robot's conclusions. The robot's knowledge can therefore be compared
exactly, also for items that other people have moved since.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from domains.clean_up_table.items import DESTINATION_OF, DESTINATIONS, HAND, SURFACES
from domains.clean_up_table.observations import Result
from domains.clean_up_table.table_world import TableWorld
from domains.clean_up_table.world_faults import ITEM_MOVED
from dsc.sequencer.reactor import CHART
from dsc.testing.invariants import KeptRun
from dsc.trace import Record
from knowledge_base.facts import Fact, fact

_PLACED = {"put_down": "surface", "stacked": "carrier", "slipped": "surface"}
"""The attribute of a result with the item's new place."""


class Told:
    """The reported places of items, derived message by message from a run.

    Args:
        run: the kept run, with its messages in order.
        world: the world, with the result of each action by its id.

    Attributes:
        where: a surface, a carrier, the hand or a destination by item; `None` if it was missing at its last place.
        missing: items that were not found at their last place.
        stale: items that other people have moved since the last report.
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
        """Yield the facts about the items that the robot must know, in the domain's predicates."""
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
        """Yield reports that are false although no other person has moved the item since."""
        for item, where in self.where.items():
            is_at = self._world.items[item].where
            if item not in self.missing | self.stale and where != is_at:
                yield f"it was told that {item} is at {where}, and it is at {is_at}"

    def _take(self, message: Mapping[str, Any], *, compared: bool) -> str | None:
        """Return the id of the action that the message answers, if the world executed it."""
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
        """Take the sightings of a look; items are missing only if a plot compares the look with its knowledge."""
        seen = {one.item: one.where for one in result.sightings}
        for item in [item for item in self.where if item not in seen and self._outermost(item) == surface]:
            if compared:
                self._is_lost(item)
        for item, where in seen.items():
            self._is_at(item, where)

    def _conclude(self, added: Iterable[list[str]], *, compared: bool) -> None:
        """Take the plots' conclusions: an item may be missing after a vain search.

        Conclusions from a look are derived here too, except for items in a carrier that was missing before.
        """
        for item in (one[1] for one in added if one[0] == "missing"):
            if not compared or self.where.get(item) in self.missing:
                self._is_lost(item)

    def _is_at(self, item: str, where: str) -> None:
        self.where[item] = where
        self.missing.discard(item)
        self.stale.discard(item)

    def _is_lost(self, item: str) -> None:
        """Mark the item as missing; items in it stay in it."""
        self.missing.add(item)
        if self.where.get(item) in SURFACES:
            self.where[item] = None

    def _outermost(self, item: str) -> str | None:
        where = self.where.get(item)
        return self._outermost(where) if where in self.where else where


def _compares(record: Record) -> bool:
    """Return whether a plot compares the answer of a look."""
    steps = record.data["microsteps"] if record.type == "step" else ()
    return any(one["event"] == "recognised" and one["taken"] for one in steps)
