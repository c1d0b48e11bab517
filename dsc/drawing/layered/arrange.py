"""Arrangement of nodes and links in four stages: layers, order within layers, columns, and tracks of lines."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from dsc.drawing.layered.columns import Ports, assign_ports, place_cells, straighten
from dsc.drawing.layered.graph import (
    Arrangement,
    Grid,
    LayerLink,
    LayerNode,
    Point,
    Route,
    build_grid,
    effort,
    order_cells,
)

TRACK_GAP = 10.0
AT_NODES = 13.0
"""Length of the straight end of a line at a node, enough for an arrowhead, in pixels."""
AT_LABELS = 4.0


def arrange(nodes: Sequence[LayerNode], links: Sequence[LayerLink], *, sideways: bool = False) -> Arrangement:
    """Return the layered drawing of a graph, from top to bottom, or from left to right if `sideways`.

    Layers follow the order of `nodes`, so that a link from a later to an earlier node leads upwards. No node or label
    overlaps another. Equal arguments give equal drawings.
    """
    if sideways:
        turned = [replace(node, width=node.height, height=node.width) for node in nodes]
        return _turn(arrange(turned, [replace(k, width=k.height, height=k.width) for k in links]))
    grid = build_grid(nodes, links)
    order_cells(grid)
    axes = place_cells(grid)
    for _ in range(min(effort(grid), 3)):
        straighten(grid, axes, assign_ports(nodes, grid, axes))
    left = min((axis - cell.left for axis, cell in zip(axes, grid.cells, strict=True)), default=0.0)
    axes = [round(axis - left, 1) for axis in axes]
    ports = assign_ports(nodes, grid, axes)
    return _Levels(nodes, grid, axes, ports).arrangement(links)


def _turn(drawing: Arrangement) -> Arrangement:
    def turn(point: Point) -> Point:
        return point[1], point[0]

    routes = (Route(tuple(map(turn, route.points)), turn(route.label)) for route in drawing.routes)
    return Arrangement(drawing.height, drawing.width, tuple(map(turn, drawing.corners)), tuple(routes))


class _Levels:
    """Heights of the layers and of the tracks between the layers."""

    def __init__(self, nodes: Sequence[LayerNode], grid: Grid, axes: list[float], ports: Ports) -> None:
        self._nodes = nodes
        self._grid, self._axes, self._ports = grid, axes, ports
        self._tracks: dict[tuple[int, int], float] = {}
        self._middles: list[float] = []
        y = 0.0
        for number, layer in enumerate(grid.layers):
            height = max((grid.cells[cell].height for cell in layer), default=0.0)
            self._middles.append(y + height / 2)
            y += height
            if number + 1 < len(grid.layers):
                y += self._gap(number, y)
        self.height = y

    def _gap(self, upper: int, top: float) -> float:
        """Assign the tracks below the layer `upper`, which ends at the height `top`; return their total height."""
        above, below = (AT_NODES, AT_LABELS) if upper % 2 == 0 else (AT_LABELS, AT_NODES)
        members = self._nets(self._grid.layers[upper])
        nets = [
            Net(
                tuple(self._ports[one, other] for one, other in pairs),
                tuple(self._ports[other, one] for one, other in pairs),
            )
            for pairs in members
        ]
        tracks = assign_tracks(nets)
        for pairs, track in zip(members, tracks, strict=True):
            self._tracks.update(dict.fromkeys(pairs, top + above + track * TRACK_GAP))
        return above + max(tracks, default=0) * TRACK_GAP + below

    def _nets(self, layer: list[int]) -> list[list[tuple[int, int]]]:
        """Return the connections below a layer in groups; the connections of a group share a horizontal line."""
        cells = self._grid.cells
        nets: dict[tuple[int, int], list[tuple[int, int]]] = {}
        for upper in layer:
            for lower in cells[upper].down:
                if cells[lower].bend and len(cells[lower].up) > 1:
                    key = (-1, lower)
                elif cells[upper].bend and len(cells[upper].down) > 1:
                    key = (upper, -1)
                else:
                    key = (upper, lower)
                nets.setdefault(key, []).append((upper, lower))
        return list(nets.values())

    def arrangement(self, links: Sequence[LayerLink]) -> Arrangement:
        """Return the drawing with the places of all nodes and the routes of all links."""
        cells, axes = self._grid.cells, self._axes
        nodes = [(axes[n], cell) for n, cell in enumerate(cells) if cell.is_node]
        corners = [(axis - cell.left, self._middles[cell.layer] - cell.height / 2) for axis, cell in nodes]
        routes = [self._route(chain, link) for chain, link in zip(self._grid.chains, links, strict=True)]
        right = max((axis + cell.right for axis, cell in zip(axes, cells, strict=True)), default=0.0)
        return Arrangement(right, self.height, tuple(corners), tuple(routes))

    def _route(self, chain: list[int], link: LayerLink) -> Route:
        points: list[Point] = [self._end(chain[0], chain[1])]
        for one, other in pairwise(chain):
            track = self._tracks[(one, other) if (one, other) in self._tracks else (other, one)]
            points += [(self._ports[one, other], track), (self._ports[other, one], track)]
        points.append(self._end(chain[-1], chain[-2]))
        label = chain[1]
        middle = self._middles[self._grid.cells[label].layer]
        return Route(without_detours(points), (self._axes[label], middle) if link.height else points[0])

    def _end(self, node: int, neighbour: int) -> Point:
        cell = self._grid.cells[node]
        half = cell.height / 2 if neighbour in cell.down else -cell.height / 2
        across = self._ports[node, neighbour]
        if self._nodes[node].diamond:
            half *= 1 - abs(across - self._axes[node]) / cell.left
        return across, self._middles[cell.layer] + half


def without_detours(points: Sequence[Point]) -> tuple[Point, ...]:
    """Return the polyline without the points that lie on the straight line between their neighbours."""
    kept: list[Point] = []
    for point in points:
        if kept and point == kept[-1]:
            continue
        if len(kept) > 1 and any(kept[-2][axis] == kept[-1][axis] == point[axis] for axis in (0, 1)):
            kept[-1] = point
        else:
            kept.append(point)
    return tuple(kept)


CLOSE = 8.0
"""Distance in pixels below which two lines look like one line."""
MANY = 40
"""Number of lines above which tracks are assigned by first fit, without a count of crossings."""
SAME_LINE = 100
"""Cost of two lines on top of each other, in crossings."""


@dataclass(frozen=True, slots=True)
class Net:
    """Lines with a common horizontal part: the x coordinates at which they reach this part from above and below."""

    tops: tuple[float, ...]
    bottoms: tuple[float, ...]

    @property
    def low(self) -> float:
        """The left end of the horizontal part."""
        return min(*self.tops, *self.bottoms)

    @property
    def high(self) -> float:
        """The right end of the horizontal part."""
        return max(*self.tops, *self.bottoms)

    @property
    def straight(self) -> bool:
        """Whether the horizontal part has the length 0, so that the net needs no track."""
        return self.high == self.low


def assign_tracks(nets: Sequence[Net]) -> list[int]:
    """Return the number of each net's track, counted from the top; overlapping nets have different tracks."""
    bent = [number for number, net in enumerate(nets) if not net.straight]
    order = sorted(bent, key=lambda number: (nets[number].low, nets[number].high))
    tracks = [0] * len(nets)
    if len(bent) > MANY:
        _first_fit(nets, order, tracks)
        return tracks
    order = _least_crossing(nets, order)
    for place, number in enumerate(order):
        above = [tracks[other] for other in order[:place] if _overlap(nets[other], nets[number])]
        tracks[number] = 1 + max(above, default=-1)
    return tracks


