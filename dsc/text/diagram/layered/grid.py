"""Nodes in layers, and links broken into cells, one for each layer they pass.

Nodes stand in even layers, labels in odd ones, so that every label has a place of its own. A link's label is in
the layer next to its source; from there it joins the trunk of its target: all links that come to a node from
the same side share one line. Links against the order of the nodes lead upwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from dsc.text.diagram.layered.graph import Link, Node

LABEL_GAP = 4.0
"""Free space around a label's text."""

_Trunk = tuple[int, str, int, int]
"""What links to one target share in a layer: the target, what is meant inside it, the direction, the layer."""


@dataclass(slots=True)
class Cell:
    """Something with a place in a layer: a node, a label, or a line that passes.

    Attributes:
        layer: its layer, counted from the top.
        left, right: how far it reaches from its axis.
        height: how high it is.
        is_node, bend: a node; or only a line.
        up, down: the cells it is connected with in the layers above and below, and how much it matters
            that the connection is straight.
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
    """The cells (the nodes come first), the chain of cells of each link, and the order in each layer."""

    cells: list[Cell]
    chains: list[list[int]]
    layers: list[list[int]]


def effort(grid: Grid) -> int:
    """How many rounds of improvement a drawing of that size gets, so that none takes more than seconds."""
    size = len(grid.cells)
    return 8 if size < 3_000 else 4 if size < 20_000 else 1


def build_grid(nodes: Sequence[Node], links: Sequence[Link]) -> Grid:
    """Put nodes into layers and break links into chains of cells."""
    rank = {node: place for place, node in enumerate(sorted(range(len(nodes)), key=lambda i: nodes[i].last))}
    layers = _layers(rank, links)
    cells = [
        Cell(layer, node.width / 2, node.width / 2 + node.beside, node.height, is_node=True)
        for node, layer in zip(nodes, layers, strict=True)
    ]
    trunks: dict[_Trunk, int] = {}
    chains = [_chain(link, cells, trunks) for link in links]
    return Grid(cells, chains, _in_order_of_visit(cells))


def _layers(rank: dict[int, int], links: Sequence[Link]) -> list[int]:
    """Every node as high as its links allow, then down where its links get shorter; lone ones last."""
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


def _chain(link: Link, cells: list[Cell], trunks: dict[_Trunk, int]) -> list[int]:
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


def _label(link: Link, layer: int, cells: list[Cell]) -> int:
    half = link.width / 2 + LABEL_GAP
    cells.append(Cell(layer, half, half, link.height))
    return len(cells) - 1


def _bend(link: Link, step: int, layer: int, cells: list[Cell], trunks: dict[_Trunk, int]) -> int:
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
    """The layers in the order in which a walk along the connections, from the first node on, meets the cells."""
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
