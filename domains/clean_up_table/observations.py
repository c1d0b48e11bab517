"""Observations of the robot: the change of its knowledge by a verb's result.

A success reports the effect of the planning action of the same name, in the domain's predicates. A failure reports the
robot's observations of it. Facts are retracted whether they were known or not.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

from domains.clean_up_table.items import DESTINATION_OF, ROOMS
from domains.clean_up_table.places import PLACES, SURFACES, TYPES
from knowledge_base.facts import Delta, Fact, fact

if TYPE_CHECKING:
    from collections.abc import Iterable

    from domains.clean_up_table.results import Result, Sighting
    from domains.clean_up_table.table_world import TableWorld


class _Notes:
    """A change under construction; an addition wins over a removal."""

    def __init__(self) -> None:
        self.nodes: dict[str, str] = {}
        self.removed: list[Fact] = []
        self.added: list[Fact] = []
        self.values: dict[Fact, float] = {}

    def holds(self, predicate: str, *args: str) -> None:
        self.added.append(fact(predicate, *args))

    def holds_not(self, predicate: str, *args: str) -> None:
        self.removed.append(fact(predicate, *args))

    def holds_only(self, predicate: str, *args: str, of: Iterable[str]) -> None:
        """Add the fact with this last argument, and retract it for all others in `of`."""
        for other in of:
            if other != args[-1]:
                self.holds_not(predicate, *args[:-1], other)
        self.holds(predicate, *args)

    def known(self, item: str) -> None:
        """Retract that the item is missing, since the robot sees or handles it."""
        self.holds_not("missing", item)

    def counts(self, function: str, argument: str, number: int) -> None:
        self.values[fact(function, argument)] = float(number)

    def delta(self) -> Delta:
        return Delta(self.nodes, tuple(self.removed), tuple(self.added), self.values)


def initial_knowledge(world: TableWorld) -> Delta:
    """Return the robot's knowledge before the first look: places, its own position, and the order of rooms."""
    notes = _Notes()
    notes.nodes.update(TYPES)
    notes.holds("robot-at", world.robot_at)
    notes.holds("hand-free")
    for place in PLACES:
        notes.holds("passable", place)
    for less, more in itertools.pairwise(ROOMS):
        notes.holds("one-less", more, less)
    return notes.delta()


def learned(result: Result) -> Delta:
    """Return the change of knowledge by the result of any verb."""
    notes = _Notes()
    if result.outcome in _LEARNED:
        _LEARNED[result.outcome](notes, result)
    return notes.delta()


def _arrived(notes: _Notes, result: Result) -> None:
    (to,) = _names(result, "to")
    notes.holds_only("robot-at", to, of=PLACES)
    notes.counts("detours", to, 0)


def _no_path(notes: _Notes, result: Result) -> None:
    (to,) = _names(result, "to")
    notes.counts("detours", to, result.failures)


def _slipped(notes: _Notes, result: Result) -> None:
    item, surface = _names(result, "item", "surface")
    notes.holds_only("robot-at", surface, of=PLACES)
    _let_go(notes, item)
    notes.holds("lies-at", item, surface)


def _picked_up(notes: _Notes, result: Result) -> None:
    item, surface = _names(result, "item", "surface")
    notes.holds_not("lies-at", item, surface)
    _grasped(notes, item)


def _put_down(notes: _Notes, result: Result) -> None:
    item, surface = _names(result, "item", "surface")
    _let_go(notes, item)
    notes.holds("lies-at", item, surface)


def _stacked(notes: _Notes, result: Result) -> None:
    item, carrier = _names(result, "item", "carrier")
    _let_go(notes, item)
    notes.holds("inside", item, carrier)
    notes.holds("tidy", item)
    _rooms(notes, result)


def _taken_out(notes: _Notes, result: Result) -> None:
    (item,) = _names(result, "item")
    _came_apart(notes, result)
    notes.holds_not("tidy", item)
    _grasped(notes, item)
    _rooms(notes, result)


def _looked(notes: _Notes, result: Result) -> None:
    _rooms(notes, result)


def _thrown_away(notes: _Notes, result: Result) -> None:
    (item,) = _names(result, "item")
    _let_go(notes, item)
    _came_apart(notes, result)
    for sighting in result.sightings:
        notes.known(sighting.item)
        for surface in SURFACES:
            notes.holds_not("lies-at", sighting.item, surface)
        notes.holds("tidy", sighting.item)
        notes.holds("disposed", sighting.item)


def _stack_fell(notes: _Notes, result: Result) -> None:
    item, surface = _names(result, "item", "surface")
    _let_go(notes, item)
    _came_apart(notes, result)
    for sighting in result.sightings:
        notes.known(sighting.item)
        notes.holds("lies-at", sighting.item, surface)
        notes.holds_not("tidy", sighting.item)
    _rooms(notes, result)


def _failed_grasp(notes: _Notes, result: Result) -> None:
    (item,) = _names(result, "item")
    notes.counts("failures", item, result.failures)


def _gone(notes: _Notes, result: Result) -> None:
    item, surface = _names(result, "item", "surface")
    notes.holds_not("lies-at", item, surface)
    notes.holds("missing", item)


def _recognised(notes: _Notes, result: Result) -> None:
    for sighting in result.sightings:
        _sighted(notes, sighting)
    for item, carrier in result.fits:
        notes.holds("fits", item, carrier)
    _rooms(notes, result)


def _sighted(notes: _Notes, sighting: Sighting) -> None:
    item = sighting.item
    notes.nodes[item] = sighting.kind
    notes.holds("seen", item)
    notes.holds("in-view", item)
    notes.known(item)
    if sighting.where in SURFACES:
        notes.holds_only("lies-at", item, sighting.where, of=SURFACES)
    else:
        for surface in SURFACES:
            notes.holds_not("lies-at", item, surface)
        # The plots decide whether it is tidy there: in a carrier that cannot be grasped it is not.
        notes.holds("inside", item, sighting.where)
    if sighting.new:
        notes.holds("goes-to", item, DESTINATION_OF[sighting.kind])
        # Once only: rules retract it after too many failures, and a second look must not restore it.
        notes.holds("graspable", item)


def _grasped(notes: _Notes, item: str) -> None:
    notes.known(item)
    notes.holds_not("hand-free")
    notes.holds("holding", item)
    notes.counts("failures", item, 0)


def _let_go(notes: _Notes, item: str) -> None:
    notes.known(item)
    notes.holds_not("holding", item)
    notes.holds("hand-free")


def _came_apart(notes: _Notes, result: Result) -> None:
    for item, carrier in result.apart:
        notes.holds_not("inside", item, carrier)


def _rooms(notes: _Notes, result: Result) -> None:
    for sighting in result.sightings:
        notes.holds_only("free-room", sighting.item, sighting.room, of=ROOMS)


def _names(result: Result, *attributes: str) -> tuple[str, ...]:
    return tuple(str(result.attributes[attribute]) for attribute in attributes)


_LEARNED = {
    "recognised": _recognised,
    "arrived": _arrived,
    "no_path": _no_path,
    "slipped": _slipped,
    "picked_up": _picked_up,
    "put_down": _put_down,
    "stacked": _stacked,
    "taken_out": _taken_out,
    "looked": _looked,
    "thrown_away": _thrown_away,
    "stack_fell": _stack_fell,
    "grasp_failed": _failed_grasp,
    "no_ik": _failed_grasp,
    "gone": _gone,
}
