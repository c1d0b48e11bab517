"""Maze search: finds the cheapest path along a grid of horizontal and vertical lines around obstacles."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping, Sequence
from heapq import heappop, heappush
from itertools import pairwise
from math import inf

from dsc.drawing.layout import Area, Point

BEND = 25.0
"""Price of one bend, in pixels of additional length."""
CROSSED = 15.0
"""Price of one crossing, in pixels of additional length."""
COVERED = 5.0
"""Additional price for each pixel on top of another line."""
THROUGH = 60.0
"""Additional price for each pixel through an obstacle; only a path without any alternative crosses obstacles."""
NEAR = 3.5
"""Distance in pixels below which one line counts as being on top of another."""

Node = tuple[int, int, bool]
"""A node of the search: column, row, and whether the last step was vertical."""


class Maze:
    """A grid of tracks with a price for each step between neighbouring grid points.

    Args:
        xs, ys: positions of the vertical and of the horizontal tracks.
        solid: areas of the obstacles.
        lines: existing horizontal or vertical lines; a path that crosses or covers one has an additional price.
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
        """Return the cheapest path from a grid point to one of the goals: start, bends and goal.

        Args:
            start: first point of the path.
            goals: additional price of each goal, a grid point with the direction after the path (vertical or not).
            vertical: whether the line before the start is vertical.
        """
        (left, right), (top, low) = (_span(place[axis] for place, _ in goals) for axis in (0, 1))

        def least(node: Node) -> float:
            """Return a lower bound of the price from a node to the nearest goal."""
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
    """Return the prices of the steps between `places`, for each of `count` lines without obstacles."""
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
    """Increase the prices of the steps inside a rectangle, which is given along and across the steps."""
    first, last = max(bisect_right(along, reach[0]) - 1, 0), min(bisect_left(along, reach[1]), len(along) - 1)
    for line in range(bisect_right(across, width[0]), bisect_left(across, width[1])):
        for step in range(first, last):
            prices[line][step] += factor * (along[step + 1] - along[step])


def _cut(
    prices: list[list[float]], along: Sequence[float], across: Sequence[float], at: float, reach: tuple[float, float]
) -> None:
    """Increase the prices of the steps that cross a line at the position `at`."""
    step = bisect_right(along, at) - 1
    if 0 <= step < len(along) - 1:
        for line in range(bisect_left(across, reach[0]), bisect_right(across, reach[1])):
            prices[line][step] += CROSSED
