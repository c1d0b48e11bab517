"""Positions of the cards of a picture, and the picture as SVG.

networkx places the cards by their distance in the graph; then overlaps are removed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import dist, hypot

import networkx as nx

from knowledge_base import svg
from knowledge_base.drawing.picture import Arrow, Card, Label, Picture

LINE = 16.0
"""Distance between two lines of text in pixels; all lengths are in pixels."""
CHARACTER = 7.0
PADDING = 10.0
GAP = 46.0
"""Space between two cards for arrows and their labels."""
HOP = 170.0
"""Average distance of the centres of neighbours, before cards are moved apart."""
ROW = 1400.0
"""Width of a picture after which further connected parts are placed in another row."""
FINE = 60
"""Maximum number of cards for the layout by Kamada and Kawai (1989), which is better but slower than springs."""


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
    omitted: int


def arranged(scene: Picture) -> Arranged:
    """Return positions for all cards; equal pictures have equal positions."""
    graph: nx.Graph[str] = nx.Graph()
    graph.add_nodes_from(card.key for card in scene.cards)
    graph.add_edges_from((link.source, link.target) for link in scene.links)
    cards = {card.key: card for card in scene.cards}
    order = {key: index for index, key in enumerate(cards)}
    parts = [sorted(part, key=order.__getitem__) for part in nx.connected_components(graph)]
    parts.sort(key=lambda part: (-len(part), order[part[0]]))
    placed = [_part(graph, [cards[key] for key in part]) for part in parts]
    width, height = _in_rows(placed)
    found = {one.card.key: one for part in placed for one in part}
    return Arranged({key: found[key] for key in cards}, scene.links, width, height, scene.omitted)


def _part(graph: nx.Graph[str], cards: list[Card]) -> list[Placed]:
    """Return the cards of one connected part, with its upper left corner at (0, 0)."""
    own: nx.Graph[str] = nx.Graph()  # positions depend on the order of the cards
    own.add_nodes_from(card.key for card in cards)
    own.add_edges_from(sorted(graph.subgraph([card.key for card in cards]).edges))
    positions = _positions(own)
    lengths = [dist(positions[one], positions[other]) for one, other in own.edges if one != other]
    scale = HOP * len(lengths) / sum(lengths) if lengths else 1.0
    placed = [_place(card, positions[card.key], scale) for card in cards]
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


def _place(card: Card, at: Sequence[float], scale: float) -> Placed:
    texts = (card.title, card.kind, *(line.text for line in card.lines))
    width = max(map(len, texts)) * CHARACTER + 2 * PADDING
    lines = 1 + bool(card.kind) + len(card.lines)
    return Placed(card, at[0] * scale, at[1] * scale, width, lines * LINE + 2 * PADDING - 4)


def _push_apart(placed: list[Placed]) -> None:
    """Move cards that are too close to each other along the axis with the smaller overlap, until no cards are."""
    for _ in range(300):  # a bound for cards that push each other back and forth
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


def _in_rows(parts: Iterable[list[Placed]]) -> svg.Point:
    """Place the parts in rows; return the width and height of the whole picture."""
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


MARGIN = 16.0
_COLOURS = (svg.BLUE, svg.ORANGE, svg.GREEN, svg.PINK, svg.VIOLET, svg.GREY)
"""Fill and border colour for each type; further types share the last pair."""
_RELATION = ("#ffffff", svg.SOFT)
_STYLE = (
    f"text{{{svg.FONTS};font-size:12px}}"
    f".name{{font-weight:bold;fill:{svg.INK}}}.kind{{fill:{svg.SOFT};font-style:italic}}.line{{fill:{svg.DETAIL}}}"
    f"{svg.EDGES}.head{{fill:{svg.SOFT}}}"
    f".label{{fill:{svg.DETAIL};text-anchor:middle;paint-order:stroke;stroke:#ffffff;stroke-width:4px;font-size:11px}}"
    ".mid{text-anchor:middle}.arcs{font-size:11px}"
)


def to_svg(picture: Arranged) -> str:
    """Return the picture as one SVG document with an opaque background."""
    note = f"{picture.omitted} more things are not drawn" if picture.omitted else ""
    inks = _inks(picture)
    width, height = picture.width + 2 * MARGIN, picture.height + 2 * MARGIN + LINE * (bool(note) + bool(inks))
    width = max(width, len(note) * 7 + 2 * MARGIN, sum(map(len, inks)) * 7 + 16 * len(inks) + 2 * MARGIN)
    colours = _colours(picture)
    body = [
        *(line for link in picture.links for line in _arrow(link, picture, inks)),
        *(line for one in picture.cards.values() for line in _card(one, colours, inks)),
        *(line for link in picture.links for line in _label(link, picture, inks)),
    ]
    if inks:
        kinds = "   ".join(_label_text(Label(kind, kind), inks) for kind in inks)
        at = f'x="{svg.number(MARGIN)}" y="{svg.number(height - MARGIN / 2 - LINE * bool(note))}"'
        body.append(f'<text class="arcs" xml:space="preserve" {at}>{kinds}</text>')
    if note:
        body.append(f'<text class="kind" x="{svg.number(MARGIN)}" y="{svg.number(height - MARGIN / 2)}">{note}</text>')
    return svg.document("world graph", width, height, _STYLE, body)


def _colours(picture: Arranged) -> dict[str, tuple[str, str]]:
    kinds = dict.fromkeys(one.card.kind for one in picture.cards.values() if one.card.kind)
    return {kind: _COLOURS[min(index, len(_COLOURS) - 1)] for index, kind in enumerate(kinds)}


def _inks(picture: Arranged) -> dict[str, str]:
    """Return the colour of each kind of arc; empty unless there are several kinds (S4.17)."""
    labels = [label for link in picture.links for label in link.labels]
    labels += [line for one in picture.cards.values() for line in one.card.lines]
    kinds = dict.fromkeys(
        kind for kind in (*(one.kind for one in labels), *(c.card.of for c in picture.cards.values())) if kind
    )
    if len(kinds) < 2:
        return {}
    return {kind: _COLOURS[min(index, len(_COLOURS) - 1)][1] for index, kind in enumerate(kinds)}


def _label_text(label: Label, inks: dict[str, str]) -> str:
    """Return a label as the content of a text in the colour of its kind."""
    text = svg.escaped(label.text)
    return f'<tspan fill="{inks[label.kind]}">{text}</tspan>' if label.kind in inks else text


def _card(one: Placed, colours: dict[str, tuple[str, str]], inks: dict[str, str]) -> Iterator[str]:
    fill, stroke = colours.get(one.card.kind, (_RELATION[0], inks.get(one.card.of, _RELATION[1])))
    x, y = one.x - one.width / 2 + MARGIN, one.y - one.height / 2 + MARGIN
    thick = 3 if one.card.middle else 1.4
    dashes = "" if one.card.kind else ' stroke-dasharray="4 3"'
    area = svg.area(x, y, one.width, one.height)
    yield f'<rect {area} rx="7" fill="{fill}" stroke="{stroke}" stroke-width="{thick}"{dashes}/>'
    texts = [
        ("name", Label(one.card.title)),
        ("kind", Label(one.card.kind)),
        *(("line", line) for line in one.card.lines),
    ]
    middle = svg.number(one.x + MARGIN)
    for line, (style, label) in enumerate(t for t in texts if t[1].text):
        height = svg.number(y + PADDING + 8 + line * LINE)
        yield f'<text class="{style} mid" x="{middle}" y="{height}">{_label_text(label, inks)}</text>'


def _arrow(link: Arrow, picture: Arranged, inks: dict[str, str]) -> Iterator[str]:
    start, end = _ends(link, picture)
    if dist(start, end) >= 1:
        base, head = svg.arrowhead(start, end)
        kinds = {label.kind for label in link.labels}
        ink = inks.get(kinds.pop()) if len(kinds) == 1 else None
        line, point = (f' style="stroke:{ink}"', f' style="fill:{ink}"') if ink else ("", "")
        yield f'<path class="edge"{line} d="M{svg.point(start)}L{svg.point(base)}"/>'
        yield f'<path class="head"{point} d="{head}"/>'


def _label(link: Arrow, picture: Arranged, inks: dict[str, str]) -> Iterator[str]:
    (x1, y1), (x2, y2) = _ends(link, picture)
    text = ", ".join(_label_text(label, inks) for label in link.labels)
    along = 0.3 if _is_both_ways(link, picture) else 0.5  # the labels of two opposite arrows must not overlap
    x, y = x1 + (x2 - x1) * along, y1 + (y2 - y1) * along
    yield f'<text class="label" x="{svg.number(x)}" y="{svg.number(y + 4)}">{text}</text>'


def _ends(link: Arrow, picture: Arranged) -> tuple[svg.Point, svg.Point]:
    """Return both ends of an arrow at the borders of its cards; opposite arrows are moved apart."""
    source, target = picture.cards[link.source], picture.cards[link.target]
    dx, dy = target.x - source.x, target.y - source.y
    length = hypot(dx, dy) or 1.0
    aside = 7.0 * _is_both_ways(link, picture)
    ox, oy = -dy / length * aside + MARGIN, dx / length * aside + MARGIN
    start, end = _border(source, dx, dy), _border(target, -dx, -dy)
    return (start[0] + ox, start[1] + oy), (end[0] + ox, end[1] + oy)


def _is_both_ways(link: Arrow, picture: Arranged) -> bool:
    return any(other.source == link.target and other.target == link.source for other in picture.links)


def _border(one: Placed, dx: float, dy: float) -> svg.Point:
    """Return the point at which a line from the centre of the card in that direction crosses its border."""
    share = min(
        one.width / 2 / abs(dx) if dx else float("inf"),
        one.height / 2 / abs(dy) if dy else float("inf"),
        1.0,
    )
    return one.x + dx * share, one.y + dy * share