def _first_fit(nets: Sequence[Net], order: Iterable[int], tracks: list[int]) -> None:
    ends: list[float] = []
    for number in order:
        net = nets[number]
        free = (track for track, end in enumerate(ends) if end + CLOSE < net.low)
        tracks[number] = next(free, len(ends))
        ends[tracks[number] : tracks[number] + 1] = [net.high]


def _least_crossing(nets: Sequence[Net], order: list[int]) -> list[int]:
    """Return the nets from top to bottom: each next net has the largest gain above all remaining nets (greedy)."""
    gain = {(a, b): _cost(nets[b], nets[a]) - _cost(nets[a], nets[b]) for a in order for b in order}
    score = {a: sum(gain[a, b] for b in order) for a in order}
    result = []
    while score:
        first = max(score, key=score.__getitem__)
        del score[first]
        for other in score:
            score[other] -= gain[other, first]
        result.append(first)
    return result


def _cost(above: Net, below: Net) -> int:
    """Return the cost in crossings if the net `above` is above the net `below`."""
    cost = sum(below.low < x < below.high for x in above.bottoms)
    cost += sum(above.low < x < above.high for x in below.tops)
    shared = any(abs(x - other) < CLOSE / 2 for x in above.bottoms for other in below.tops)
    return cost + SAME_LINE * shared


def _overlap(one: Net, other: Net) -> bool:
    return one.low < other.high + CLOSE and other.low < one.high + CLOSE
