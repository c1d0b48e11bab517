"""Columns of a layered drawing: straight lines first, then short ones, within the least distances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate, pairwise
from statistics import median

from dsc.drawing.layered.graph import Cell, Grid, effort

Wish = tuple[float, float]
"""A wanted position and its weight."""


def fit(wishes: Sequence[Sequence[Wish]], distances: Sequence[float]) -> list[float]:
    """Return positions that minimise the weighted absolute deviations, by pooling adjacent violators.

    Args:
        wishes: at least one for each position.
        distances: the least distance from each position to the next; one fewer than positions.
    """
    offsets = list(accumulate(distances, initial=0.0))
    blocks: list[tuple[float, int, list[Wish], float]] = []
    for offset, own in zip(offsets, wishes, strict=False):
        pool, size = sorted((value - offset, weight) for value, weight in own), 1
        total = sum(weight for _, weight in own)
        middle = _median(pool, total)
        while blocks and blocks[-1][0] > middle:
            _, more, others, other = blocks.pop()
            pool, size, total = sorted(others + pool), size + more, total + other
            middle = _median(pool, total)
        blocks.append((middle, size, pool, total))
    middles = [middle for middle, size, _, _ in blocks for _ in range(size)]
    return [middle + offset for middle, offset in zip(middles, offsets, strict=False)]


def _median(pool: Sequence[Wish], total: float) -> float:
    """Return the weighted median; the middle of the possible ones if there are several."""
    half = total / 2
    reached = 0.0
    for index, (value, weight) in enumerate(pool):
        reached += weight
        if reached > half:
            return value
        if reached == half and index + 1 < len(pool):
            return (value + pool[index + 1][0]) / 2
    return pool[-1][0]


NODE_GAP = 36.0
LINE_GAP = 14.0
STAY = 0.01
"""Weight of the present position: it only decides between positions that are otherwise equal."""


def place_cells(grid: Grid) -> list[float]:
    """Return the axis of every cell, by its number."""
    axes = [0.0] * len(grid.cells)
    for layer in grid.layers:
        _place(grid, layer, axes, [[(0.0, 1.0)]] * len(layer))
    rounds = effort(grid)
    for number in range(2 * rounds):
        _sweep(grid, axes, above=number % 2 == 0, below=number % 2 == 1)
    for _ in range(rounds):
        _sweep(grid, axes, above=True, below=True)
    return axes


def _sweep(grid: Grid, axes: list[float], *, above: bool, below: bool) -> None:
    """Move every cell to its neighbours in the layers above, below, or both; cells without any to the middle."""
    middle = median(axes) if axes else 0.0
    for layer in grid.layers if above else reversed(grid.layers):
        wishes = []
        for number in layer:
            cell = grid.cells[number]
            others = [*(cell.up.items() if above else ()), *(cell.down.items() if below else ())]
            place = axes[number] if cell.up or cell.down else middle
            wishes.append([*((axes[other], weight) for other, weight in others), (place, STAY)])
        _place(grid, layer, axes, wishes)


def straighten(grid: Grid, axes: list[float], ends: Mapping[tuple[int, int], float]) -> None:
    """Move cells so that connections off a node's axis are straight, if there is room.

    Args:
        grid: the cells.
        axes: is changed.
        ends: (cell, neighbour) -> position at which the connection meets the cell.
    """
    off = {pair: end - axes[pair[0]] for pair, end in ends.items()}

    def wishes(number: int) -> list[Wish]:
        cell = grid.cells[number]
        others = [*cell.up.items(), *cell.down.items()]
        straight = [(axes[other] + off[other, number] - off[number, other], weight) for other, weight in others]
        return [*straight, (axes[number], STAY)]

    for sweep in range(min(effort(grid), 4)):
        for layer in grid.layers if sweep % 2 else reversed(grid.layers):
            _place(grid, layer, axes, [wishes(number) for number in layer])


def _place(grid: Grid, layer: list[int], axes: list[float], wishes: list[list[Wish]]) -> None:
    distances = [distance(grid.cells[one], grid.cells[other]) for one, other in pairwise(layer)]
    for cell, axis in zip(layer, fit(wishes, distances), strict=True):
        axes[cell] = axis


def distance(left: Cell, right: Cell) -> float:
    """Return the least distance between the axes of two neighbouring cells."""
    return left.right + right.left + (NODE_GAP if left.is_node and right.is_node else LINE_GAP)
