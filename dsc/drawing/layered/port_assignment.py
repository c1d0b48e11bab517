"""Ports of connections at nodes: spread along the upper or lower side, with straight lines where possible."""

from __future__ import annotations

from collections.abc import Sequence

from dsc.drawing.layered.columns import Wish, fit
from dsc.drawing.layered.graph import Grid, LayerNode

PORT_GAP = 14.0
TIGHT = 8.0
"""The distance of ports if they would not fit otherwise."""
CORNER = 11.0
"""Free space at a node's corners."""
BESIDE = 12.0
"""Distance from a diamond's corner to links next to it."""
STRAIGHT = 16.0
"""Weight of a connection that can be straight, relative to one that cannot."""

Ports = dict[tuple[int, int], float]
"""(cell, neighbour) -> position, across the drawing, at which the connection meets the cell."""


def assign_ports(nodes: Sequence[LayerNode], grid: Grid, axes: Sequence[float]) -> Ports:
    """Return the ends of all connections between cells; lines and labels are met on their axis."""
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
    """Return the connections of links that leave a node upwards or reach it from below."""
    ends = {(chain[0], chain[1]) for chain in grid.chains if chain[1] in grid.cells[chain[0]].up}
    return ends | {(chain[-1], chain[-2]) for chain in grid.chains if chain[-2] in grid.cells[chain[-1]].down}


def _at_corner(axis: float, width: float, turning: Sequence[float | None]) -> list[float]:
    """Place links at the corner; those against the order are next to it, on their side, if both kinds meet."""
    if None not in turning:
        return [axis] * len(turning)
    aside = min(BESIDE, width / 4)
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
    places = [-place for place in _capped([-place for place in reversed(places)], -low, tight)][::-1]
    return _capped(places, high, tight)


def _capped(places: Sequence[float], limit: float, tight: float) -> list[float]:
    """Return the places, with the fewest possible moved down so that none is above the limit."""
    result: list[float] = []
    for place in reversed(places):
        result.append(min(place, limit))
        limit = result[-1] - tight
    return result[::-1]
