"""The world that conditions are evaluated on, and the same world with bounds.

The evaluator finds all candidates through its world. So a world that counts its answers bounds every question on it,
and a world without bounds pays nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol, TypeVar

from knowledge_base.errors import OutOfBoundsError, shortened
from knowledge_base.facts import Content, Value
from knowledge_base.language.checking.vocabulary import Vocabulary
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.language.syntax.text import to_text


class World(Protocol):
    """A state of the world: the store, pending changes on top of it, a planner's state.

    Predicates are those with asserted facts; the language derives types as predicates, computed predicates,
    quantifiers and comparisons from these answers. Three methods are optional. `estimate(predicate, pattern) -> int`
    gives an upper bound of the matching facts, so that conjunctions begin with the rarest. `reference(function, args)
    -> str | None` names the data source of a function's value, which no effect may set. `spend()` is called for every
    effect on the world, and may end it (`Bounds`).
    """

    @property
    def schema(self) -> Vocabulary:
        """The declarations."""

    def holds(self, predicate: str, args: tuple[Value, ...]) -> bool:
        """Whether the fact is true."""

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> Iterable[tuple[Value, ...]]:
        """The arguments of all facts that agree with `pattern`; `None` is open; in order of insertion."""

    def value(self, function: str, args: tuple[Value, ...]) -> Content:
        """The value of the function; until it is set, the value in `facts.UNSET`."""

    def objects(self, type_name: str) -> Iterable[str]:
        """The things of that type or a subtype, in order of insertion."""

    def type_of(self, name: str) -> str | None:
        """The thing's type; `None` if there is no such thing."""


LOOK_EVERY = 500
"""Work between two looks at the clock and at `cancelled`: about a millisecond."""
_LONGEST_SHOWN = 120
_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class Bounds:
    """The bounds of a question; `None` means unbounded.

    Attributes:
        work: number of facts and things that it may visit; about a million in a second.
        seconds: of real time.
        cancelled: called about every millisecond, in the thread that answers; `True` ends the question.
        now: a clock in seconds.
    """

    work: int | None = None
    seconds: float | None = None
    cancelled: Callable[[], bool] | None = None
    now: Callable[[], float] = time.monotonic


class _Given(Exception):  # noqa: N818  no error of the question: the evaluator must not take it for one
    """The question ends without an answer, for this reason."""


class Meter:
    """Counts the work of one question, and ends the question at its bounds.

    Args:
        bounds: those of the question.

    Attributes:
        work: number of facts and things visited.
    """

    def __init__(self, bounds: Bounds | None) -> None:
        self._bounds = bounds = bounds or Bounds()
        self._began = bounds.now()
        self.work = 0
        self._look_at = 0

    def spend(self, work: int = 1) -> None:
        """Add to the work."""
        self.work += work
        if self.work >= self._look_at:
            self._look()

    def each(self, found: Iterable[_T]) -> Iterator[_T]:
        """The items of `found`, counted one by one."""
        for one in found:
            self.work += 1
            if self.work >= self._look_at:
                self._look()
            yield one

    @contextmanager
    def over(self, question: str | Expression) -> Iterator[None]:
        """The block answers the question; raises `OutOfBoundsError` if a bound ends that."""
        try:
            yield
        except _Given as given:
            seconds = self._bounds.now() - self._began
            said = shortened(question if isinstance(question, str) else to_text(question), _LONGEST_SHOWN)
            raise OutOfBoundsError(f"{given}: {said}", work=self.work, seconds=seconds) from None

    def _look(self) -> None:
        bounds, seconds = self._bounds, self._bounds.now() - self._began
        if bounds.cancelled is not None and bounds.cancelled():
            raise _Given("the question was cancelled")
        if bounds.work is not None and self.work > bounds.work:
            raise _Given(f"the question looks at more than {bounds.work} facts and things")
        if bounds.seconds is not None and seconds > bounds.seconds:
            raise _Given(f"the question takes longer than {bounds.seconds:g} s")
        self._look_at = self.work + LOOK_EVERY
        if bounds.work is not None:
            self._look_at = min(self._look_at, bounds.work + 1)


class BoundedWorld:
    """A `World` that counts the answers of another one."""

    def __init__(self, world: World, meter: Meter) -> None:
        self._world, self._meter = world, meter
        self.spend = meter.spend
        self.estimate = getattr(world, "estimate", None)
        self.reference = getattr(world, "reference", None)

    @property
    def schema(self) -> Vocabulary:
        """The declarations."""
        return self._world.schema

    def holds(self, predicate: str, args: tuple[Value, ...]) -> bool:
        """Whether the fact is true."""
        self._meter.spend()
        return self._world.holds(predicate, args)

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> Iterator[tuple[Value, ...]]:
        """The arguments of all facts that agree with `pattern`."""
        if self.estimate is not None and len(pattern) - pattern.count(None) > 1:  # a list that is searched
            self._meter.spend(self.estimate(predicate, pattern))
        self._meter.spend()
        return self._meter.each(self._world.match(predicate, pattern))

    def value(self, function: str, args: tuple[Value, ...]) -> Content:
        """The value of the function."""
        self._meter.spend()
        return self._world.value(function, args)

    def objects(self, type_name: str) -> Iterable[str]:
        """The things of that type or a subtype."""
        found = tuple(self._world.objects(type_name))
        self._meter.spend(len(found) + 1)
        return found

    def type_of(self, name: str) -> str | None:
        """The thing's type; `None` if there is no such thing."""
        self._meter.spend()
        return self._world.type_of(name)
