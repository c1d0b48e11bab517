"""Results of the world's verbs with the robot's observations: plain values, convertible to JSON."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

Attribute = str | int | tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Sighting:
    """An item in the robot's view.

    Attributes:
        item: its name.
        kind: its kind.
        where: the surface it lies on or the carrier it is directly in.
        room: its free room in the planning domain's terms (`none`, `one`, `two`).
        new: whether it was never seen before.
    """

    item: str
    kind: str
    where: str
    room: str
    new: bool = False


@dataclass(frozen=True, slots=True)
class Result:
    """The result of one verb.

    Attributes:
        outcome: the outcome event's name.
        attributes: the event's attributes.
        sightings: items with an observed place or room.
        apart: (item, carrier) pairs that no longer hold.
        fits: (item, carrier) pairs that were recognised as fitting for the first time.
        failures: number of consecutive failures, this one included.
    """

    outcome: str
    attributes: Mapping[str, Attribute]
    sightings: tuple[Sighting, ...] = ()
    apart: tuple[tuple[str, str], ...] = ()
    fits: tuple[tuple[str, str], ...] = ()
    failures: int = field(default=0)

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON data."""
        return {
            "outcome": self.outcome,
            "attributes": {k: list(v) if isinstance(v, tuple) else v for k, v in self.attributes.items()},
            "sightings": [asdict(sighting) for sighting in self.sightings],
            "apart": [list(pair) for pair in self.apart],
            "fits": [list(pair) for pair in self.fits],
            "failures": self.failures,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Result:
        """Return the result of a form; the inverse of `to_json`."""
        return cls(
            data["outcome"],
            {k: tuple(v) if isinstance(v, list) else v for k, v in data["attributes"].items()},
            tuple(Sighting(**sighting) for sighting in data["sightings"]),
            tuple((item, carrier) for item, carrier in data["apart"]),
            tuple((item, carrier) for item, carrier in data["fits"]),
            data["failures"],
        )


def not_possible(reason: str) -> Result:
    """Return the result of a verb that could not be tried; the world is unchanged."""
    return Result("not_possible", {"reason": reason})


def gone(item: str, surface: str) -> Result:
    """Return the result of a verb whose item is not at the expected place."""
    return Result("gone", {"item": item, "surface": surface})
