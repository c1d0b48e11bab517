"""Graph and grid of a layered drawing: nodes in layers, and links as chains of cells.

Lengths are in pixels, and y grows downwards.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class LayerNode:
    """A box to place in the drawing.

    Attributes:
        width, height: size of the box.
        beside: width of the free space right of the box, e.g. for a loop.
        pointed: whether all links end in the middle of a side, instead of along the side.
        diamond: whether the box is pointed and has the shape of a diamond, where links against the order end next to
            the corners.
        last: whether the box must be below all its sources, so that no link leads upwards to it.
    """

    width: float
    height: float
    beside: float = 0.0
    pointed: bool = False
    diamond: bool = False
    last: bool = False


@dataclass(frozen=True, slots=True)
class LayerLink:
    """An edge between two different nodes.

    Attributes:
        source, target: indices of the nodes in the input.
        width, height: size of the label; 0 without a label.
        weight: importance of a straight line, relative to other links.
        meant: name of the element inside the target at which the link ends; links to an equal element share a line.
    """

    source: int
    target: int
    width: float = 0.0
    height: float = 0.0
    weight: float = 1.0
    meant: str = ""


@dataclass(frozen=True, slots=True)
class Route:
    """The points of a link's line, from source to target, and the middle of the link's label."""

    points: tuple[Point, ...]
    label: Point


@dataclass(frozen=True, slots=True)
class Arrangement:
    """A finished drawing: upper left corners of the nodes and routes of the links, in the order of the input."""

    width: float
    height: float
    corners: tuple[Point, ...]
    routes: tuple[Route, ...]


LABEL_GAP = 4.0
"""Free space around a label's text, in pixels."""

_Trunk = tuple[int, str, int, int]
"""Key of links that share a line in a layer: target, element inside the target, direction, layer."""


@dataclass(slots=True)
class Cell:
    """An element with a place in a layer: a node, a label, or a line that passes through the layer.

    Attributes:
        layer: number of the layer, counted from the top.
        left, right: extents to the left and right of the cell's axis.
        height: height of the cell.
        is_node: whether the cell is a node.
        bend: whether the cell is only a line.
        up, down: weight of a straight connection, by the index of the connected cell in the layer above or below.
    """

    layer: int
    left: float
    right: float
    height: float
    is_node: bool = False
    bend: bool = False
    up: dict[int, float] = field(default_factory=dict)
    down: dict[int, float] = field(default_factory=dict)


@dataclass(slots=True)
class Grid:
    """The cells (nodes first), the chain of cells for each link, and the order of cells in each layer."""

    cells: list[Cell]
    chains: list[list[int]]
    layers: list[list[int]]


def effort(grid: Grid) -> int:
    """Return the number of improvement rounds for a grid; large grids have few rounds, to bound the time to seconds."""
    size = len(grid.cells)
    return 8 if size < 3_000 else 4 if size < 20_000 else 1


def build_grid(nodes: Sequence[LayerNode], links: Sequence[LayerLink]) -> Grid:
    """Return the grid of a graph: nodes are assigned to layers, and links are divided into chains of cells."""
    rank = {node: place for place, node in enumerate(sorted(range(len(nodes)), key=lambda i: nodes[i].last))}
    layers = _layers(rank, links)
    cells = [
        Cell(layer, node.width / 2, node.width / 2 + node.beside, node.height, is_node=True)
        for node, layer in zip(nodes, layers, strict=True)
    ]
    trunks: dict[_Trunk, int] = {}
    chains = [_chain(link, cells, trunks) for link in links]
    return Grid(cells, chains, _in_order_of_visit(cells))


def _layers(rank: dict[int, int], links: Sequence[LayerLink]) -> list[int]:
    """Return the layer of each node.

    Each node is as high as its links allow, then moves down if this shortens its links. Nodes without links are last.
    """
    above: dict[int, set[int]] = {node: set() for node in rank}
    below: dict[int, set[int]] = {node: set() for node in rank}
    for link in links:
        upper, lower = sorted((link.source, link.target), key=rank.__getitem__)
        above[lower].add(upper)
        below[upper].add(lower)
    order = sorted(rank, key=rank.__getitem__)
    layer = [0] * len(rank)
    for node in order:
        layer[node] = max((layer[other] + 2 for other in above[node]), default=0)
    for node in reversed(order):
        if not below[node] and not above[node]:
            layer[node] = max(layer)
        elif len(below[node]) > len(above[node]):
            layer[node] = min(layer[other] for other in below[node]) - 2
    return layer


