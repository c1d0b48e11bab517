"""The world that conditions are evaluated on, and the same world with bounds.

The evaluator finds all candidates through its world. A world that counts its results therefore bounds every query, and
a world without bounds has no overhead.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol, TypeVar

from knowledge_base.errors import OutOfBoundsError, shortened
from knowledge_base.facts import Content, Fact, Value
from knowledge_base.language.checking.vocabulary import Vocabulary
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.language.syntax.text import to_text


class World(Protocol):
    """A state of the world: the store, pending changes on top of it, or a state of a planner.

    `holds` and `match` cover only predicates with asserted facts; the language derives type tests, computed predicates,
    quantifiers and comparisons. `WorldDefaults` has the last five methods.
    """

    @property
    def schema(self) -> Vocabulary:
        """The declarations."""

    def holds(self, predicate: str, args: tuple[Value, ...]) -> bool:
        """Return whether the fact is true."""

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> Iterable[tuple[Value, ...]]:
        """Return the arguments of all facts that match `pattern`, in order of insertion.

        `None` in `pattern` matches every argument.
        """

    def value(self, function: str, args: tuple[Value, ...]) -> Content:
        """Return the value of the function; before the first assignment, the value in `facts.UNSET`."""

    def objects(self, type_name: str) -> Iterable[str]:
        """Return the objects of that type and its subtypes, in order of insertion."""

    def type_of(self, name: str) -> str | None:
        """Return the type of the object; `None` if the object is unknown."""

    def estimate(self, predicate: str, pattern: tuple[Value | None, ...]) -> int:
        """Return an upper bound of the number of matching facts, so that conjunctions begin with the rarest fact."""

    def reference(self, function: str, args: tuple[Value, ...]) -> str | None:
        """Return the reference of the data source of a function's value, which no effect may set; `None` without."""

    def publishes(self, function: str) -> bool:
        """Return whether a transform tree answers the function, and receives its new values."""

    def require_publishable(self, values: Mapping[Fact, Content]) -> None:
        """Raise `TransformError` if a transform tree refuses one of these values."""

    def spend(self) -> None:
        """Count an effect on the world as work, and end the work at a bound (`Bounds`)."""


class WorldDefaults:
    """The methods of a `World` without an index of its facts, without sources, transform trees and bounds."""

    def estimate(self, predicate: str, pattern: tuple[Value | None, ...]) -> int:  # noqa: ARG002
        """Return 0: all facts count as rare."""
        return 0

    def reference(self, function: str, args: tuple[Value, ...]) -> str | None:  # noqa: ARG002
        """Return `None`: no source."""
        return None

    def publishes(self, function: str) -> bool:  # noqa: ARG002
        """Return `False`: no transform tree."""
        return False

    def require_publishable(self, values: Mapping[Fact, Content]) -> None:
        """Accept all values."""

    def spend(self) -> None:
        """Accept all effects."""


CHECK_EVERY = 500
"""Number of facts and objects between two checks of the clock and of `cancelled`: about a millisecond."""
_LONGEST_SHOWN = 120
_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class Bounds:
    """The bounds of a query; `None` means unbounded.

    Attributes:
        work: maximum number of facts and objects that the query visits; about a million per second.
        seconds: maximum real time in seconds.
        cancelled: called about every millisecond, in the thread that evaluates the query; `True` ends the query.
        now: a clock in seconds.
    """

    work: int | None = None
    seconds: float | None = None
    cancelled: Callable[[], bool] | None = None
    now: Callable[[], float] = time.monotonic


class _BoundReachedError(Exception):  # not an `InputError`: the evaluator must not handle it
    """A query has reached this bound."""


class Meter:
    """Counter of work, e.g. of one query, which ends the work at its bounds.

    Args:
        bounds: the bounds of the work.

    Attributes:
        work: amount of work so far; of a query, the number of facts and objects visited.
    """

    def __init__(self, bounds: Bounds | None) -> None:
        self._bounds = bounds = bounds or Bounds()
        self._began = bounds.now()
        self.work = 0
        self._next_check = 0

    def spend(self, work: int = 1) -> None:
        """Add to the work."""
        self.work += work
        if self.work >= self._next_check:
            self._check()

    def each(self, found: Iterable[_T]) -> Iterator[_T]:
        """Yield the items of `found`, and count each item as work."""
        for one in found:
            self.work += 1
            if self.work >= self._next_check:
                self._check()
            yield one

    @contextmanager
    def over(self, question: str | Expression) -> Iterator[None]:
        """Return a context manager for the evaluation of a query.

        Its exit raises `OutOfBoundsError` if a bound has ended the block.
        """
        try:
            yield
        except _BoundReachedError as reached:
            said = shortened(question if isinstance(question, str) else to_text(question), _LONGEST_SHOWN)
            raise OutOfBoundsError(f"{reached}: {said}", work=self.work, seconds=self.seconds) from None

    def check_soon(self) -> None:
        """Check the bounds at the next piece of work."""
        self._next_check = 0

    @property
    def seconds(self) -> float:
        """The seconds since the construction of this object."""
        return self._bounds.now() - self._began

    def error(self, reason: str) -> Exception:
        """Return the error that ends the work."""
        return _BoundReachedError(reason)

    def _check(self) -> None:
        bounds, seconds = self._bounds, self.seconds
        if bounds.cancelled is not None and bounds.cancelled():
            raise self.error("the query was cancelled")
        if bounds.work is not None and self.work > bounds.work:
            raise self.error(f"the query visits more than {bounds.work} facts and objects")
        if bounds.seconds is not None and seconds > bounds.seconds:
            raise self.error(f"the query takes longer than {bounds.seconds:g} s")
        self._next_check = self.work + CHECK_EVERY
        if bounds.work is not None:
            self._next_check = min(self._next_check, bounds.work + 1)


class BoundedWorld(WorldDefaults):
    """A `World` that counts the results of another world as work."""

    def __init__(self, world: World, meter: Meter) -> None:
        self._world, self._meter = world, meter

    @property
    def schema(self) -> Vocabulary:
        """The declarations."""
        return self._world.schema

    def holds(self, predicate: str, args: tuple[Value, ...]) -> bool:
        """Return whether the fact is true."""
        self._meter.spend()
        return self._world.holds(predicate, args)

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> Iterator[tuple[Value, ...]]:
        """Return the arguments of all facts that match `pattern`."""
        if len(pattern) - pattern.count(None) > 1:  # a list of facts is searched
            self._meter.spend(self._world.estimate(predicate, pattern))
        self._meter.spend()
        return self._meter.each(self._world.match(predicate, pattern))

    def value(self, function: str, args: tuple[Value, ...]) -> Content:
        """Return the value of the function."""
        self._meter.spend()
        return self._world.value(function, args)

    def objects(self, type_name: str) -> Iterable[str]:
        """Return the objects of that type and its subtypes."""
        found = tuple(self._world.objects(type_name))
        self._meter.spend(len(found) + 1)
        return found

    def type_of(self, name: str) -> str | None:
        """Return the type of the object; `None` if the object is unknown."""
        self._meter.spend()
        return self._world.type_of(name)

    def estimate(self, predicate: str, pattern: tuple[Value | None, ...]) -> int:
        """Return an upper bound of the number of matching facts."""
        return self._world.estimate(predicate, pattern)

    def reference(self, function: str, args: tuple[Value, ...]) -> str | None:
        """Return the reference of the data source of a function's value; `None` without a source."""
        return self._world.reference(function, args)

    def spend(self) -> None:
        """Count an effect on the world as work."""
        self._meter.spend()
