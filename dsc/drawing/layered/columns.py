"""Columns of a layered drawing: straight lines have priority over short lines; least distances are kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate, pairwise
from statistics import median

from dsc.drawing.layered.graph import Cell, Grid, LayerNode, effort

Wish = tuple[float, float]
"""A wanted position and the weight of a deviation from this position."""


def fit(wishes: Sequence[Sequence[Wish]], distances: Sequence[float]) -> list[float]:
    """Return the positions that minimise the weighted absolute deviations from `wishes` (pool adjacent violators).

    Args:
        wishes: wishes for each position, at least one.
        distances: least distance from each position to the next, so one fewer than `wishes`.
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
    """Return the weighted median; the middle of the interval if several medians are possible."""
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
"""Weight of the current position, small enough to decide only between otherwise equal positions."""


def place_cells(grid: Grid) -> list[float]:
    """Return the axis of each cell, a position across the drawing, in the order of the cells."""
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
    """Move every cell towards its connected cells above, below or both; cells without connection move to the middle."""
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
    """Move cells so that connections that end off a node's axis become straight, if there is space.

    Args:
        grid: the cells.
        axes: axes of the cells, which are changed.
        ends: position at which a connection ends at a cell, by the pair of this cell and the connected cell.
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
    """Return the least distance between the axes of two cells that are neighbours in a layer."""
    return left.right + right.left + (NODE_GAP if left.is_node and right.is_node else LINE_GAP)


PORT_GAP = 14.0
TIGHT = 8.0
"""Distance of ports in pixels if the usual distance exceeds the node's width."""
CORNER = 11.0
"""Length at a node's corners where no link ends, in pixels."""
MARGIN = 12.0
"""Distance between a diamond's corner and links that end next to this corner, in pixels."""
STRAIGHT = 16.0
"""Weight of a connection that can be straight; a connection that cannot has the weight 1."""

Ports = dict[tuple[int, int], float]
"""Position across the drawing at which a connection ends at a cell, by the pair of this and the connected cell."""


def assign_ports(nodes: Sequence[LayerNode], grid: Grid, axes: Sequence[float]) -> Ports:
    """Return the ends of all connections between cells; at lines and labels, connections end on the axis."""
    ports: Ports = {}
    against = _against_the_order(grid)
    for number, cell in enumerate(grid.cells):
        for side in (cell.up, cell.down):
            others = sorted(side, key=lambda other: (axes[other], other))
            if not cell.is_node or nodes[number].pointed:
                places = [axes[number]] * len(others)
            elif nodes[number].diamond:
                places = _at_corner(
                    axes[number],
                    nodes[number].width,
                    [axes[other] if (number, other) in against else None for other in others],
                )
            else:
                places = _spread(axes[number], nodes[number].width, [axes[other] for other in others])
            ports.update(((number, other), round(place, 1)) for other, place in zip(others, places, strict=True))
    return ports


def _against_the_order(grid: Grid) -> set[tuple[int, int]]:
    """Return the connections with which links leave their source upwards or reach their target from below."""
    ends = {(chain[0], chain[1]) for chain in grid.chains if chain[1] in grid.cells[chain[0]].up}
    return ends | {(chain[-1], chain[-2]) for chain in grid.chains if chain[-2] in grid.cells[chain[-1]].down}


def _at_corner(axis: float, width: float, turning: Sequence[float | None]) -> list[float]:
    """Return the ends of links at a diamond's corner.

    If both kinds of links meet there, the links against the order end next to the corner, on their side.
    """
    if None not in turning:
        return [axis] * len(turning)
    aside = min(MARGIN, width / 4)
    return [axis if other is None else axis + (aside if other >= axis else -aside) for other in turning]


def _spread(axis: float, width: float, wanted: Sequence[float]) -> list[float]:
    if not wanted:
        return []
    low, high = axis - width / 2 + CORNER, axis + width / 2 - CORNER
    gap = min(PORT_GAP, (high - low) / max(len(wanted) - 1, 1))
    wishes: list[list[Wish]] = [
        [(want, STRAIGHT)] if low <= want <= high else [(low if want < low else high, 1.0)] for want in wanted
    ]
    places = fit(wishes, [gap] * (len(wanted) - 1))
    tight = min(TIGHT, gap)
    places = [-place for place in _cap([-place for place in reversed(places)], -low, tight)][::-1]
    return _cap(places, high, tight)


def _cap(places: Sequence[float], limit: float, tight: float) -> list[float]:
    """Return the places, of which as few as possible are reduced so that no place exceeds the limit."""
    result: list[float] = []
    for place in reversed(places):
        result.append(min(place, limit))
        limit = result[-1] - tight
    return result[::-1]