def _chain(link: LayerLink, cells: list[Cell], trunks: dict[_Trunk, int]) -> list[int]:
    start, end = cells[link.source].layer, cells[link.target].layer
    step = 1 if end > start else -1
    chain = [link.source]
    for layer in range(start + step, end, step):
        labelled = layer == start + step and link.height > 0
        chain.append(_label(link, layer, cells) if labelled else _bend(link, step, layer, cells, trunks))
    chain.append(link.target)
    short = abs(end - start) == 2
    for one, other in pairwise(chain):
        _connect(cells, one, other, step, link.weight * (1.0 if not short else 4.0 if step > 0 else 2.0))
    return chain


def _label(link: LayerLink, layer: int, cells: list[Cell]) -> int:
    half = link.width / 2 + LABEL_GAP
    cells.append(Cell(layer, half, half, link.height))
    return len(cells) - 1


def _bend(link: LayerLink, step: int, layer: int, cells: list[Cell], trunks: dict[_Trunk, int]) -> int:
    key = (link.target, link.meant, step, layer)
    if key not in trunks:
        trunks[key] = len(cells)
        cells.append(Cell(layer, 0.0, 0.0, 0.0, bend=True))
    return trunks[key]


def _connect(cells: list[Cell], one: int, other: int, step: int, weight: float) -> None:
    upper, lower = (one, other) if step > 0 else (other, one)
    lines = cells[one].bend + cells[other].bend
    cells[upper].down[lower] = cells[lower].up[upper] = weight * (1.0, 2.0, 8.0)[lines]


def _in_order_of_visit(cells: list[Cell]) -> list[list[int]]:
    """Return each layer's cells in the order in which a walk along connections, from the first node, reaches them."""
    layers: list[list[int]] = [[] for _ in range(1 + max((cell.layer for cell in cells), default=-1))]
    seen: set[int] = set()
    for root in range(len(cells)):
        stack = [root]
        while stack:
            here = stack.pop()
            if here not in seen:
                seen.add(here)
                layers[cells[here].layer].append(here)
                stack.extend(reversed([*cells[here].down, *cells[here].up]))
    return layers


SMALL = 400
"""Largest number of cells for which the slower, more thorough methods are used."""


def order_cells(grid: Grid) -> None:
    """Reorder the layers of the grid to reduce crossings; the best order is kept, and the first of equal orders."""
    rounds = effort(grid) + 4 * (len(grid.cells) <= SMALL)
    best, fewest = [list(layer) for layer in grid.layers], _crossings(grid)
    for number in range(2 * rounds):
        if fewest == 0:
            break
        _sweep(grid, downwards=number % 2 == 0)
        if len(grid.cells) <= SMALL:
            _exchange(grid)
        crossings = _crossings(grid)
        if crossings < fewest:
            best, fewest = [list(layer) for layer in grid.layers], crossings
    grid.layers[:] = best


def _sweep(grid: Grid, *, downwards: bool) -> None:
    layers = grid.layers[1:] if downwards else grid.layers[-2::-1]
    position = _positions(grid.layers)
    for layer in layers:
        keys = {}
        for cell in layer:
            fixed = _neighbours(grid.cells[cell], downwards=downwards)
            keys[cell] = sum(position[n] for n in fixed) / len(fixed) if fixed else position[cell]
        layer.sort(key=keys.__getitem__)
        for place, cell in enumerate(layer):
            position[cell] = place


def _neighbours(cell: Cell, *, downwards: bool) -> dict[int, float]:
    return cell.up if downwards else cell.down


def _positions(layers: Iterable[list[int]]) -> dict[int, int]:
    return {cell: place for layer in layers for place, cell in enumerate(layer)}


def _exchange(grid: Grid) -> None:
    """Exchange neighbouring cells in a layer while an exchange reduces the number of crossings."""
    position = _positions(grid.layers)
    for layer in grid.layers:
        for place in range(len(layer) - 1):
            one, other = layer[place], layer[place + 1]
            if _between(grid, one, other, position) > _between(grid, other, one, position):
                layer[place], layer[place + 1] = other, one
                position[one], position[other] = place + 1, place


def _between(grid: Grid, left: int, right: int, position: dict[int, int]) -> int:
    """Return the number of crossings between the connections of two cells if `left` is left of `right`."""
    count = 0
    for downwards in (True, False):
        others = [position[n] for n in _neighbours(grid.cells[right], downwards=downwards)]
        own = [position[n] for n in _neighbours(grid.cells[left], downwards=downwards)]
        count += sum(1 for place in own for other in others if place > other)
    return count


def _crossings(grid: Grid) -> int:
    position = _positions(grid.layers)
    return sum(_inversions(grid, layer, position) for layer in grid.layers[:-1])


def _inversions(grid: Grid, layer: list[int], position: dict[int, int]) -> int:
    """Return the number of crossings below a layer: pairs of connections whose lower ends are in opposite order."""
    count = 0
    before: list[int] = []
    for end in (end for cell in layer for end in sorted(position[n] for n in grid.cells[cell].down)):
        count += len(before) - bisect_right(before, end)
        insort(before, end)
    return count
