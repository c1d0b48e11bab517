"""Checks of pushed values: functions with names that conditions at the source use (S2.4, S2.18).

A port has further checks: `Push(values, checks=(near_edge,))`. A name of Python such as `near_edge` is written
`near-edge` in conditions.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from knowledge_base.errors import InputError
from knowledge_base.user_objects import shown

_POSE = 7
"""Number of the numbers of a pose: x y z in metres, and a quaternion."""
MOST_KEPT = 100
"""Number of newest values that a series keeps."""


class Series:
    """The newest values of one value of a push port, with the loop times in seconds of their `put`.

    Attributes:
        name: the port and the value, e.g. `scan.metres`.
        kept: times and values, the oldest first; at most `MOST_KEPT`.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.kept: deque[tuple[float, Any]] = deque(maxlen=MOST_KEPT)

    @property
    def newest(self) -> Any:
        """The newest value."""
        return self.kept[-1][1]

    @property
    def number(self) -> float:
        """The newest value; raise `InputError` if it is not a number."""
        return _number(self.name, self.newest)

    @property
    def numbers(self) -> list[float]:
        """The newest value as a list of numbers; raise `InputError` if it is no such list."""
        value = self.newest
        if isinstance(value, Sequence) and not isinstance(value, str):
            return [_number(self.name, one) for one in value]
        raise InputError(f"'{self.name}' is {shown(value)}, and a check needs a list of numbers", found=self.name)

    def earlier(self, steps: int = 1) -> tuple[float, float] | None:
        """Return time and number of the value that many puts before the newest one; `None` if there is none."""
        if len(self.kept) <= steps:
            return None
        at, value = self.kept[-1 - steps]
        return at, _number(self.name, value)


Point = Series | Sequence[float]
"""A point: the newest value of a series, or a list."""
Check = Callable[..., Any]
"""Function of series and constants that returns a number or a truth value."""


def change(value: Series) -> float:
    """Return the difference to the value before; 0 for the first one."""
    before = value.earlier()
    return 0.0 if before is None else value.number - before[1]


def rate(value: Series) -> float:
    """Return the change per second since the value before; 0 for the first one."""
    before = value.earlier()
    if before is None:
        return 0.0
    seconds = value.kept[-1][0] - before[0]
    return (value.number - before[1]) / seconds if seconds > 0 else 0.0


def differs(value: Series) -> bool:
    """Return whether the value differs from the one before."""
    return len(value.kept) > 1 and bool(value.newest != value.kept[-2][1])


def approaches(value: Series, target: float) -> bool:
    """Return whether the value is closer to the target than the value before."""
    before = value.earlier()
    return before is not None and abs(value.number - target) < abs(before[1] - target)


def in_range(value: Series, least: float, most: float) -> bool:
    """Return whether the value is between two bounds, inclusive; raise `InputError` for exchanged bounds."""
    if least > most:
        raise InputError(f"the lower bound {least:g} is above the upper bound {most:g}")
    return least <= value.number <= most


def mean(value: Series, puts: int) -> float:
    """Return the mean of that many newest values, or of all as long as there are fewer.

    Raises:
        InputError: `puts` is not a whole number from 1 to `MOST_KEPT`.
    """
    if puts != int(puts) or not 1 <= puts <= MOST_KEPT:
        raise InputError(f"a mean is over a whole number of values from 1 to {MOST_KEPT}, not {puts:g}")
    newest = [_number(value.name, one) for _, one in [*value.kept][-int(puts) :]]
    return math.fsum(newest) / len(newest)


def magnitude(value: Series) -> float:
    """Return the length of a vector."""
    return math.hypot(*value.numbers)


def distance(value: Point, target: Point) -> float:
    """Return the distance between two points, each a value or a list; of a pose, its position counts."""
    first, second = _point(value), _point(target)
    if len(first) != len(second):
        raise InputError(f"a distance is between points of equal size, not {len(first)} and {len(second)} numbers")
    return math.dist(first, second)


def _point(given: Point) -> list[float]:
    numbers = given.numbers if isinstance(given, Series) else [_number("a point", one) for one in given]
    return numbers[:3] if len(numbers) == _POSE else numbers


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"'{name}' is {shown(value)}, and a check needs a number", found=name)
    return value


def by_name(*checks: Check) -> Mapping[str, Check]:
    """Return the checks by their names in conditions."""
    return {check.__name__.replace("_", "-"): check for check in checks}


LIBRARY = by_name(change, rate, differs, approaches, in_range, mean, magnitude, distance)
"""The checks of all components by name; `(silent port seconds)` is a further one, which depends on time."""
ARGUMENT_KINDS: Mapping[Check, str] = {
    **dict.fromkeys((change, rate, approaches, in_range, mean), "number"),
    **dict.fromkeys((magnitude, distance), "list"),
}
"""The kind of all arguments of a check; the arguments of other checks may have any kind."""
