"""Maze search: the cheapest path along a grid of horizontal and vertical lines around obstacles."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping, Sequence
from heapq import heappop, heappush
from itertools import pairwise
from math import inf

from dsc.drawing.layout import Area, Point

BEND = 25.0
"""Additional length that saving one bend justifies."""
CROSSED = 15.0
"""Additional length that avoiding one crossing justifies."""
COVERED = 5.0
"""Additional price per pixel on top of another line."""
THROUGH = 60.0
"""Additional price per pixel through an obstacle: the last resort."""
NEAR = 3.5
"""Lines closer than this run on top of each other."""

Node = tuple[int, int, bool]
"""Column, row, and whether it was reached vertically."""


class Maze:
    """A grid with prices.

    Args:
        xs, ys: tracks for lines.
        solid: obstacles.
        lines: horizontal or vertical lines; crossing or covering them costs extra.
    """

    def __init__(
        self, xs: Iterable[float], ys: Iterable[float], solid: Iterable[Area], lines: Iterable[tuple[Point, Point]]
    ) -> None:
        self._xs, self._ys = sorted(set(xs)), sorted(set(ys))
        self._across = _lengths(self._xs, len(self._ys))
        self._down = _lengths(self._ys, len(self._xs))
        for x, y, width, height in solid:
            _spoil(self._across, self._xs, self._ys, (x, x + width), (y, y + height), THROUGH)
            _spoil(self._down, self._ys, self._xs, (y, y + height), (x, x + width), THROUGH)
        for (x, y), (u, v) in lines:
            low, high = sorted(((x, y), (u, v)))
            if y == v:
                _spoil(self._across, self._xs, self._ys, (low[0], high[0]), (y - NEAR, y + NEAR), COVERED)
                _cut(self._down, self._ys, self._xs, y, (low[0], high[0]))
            else:
                _spoil(self._down, self._ys, self._xs, (low[1], high[1]), (x - NEAR, x + NEAR), COVERED)
                _cut(self._across, self._xs, self._ys, x, (low[1], high[1]))

    def way(self, start: Point, goals: Mapping[tuple[Point, bool], float], *, vertical: bool) -> list[Point]:
        """Return the cheapest path from a grid point to one of the goals, reduced to its bends.

        Args:
            start: its first point.
            goals: grid points with the direction after them (vertical or not) -> an additional price.
            vertical: the direction before the start.
        """
        (left, right), (top, low) = (_span(place[axis] for place, _ in goals) for axis in (0, 1))

        def least(node: Node) -> float:
            """Return a lower bound of the remaining price."""
            x, y = self._xs[node[0]], self._ys[node[1]]
            return max(left - x, x - right, 0.0) + max(top - y, y - low, 0.0)

        ends = {(self._column(x), self._row(y), up): price for ((x, y), up), price in goals.items()}
        first = (self._column(start[0]), self._row(start[1]), vertical)
        paid: dict[Node, float] = {first: 0.0}
        came: dict[Node, Node] = {}
        queue: list[tuple[float, Node, bool]] = [(least(first), first, False)]
        done: set[Node] = set()
        while queue:
            _, node, arrived = heappop(queue)
            if arrived:
                return self._points(node, came)
            if node in done:
                continue
            done.add(node)
            price = paid[node]
            for end in ((*node[:2], False), (*node[:2], True)):
                if end in ends:
                    heappush(queue, (price + ends[end] + BEND * (end[2] != node[2]), node, True))
            for following, step in self._steps(node):
                if price + step < paid.get(following, inf):
                    paid[following], came[following] = price + step, node
                    heappush(queue, (price + step + least(following), following, False))
        raise AssertionError("a grid is connected")

    def _steps(self, node: Node) -> Iterable[tuple[Node, float]]:
        column, row, vertical = node
        for step in (-1, 0):
            if 0 <= column + step < len(self._xs) - 1:
                price = self._across[row][column + step] + BEND * vertical
                yield (column + 2 * step + 1, row, False), price
            if 0 <= row + step < len(self._ys) - 1:
                price = self._down[column][row + step] + BEND * (not vertical)
                yield (column, row + 2 * step + 1, True), price

    def _points(self, node: Node, came: Mapping[Node, Node]) -> list[Point]:
        nodes = [node]
        while nodes[-1] in came:
            nodes.append(came[nodes[-1]])
        return [(self._xs[column], self._ys[row]) for column, row, _ in reversed(nodes)]

    def _column(self, x: float) -> int:
        return bisect_left(self._xs, x)

    def _row(self, y: float) -> int:
        return bisect_left(self._ys, y)


def _span(places: Iterable[float]) -> tuple[float, float]:
    listed = list(places)
    return min(listed), max(listed)


def _lengths(places: Sequence[float], count: int) -> list[list[float]]:
    """Return the prices of the steps along `count` free lines."""
    steps = [after - before for before, after in pairwise(places)]
    return [steps.copy() for _ in range(count)]


def _spoil(
    prices: list[list[float]],
    along: Sequence[float],
    across: Sequence[float],
    reach: tuple[float, float],
    width: tuple[float, float],
    factor: float,
) -> None:
    """Raise the prices of the steps in a rectangle, which is given along and across them."""
    first, last = max(bisect_right(along, reach[0]) - 1, 0), min(bisect_left(along, reach[1]), len(along) - 1)
    for line in range(bisect_right(across, width[0]), bisect_left(across, width[1])):
        for step in range(first, last):
            prices[line][step] += factor * (along[step + 1] - along[step])


def _cut(
    prices: list[list[float]], along: Sequence[float], across: Sequence[float], at: float, reach: tuple[float, float]
) -> None:
    """Raise the prices of the steps that cross a line at `at`."""
    step = bisect_right(along, at) - 1
    if 0 <= step < len(along) - 1:
        for line in range(bisect_left(across, reach[0]), bisect_right(across, reach[1])):
            prices[line][step] += CROSSED
