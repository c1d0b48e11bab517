"""Ranges of numbers: how far planning actions can change each number, if deletes are ignored.

The ranges are intervals, as in numeric relaxed planning (Hoffmann, *The Metric-FF Planning System*, 2003): a change may
be repeated, and the values of several numbers are independent. So a range contains every value that a plan can reach.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field
from itertools import count, product

from knowledge_base.facts import Fact
from knowledge_base.language.evaluation.world_protocol import World
from planning.model.quantities import Assignment, NumericBound, Operation, Quantity, value_of
from planning.problem.task import GroundOperator, Task

Range = tuple[float, float]
"""The least and the greatest value of a number."""

_EVERY: Range = (-math.inf, math.inf)
_MOST_ROUNDS = 50
"""Number of rounds after which a growing range is unlimited, as in `(assign (n) (* 2 (n)))`."""

_POSSIBLE: Mapping[str, Callable[[Range, Range], bool]] = {
    "=": lambda left, right: left[0] <= right[1] and right[0] <= left[1],
    "<": lambda left, right: left[0] < right[1],
    "<=": lambda left, right: left[0] <= right[1],
    ">": lambda left, right: left[1] > right[0],
    ">=": lambda left, right: left[1] >= right[0],
}


@dataclass(slots=True)
class Ranges:
    """The ranges of the numbers of a world, from the present values to the values after any changes.

    Attributes:
        world: the present world.
        known: the ranges of the numbers that were read or changed.
    """

    world: World
    known: dict[Fact, Range] = field(default_factory=dict)

    def of(self, quantity: Quantity) -> Range:
        """Return the range of a number or of an operation on numbers."""
        match quantity:
            case Fact():
                if quantity not in self.known:
                    self.known[quantity] = (value_of(self.world, quantity),) * 2
                return self.known[quantity]
            case Operation(name, args):
                first, *rest = map(self.of, args)
                for one in rest:
                    first = _combine(name, first, one)
                return first if rest else (-first[1], -first[0])
            case _:
                return quantity, quantity

    def allow(self, bound: NumericBound) -> bool:
        """Return whether the bound may hold; `False` is certain."""
        return _POSSIBLE[bound.operator](self.of(bound.left), self.of(bound.right))

    def widen(self, change: Assignment, *, without_limit: bool) -> bool:
        """Widen the range of a number by a change, which may be repeated; return whether the range grew."""
        low, high = self.of(change.fluent)
        least, most = self.of(change.amount)
        if change.increase:
            least, most = -math.inf if least < 0 else low, math.inf if most > 0 else high
        elif without_limit:
            least, most = _beyond(least, low), -_beyond(-most, -high)
        self.known[change.fluent] = min(low, least), max(high, most)
        return self.known[change.fluent] != (low, high)

    def limits(self, bound: NumericBound) -> str:
        """Return the limits of the numbers in a bound as text, e.g. `(tank) is at most 100`."""
        return " and ".join(f"{one} is {_in_words(self.of(one))}" for one in dict.fromkeys(bound.fluents()))


def reached_literals(task: Task, ranges: Ranges) -> set[int]:
    """Return the numbers of the literals that are reachable without deletes, and widen the ranges by the changes."""
    bounds, reached = task.numbering.bounds, set(task.init)
    pending, changes = list(task.ways.all), dict[Assignment, None]()
    for turn in count():
        ready, waiting = list[GroundOperator](), list[GroundOperator]()
        for way in pending:
            (ready if _is_possible(way, reached, bounds, ranges) else waiting).append(way)
        for way in ready:
            reached.update(way.adds)
            changes.update(dict.fromkeys(way.assignments))
        wider = [ranges.widen(change, without_limit=turn > _MOST_ROUNDS) for change in changes]
        if not ready and not any(wider):
            break
        pending = waiting
    return reached - bounds.keys() - task.numbering.fluents


def _is_possible(
    way: GroundOperator, reached: Container[int], bounds: Mapping[int, NumericBound], ranges: Ranges
) -> bool:
    return all(ranges.allow(bounds[one]) if one in bounds else one in reached for one in way.needs)


def _beyond(least: float, low: float) -> float:
    """Return a limit below all values of a number that decreases from `low` to `least`, and further."""
    return low if least >= low else 0.0 if least >= 0 else -math.inf


def _combine(name: str, left: Range, right: Range) -> Range:
    match name:
        case "+":
            return left[0] + right[0], left[1] + right[1]
        case "-":
            return left[0] - right[1], left[1] - right[0]
        case "*":
            ends = [one * other if one and other else 0.0 for one, other in product(left, right)]
            return min(ends), max(ends)
        case _ if right[0] > 0 or right[1] < 0:
            return _combine("*", left, (1 / right[1], 1 / right[0]))
        case _:
            return _EVERY


def _in_words(limits: Range) -> str:
    least, most = limits
    if least == most:
        return f"{least:g}"
    words = [f"at least {least:g}"] * (least > -math.inf) + [f"at most {most:g}"] * (most < math.inf)
    return " and ".join(words) or "without limit"
