"""Rendering of an arranged picture as SVG, with colours for colour-blind readers (Okabe and Ito 2008)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import escape
from math import hypot

from knowledge_base.drawing.picture import Arrow
from knowledge_base.drawing.placement import LINE, PADDING, Arranged, Placed

MARGIN = 16.0
ARROW = (9.0, 3.6)
"""Length and half width of an arrowhead."""
_INK, _SOFT = "#1f2937", "#64748b"
_COLOURS = (
    ("#e3f0fb", "#0064a8"),
    ("#fff3d6", "#b35c00"),
    ("#effaf6", "#00795a"),
    ("#fbe8f1", "#a3195b"),
    ("#f3effc", "#5b3fa0"),
    ("#f6f8fb", "#475569"),
)
"""Fill and border, a pair for each type; further types share the last one."""
_RELATION = ("#ffffff", "#64748b")
_FORBIDDEN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


def to_svg(picture: Arranged) -> str:
    """Return the picture as one SVG document with an opaque background."""
    note = f"{picture.left_out} more things are not drawn" if picture.left_out else ""
    width, height = picture.width + 2 * MARGIN, picture.height + 2 * MARGIN + LINE * bool(note)
    width = max(width, len(note) * 7 + 2 * MARGIN)
    colours = _colours(picture)
    body = [
        *(line for link in picture.links for line in _arrow(link, picture)),
        *(line for one in picture.cards.values() for line in _card(one, colours)),
        *(line for link in picture.links for line in _label(link, picture)),
    ]
    if note:
        body.append(f'<text class="kind" x="{_n(MARGIN)}" y="{_n(height - MARGIN / 2)}">{note}</text>')
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_n(width)}" height="{_n(height)}" '
        f'viewBox="0 0 {_n(width)} {_n(height)}" role="img">\n<title>world graph</title>\n<style>{_css()}</style>\n'
        f'<rect width="{_n(width)}" height="{_n(height)}" rx="10" fill="#ffffff"/>\n' + "\n".join(body) + "\n</svg>\n"
    )


def _css() -> str:
    return (
        "text{font-family:Inter,'Segoe UI','Helvetica Neue',Arial,'DejaVu Sans',sans-serif;font-size:12px}"
        f".name{{font-weight:bold;fill:{_INK}}}.kind{{fill:{_SOFT};font-style:italic}}.line{{fill:#334155}}"
        f".edge{{fill:none;stroke:{_SOFT};stroke-width:1.4}}.head{{fill:{_SOFT}}}"
        ".label{fill:#334155;text-anchor:middle;paint-order:stroke;stroke:#ffffff;stroke-width:4px;font-size:11px}"
        ".mid{text-anchor:middle}"
    )


def _colours(picture: Arranged) -> dict[str, tuple[str, str]]:
    kinds = dict.fromkeys(one.card.kind for one in picture.cards.values() if one.card.kind)
    return {kind: _COLOURS[min(number, len(_COLOURS) - 1)] for number, kind in enumerate(kinds)}


def _card(one: Placed, colours: dict[str, tuple[str, str]]) -> Iterator[str]:
    fill, stroke = colours.get(one.card.kind, _RELATION)
    x, y = one.x - one.width / 2 + MARGIN, one.y - one.height / 2 + MARGIN
    thick = 3 if one.card.middle else 1.4
    dashes = "" if one.card.kind else ' stroke-dasharray="4 3"'
    yield (
        f'<rect x="{_n(x)}" y="{_n(y)}" width="{_n(one.width)}" height="{_n(one.height)}" rx="7" fill="{fill}" '
        f'stroke="{stroke}" stroke-width="{thick}"{dashes}/>'
    )
    texts = [("name", one.card.title), ("kind", one.card.kind), *(("line", line) for line in one.card.lines)]
    for number, (style, text) in enumerate(t for t in texts if t[1]):
        middle = _n(one.x + MARGIN)
        yield f'<text class="{style} mid" x="{middle}" y="{_n(y + PADDING + 8 + number * LINE)}">{_x(text)}</text>'


def _arrow(link: Arrow, picture: Arranged) -> Iterator[str]:
    (x1, y1), (x2, y2) = _ends(link, picture)
    length = hypot(x2 - x1, y2 - y1)
    if length < 1:
        return
    ux, uy = (x2 - x1) / length, (y2 - y1) / length
    long, half = ARROW
    bx, by = x2 - ux * long, y2 - uy * long
    yield f'<path class="edge" d="M{_n(x1)} {_n(y1)}L{_n(bx)} {_n(by)}"/>'
    corners = f"{_n(x2)},{_n(y2)} {_n(bx - uy * half)},{_n(by + ux * half)} {_n(bx + uy * half)},{_n(by - ux * half)}"
    yield f'<polygon class="head" points="{corners}"/>'


def _label(link: Arrow, picture: Arranged) -> Iterator[str]:
    (x1, y1), (x2, y2) = _ends(link, picture)
    along = 0.3 if _is_both_ways(link, picture) else 0.5  # the labels of an opposite pair must not meet
    x, y = x1 + (x2 - x1) * along, y1 + (y2 - y1) * along
    yield f'<text class="label" x="{_n(x)}" y="{_n(y + 4)}">{_x(link.label)}</text>'


def _ends(link: Arrow, picture: Arranged) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return both ends of an arrow at the cards' borders; opposite arrows are shifted apart."""
    source, target = picture.cards[link.source], picture.cards[link.target]
    dx, dy = target.x - source.x, target.y - source.y
    length = hypot(dx, dy) or 1.0
    aside = 7.0 * _is_both_ways(link, picture)
    ox, oy = -dy / length * aside + MARGIN, dx / length * aside + MARGIN
    start, end = _border(source, dx, dy), _border(target, -dx, -dy)
    return (start[0] + ox, start[1] + oy), (end[0] + ox, end[1] + oy)


def _is_both_ways(link: Arrow, picture: Arranged) -> bool:
    return any(other.source == link.target and other.target == link.source for other in picture.links)


def _border(one: Placed, dx: float, dy: float) -> tuple[float, float]:
    """Return the point where a line from the card's centre in that direction crosses its border."""
    share = min(
        one.width / 2 / abs(dx) if dx else float("inf"),
        one.height / 2 / abs(dy) if dy else float("inf"),
        1.0,
    )
    return one.x + dx * share, one.y + dy * share


def _n(number: float) -> str:
    return f"{number:.1f}".removesuffix(".0")


def _x(text: str) -> str:
    return escape(_FORBIDDEN.sub("\N{REPLACEMENT CHARACTER}", text))
