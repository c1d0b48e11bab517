"""Outcomes of the robots' skills, with the types of objects that skills and outcomes name."""

from __future__ import annotations

from typing import Any, NewType, TypeVar, overload

from domains.clean_up_table.observations import Result, learned
from dsc.outcomes import Outcome

Item = NewType("Item", str)
Surface = NewType("Surface", str)
Destination = NewType("Destination", str)
Place = NewType("Place", str)


class NotPossible(Outcome):
    """The world refuses the action, e.g. because the robot is elsewhere."""

    reason: str


class Arrived(Outcome):
    """The robot is at the place."""

    to: Place


class NoPath(Outcome):
    """The path to the place is blocked."""

    to: Place


class Slipped(Outcome):
    """The held item slipped on the way, and lies on the floor."""

    item: Item
    surface: Surface
    to: Place


class AtSurface(Outcome):
    """Base class of outcomes about an item at a surface."""

    item: Item
    surface: Surface


class PickedUp(AtSurface):
    """The hand holds the item."""


class PutDown(AtSurface):
    """The item is on the surface."""


class GraspFailed(AtSurface):
    """The grasp failed; the item has not moved."""


class NoIk(AtSurface):
    """No position of the arm reaches the item."""


class Gone(AtSurface):
    """The item is no longer there."""


class InCarrier(AtSurface):
    """Base class of outcomes about an item and its carrier at a surface."""

    carrier: Item


class TakenOut(InCarrier):
    """The hand holds the item that was in the carrier."""


class OutOfReach(InCarrier, event="grasp_failed"):
    """The grasp of an item in a carrier failed."""


class NoIkInside(InCarrier, event="no_ik"):
    """No position of the arm reaches the item in its carrier."""


class Stacked(InCarrier):
    """The item is in the carrier."""


class StackFell(InCarrier):
    """The stack fell; `items` are the items that were in it."""

    items: list[str]


class ThrownAway(Outcome):
    """The item is in its destination."""

    item: Item
    destination: Destination


class Recognised(Outcome):
    """The camera recognised items; `count` is the number of visible items that are in no carrier."""

    surface: Surface
    count: int


class NothingFound(Outcome):
    """The camera recognised no item."""

    surface: Surface


class Looked(Outcome):
    """The camera saw the content of a carrier."""

    carrier: Item
    surface: Surface


class Said(Outcome):
    """The text was spoken."""

    text: str


class Vented(Outcome):
    """The suction cup contains air."""


A = TypeVar("A", bound=Outcome)
B = TypeVar("B", bound=Outcome)
C = TypeVar("C", bound=Outcome)
D = TypeVar("D", bound=Outcome)
E = TypeVar("E", bound=Outcome)


@overload
def outcome_of(result: Result, a: type[A], /) -> A: ...
@overload
def outcome_of(result: Result, a: type[A], b: type[B], /) -> A | B: ...
@overload
def outcome_of(result: Result, a: type[A], b: type[B], c: type[C], /) -> A | B | C: ...
@overload
def outcome_of(result: Result, a: type[A], b: type[B], c: type[C], d: type[D], /) -> A | B | C | D: ...
@overload
def outcome_of(result: Result, a: type[A], b: type[B], c: type[C], d: type[D], e: type[E], /) -> A | B | C | D | E: ...
def outcome_of(result: Result, *kinds: type[Outcome]) -> Outcome:
    """Return the outcome of a skill that corresponds to a result of the world.

    Args:
        result: the result.
        kinds: the outcomes of the skill.
    """
    kind = next(one for one in kinds if one.event == result.outcome)
    return kind(**_attributes(result), observed=learned(result))


def untyped_outcome(result: Result) -> Outcome:
    """Return the outcome that corresponds to a result of the world, for any skill."""
    return Outcome(result.outcome, _attributes(result), learned(result))


def _attributes(result: Result) -> dict[str, Any]:
    return {name: list(value) if isinstance(value, tuple) else value for name, value in result.attributes.items()}
