"""The world of all contenders: objects with five arcs each, all of them in one hall."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

Arc = tuple[str, str, str]
"""Kind, from, to."""

KINDS = ("on", "in", "near", "made", "opens")
HALL, DOOR = "hall", "door"
PARALLEL_ENGINES = 1000


@dataclass(frozen=True, slots=True)
class Arcs:
    """A world of `size` objects, the same each time.

    Each object is on one of `size / 10` places, in the hall, near two others, and has a maker; one door opens the hall.
    """

    size: int

    @property
    def places(self) -> int:
        """Number of places."""
        return self.size // 10

    def batches(self) -> Iterator[tuple[list[str], list[Arc]]]:
        """Yield batches of objects and arcs; the objects of an arc come before or with it."""
        fixed = [HALL, DOOR, *(f"p{n}" for n in range(self.places)), *(f"m{n}" for n in range(50))]
        yield fixed, [("opens", DOOR, HALL)]
        for first in range(0, self.size, PARALLEL_ENGINES):
            numbers = range(first, min(first + PARALLEL_ENGINES, self.size))
            yield [f"i{n}" for n in numbers], [arc for n in numbers for arc in self.about(n)]

    def about(self, n: int) -> list[Arc]:
        """Return the arcs of one object."""
        item = f"i{n}"
        return [
            ("on", item, self.place(n)),
            ("in", item, HALL),
            ("near", item, f"i{max(0, n - 1)}"),
            ("near", item, f"i{n // 2}"),
            ("made", item, f"m{n % 50}"),
        ]

    def place(self, n: int) -> str:
        """Return the place of an object, or the place that it is moved to."""
        return f"p{n % self.places}"
