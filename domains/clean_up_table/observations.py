"""Results of the world's verbs, and the changes of the robot's knowledge that follow from them.

A success reports the effect of the planning action with the same name, in the predicates of the domain. A failed
verb reports what the robot observed. A fact may be retracted even if it was unknown.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from pydantic import TypeAdapter

from domains.clean_up_table.items import DESTINATION_OF, PLACES, ROOMS, SPOTS, SURFACES
from knowledge_base.facts import Delta, Fact, fact

Attribute = str | int | tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Sighting:
    """An item in the view of the robot.

    Attributes:
        item: the name of the item.
        kind: the kind of the item.
        where: the surface on which the item lies, or the carrier that directly contains it.
        room: the free room of the item, as in the planning domain (`none`, `one`, `two`).
        new: whether the robot has never seen the item before.
    """

    item: str
    kind: str
    where: str
    room: str
    new: bool = False


@dataclass(frozen=True, slots=True)
class Result:
    """The result of one verb of the world.

    Attributes:
        outcome: the name of the outcome event.
        attributes: the attributes of the outcome event.
        sightings: the items whose place or room the robot observed.
        apart: pairs (item, carrier) of items that are no longer in the carrier.
        fits: pairs (item, carrier) of items that fit into the carrier, recognised for the first time.
        failures: the number of consecutive failures, including this one.
    """

    outcome: str
    attributes: Mapping[str, Attribute]
    sightings: tuple[Sighting, ...] = ()
    apart: tuple[tuple[str, str], ...] = ()
    fits: tuple[tuple[str, str], ...] = ()
    failures: int = 0


RESULT = TypeAdapter(Result)
"""Converts results to and from JSON data."""


def not_possible(reason: str) -> Result:
    """Return the result of a verb that is impossible; the world stays unchanged."""
    return Result("not_possible", {"reason": reason})


def gone(item: str, surface: str) -> Result:
    """Return the result of a verb whose item is not at the expected place."""
    return Result("gone", {"item": item, "surface": surface})


class _Notes:
    """A change of knowledge under construction; an added fact has priority over a removed one."""

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
        """Add the fact with this last argument, and retract the facts with the other values in `of`."""
        for other in of:
            if other != args[-1]:
                self.holds_not(predicate, *args[:-1], other)
        self.holds(predicate, *args)

    def known(self, item: str) -> None:
        """Retract that the item is missing, because the robot sees or handles the item."""
        self.holds_not("missing", item)

    def counts(self, function: str, argument: str, number: int) -> None:
        self.values[fact(function, argument)] = float(number)

    def delta(self) -> Delta:
        return Delta(self.nodes, tuple(self.removed), tuple(self.added), self.values)


def initial_knowledge(robot_at: str) -> Delta:
    """Return the robot's knowledge before its first observation: places, its place, and the order of room sizes."""
    notes = _Notes()
    notes.nodes.update({name: spot.type for name, spot in SPOTS.items()})
    notes.holds("robot-at", robot_at)
    notes.holds("hand-free")
    for place in PLACES:
        notes.holds("passable", place)
    for less, more in itertools.pairwise(ROOMS):
        notes.holds("one-less", more, less)
    return notes.delta()


def learned(result: Result) -> Delta:
    """Return the change of knowledge that follows from the result of any verb."""
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
        # The plots decide whether the item is tidy, because an item in a carrier that cannot be grasped is not tidy.
        notes.holds("inside", item, sighting.where)
    if sighting.new:
        notes.holds("goes-to", item, DESTINATION_OF[sighting.kind])
        # Only at the first sighting: rules retract the fact after too many failures, and a later sighting must keep
        # that.
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
    "looked": _rooms,
    "thrown_away": _thrown_away,
    "stack_fell": _stack_fell,
    "grasp_failed": _failed_grasp,
    "no_ik": _failed_grasp,
    "gone": _gone,
}
