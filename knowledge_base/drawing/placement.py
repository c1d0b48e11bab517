"""Placement of a picture's cards: networkx places them by distance in the graph, then overlaps are removed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import dist

import networkx as nx

from knowledge_base.drawing.picture import Arrow, Card, Picture

LINE = 16.0
"""Pixels between two lines of text; other lengths are in pixels too."""
CHARACTER = 7.0
PADDING = 10.0
GAP = 46.0
"""Space between two cards, for arrows and their labels."""
HOP = 170.0
"""Average distance of neighbours' centres, before cards are pushed apart."""
ROW = 1400.0
"""Width of a picture after which further connected parts go into another row."""
FINE = 60
"""Maximum number of cards for the layout by Kamada and Kawai (1989), which is finer and slower than springs."""

Point = tuple[float, float]


@dataclass(slots=True)
class Placed:
    """A card with its centre and its size."""

    card: Card
    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True, slots=True)
class Arranged:
    """A picture with positions between (0, 0) and (width, height)."""

    cards: Mapping[str, Placed]
    links: tuple[Arrow, ...]
    width: float
    height: float
    left_out: int


def arranged(scene: Picture) -> Arranged:
    """Return positions for all cards; the same picture always gets the same ones."""
    graph: nx.Graph[str] = nx.Graph()
    graph.add_nodes_from(card.key for card in scene.cards)
    graph.add_edges_from((link.source, link.target) for link in scene.links)
    cards = {card.key: card for card in scene.cards}
    order = {key: number for number, key in enumerate(cards)}
    parts = [sorted(part, key=order.__getitem__) for part in nx.connected_components(graph)]
    parts.sort(key=lambda part: (-len(part), order[part[0]]))
    placed = [_part(graph, [cards[key] for key in part]) for part in parts]
    width, height = _in_rows(placed)
    found = {one.card.key: one for part in placed for one in part}
    return Arranged({key: found[key] for key in cards}, scene.links, width, height, scene.left_out)


def _part(graph: nx.Graph[str], cards: list[Card]) -> list[Placed]:
    """Return the cards of one connected part, its upper left corner at (0, 0)."""
    own: nx.Graph[str] = nx.Graph()  # positions depend on the order of the cards
    own.add_nodes_from(card.key for card in cards)
    own.add_edges_from(sorted(graph.subgraph([card.key for card in cards]).edges))
    positions = _positions(own)
    lengths = [dist(positions[one], positions[other]) for one, other in own.edges if one != other]
    scale = HOP * len(lengths) / sum(lengths) if lengths else 1.0
    placed = [_placed(card, positions[card.key], scale) for card in cards]
    _push_apart(placed)
    left = min(one.x - one.width / 2 for one in placed)
    top = min(one.y - one.height / 2 for one in placed)
    for one in placed:
        one.x, one.y = round(one.x - left, 1), round(one.y - top, 1)
    return placed


def _positions(graph: nx.Graph[str]) -> Mapping[str, Sequence[float]]:
    if len(graph) == 1:
        return dict.fromkeys(graph, (0.0, 0.0))
    found = nx.kamada_kawai_layout(graph) if len(graph) <= FINE else nx.spring_layout(graph, seed=1, iterations=100)
    return {key: (float(x), float(y)) for key, (x, y) in found.items()}


def _placed(card: Card, at: Sequence[float], scale: float) -> Placed:
    texts = (card.title, card.kind, *card.lines)
    width = max(map(len, texts)) * CHARACTER + 2 * PADDING
    lines = 1 + bool(card.kind) + len(card.lines)
    return Placed(card, at[0] * scale, at[1] * scale, width, lines * LINE + 2 * PADDING - 4)


def _push_apart(placed: list[Placed], rounds: int = 300) -> None:
    """Move cards that are too close along the axis with the smaller overlap, until none are."""
    for _ in range(rounds):
        moved = False
        for i, one in enumerate(placed):
            for other in placed[i + 1 :]:
                moved = _part_two(one, other) or moved
        if not moved:
            return


def _part_two(one: Placed, other: Placed) -> bool:
    dx, dy = other.x - one.x, other.y - one.y
    across = (one.width + other.width) / 2 + GAP - abs(dx)
    down = (one.height + other.height) / 2 + GAP * 0.7 - abs(dy)
    if across <= 0.01 or down <= 0.01:
        return False
    if across < down:
        step = across / 2 if dx >= 0 else -across / 2
        one.x, other.x = one.x - step, other.x + step
    else:
        step = down / 2 if dy >= 0 else -down / 2
        one.y, other.y = one.y - step, other.y + step
    return True


def _in_rows(parts: Iterable[list[Placed]]) -> Point:
    """Place the parts in rows; return the size of the whole."""
    x = y = row_height = width = 0.0
    for part in parts:
        own_width = max(one.x + one.width / 2 for one in part)
        own_height = max(one.y + one.height / 2 for one in part)
        if x and x + own_width > ROW:
            x, y, row_height = 0.0, y + row_height + GAP, 0.0
        for one in part:
            one.x, one.y = one.x + x, one.y + y
        x, row_height = x + own_width + GAP, max(row_height, own_height)
        width = max(width, x - GAP)
    return width, y + row_height
