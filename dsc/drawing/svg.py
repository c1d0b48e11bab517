"""Writer of drawings as SVG; the colours suit readers with red-green colour blindness (Okabe and Ito 2008)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from math import hypot
from types import MappingProxyType

from dsc.drawing.layout import BOLD, FONT_SIZES, Box, BoxKind, DrawnEdge, Text
from knowledge_base import svg

MARGIN = 12.0
RADIUS = 7.0

_SIZE = re.compile(r'width="([\d.]+)" height="([\d.]+)"')
NO_MARKS: Mapping[str, str] = MappingProxyType({})

_RULE = svg.PINK[1]
_LOOKS: dict[BoxKind, tuple[str, str]] = {
    BoxKind.PLOT: ("#ffffff", "#cbd5e1"),
    BoxKind.GENERATED: svg.GREEN,
    BoxKind.SIMPLE: ("#ffffff", "#475569"),
    BoxKind.COMPOSITE: svg.GREY,
    BoxKind.ORTHOGONAL: svg.GREY,
    BoxKind.SUBMACHINE: svg.BLUE,
    BoxKind.DYNAMIC: svg.ORANGE,
    BoxKind.CHOICE: ("#eef2f7", "#475569"),
    BoxKind.NOTE: ("#fdf1f6", "#e3b5cb"),
}
"""Colours of fill and border, by kind of box."""
MARKS = {"active": "#d55e00", "added": "#0072b2", "removed": "#a3195b", "changed": "#b8860b"}
"""Colour of each mark of a state."""


def to_svg(root: Box, marks: Mapping[str, str] = NO_MARKS) -> str:
    """Return the drawing as one SVG document with a background; `marks` contains the marks by state name."""
    moved = root.moved(MARGIN, MARGIN)
    body = (*_box(moved, "#ffffff"), *_marked(moved, marks))
    return svg.document(root.name, root.width + 2 * MARGIN, root.height + 2 * MARGIN, _css(), body)


def above(upper: str, lower: str) -> str:
    """Return one SVG document with the drawing `upper` above the drawing `lower`."""
    sizes = [tuple(map(float, _SIZE.search(drawn).groups())) for drawn in (upper, lower)]  # type: ignore[union-attr]
    width, height = max(w for w, _ in sizes), sizes[0][1] + MARGIN + sizes[1][1]
    moved = lower.replace("<svg ", f'<svg y="{svg.number(sizes[0][1] + MARGIN)}" ', 1)
    size = f'width="{svg.number(width)}" height="{svg.number(height)}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n{upper}{moved}</svg>\n'


def _css() -> str:
    sizes = "".join(
        f".{style}{{font-size:{svg.number(size)}px;{'font-weight:bold;' * (style in BOLD)}}}"
        for style, size in FONT_SIZES.items()
    )
    colours = (
        f".title,.name{{fill:{svg.INK}}}.about{{fill:{svg.SOFT};font-style:italic}}.detail,.label{{fill:{svg.DETAIL}}}"
        f".rule{{fill:{_RULE}}}{svg.EDGES}.edge.by-rule{{stroke:{_RULE}}}"
        f".head{{fill:{svg.SOFT}}}.head.by-rule{{fill:{_RULE}}}.mid{{text-anchor:middle}}"
    )
    return f"text{{{svg.FONTS}}}{sizes}{colours}"


def _box(box: Box, around: str) -> Iterator[str]:
    """Yield the elements of a box and its content, from back to front."""
    fill, stroke = svg.PINK if box.rule else _LOOKS.get(box.kind, (around, svg.SOFT))
    yield f'<g class="{box.kind}">'
    if box.title:
        yield f"<title>{svg.escaped(box.title)}</title>"
    yield from _shape(box, fill, stroke)
    yield from (_text(text) for text in box.texts)
    yield from _separators(box.boxes, stroke)
    yield "</g>"
    names = {inner.name for inner in box.boxes}
    flat = [edge for edge in box.edges if names.issuperset((edge.source, edge.target))]
    over = [edge for edge in box.edges if not names.issuperset((edge.source, edge.target))]
    # Lines are below labels, and lines of rules are below all other lines, which therefore stay visible.
    for edge in sorted(flat, key=lambda one: not one.rule):
        yield from _edge(edge)
    for edge in flat:
        yield from _label(edge, fill)
    for inner in box.boxes:
        yield from _box(inner, fill)
    # Edges into inner boxes are above the inner boxes.
    for edge in over:
        yield from _edge(edge)
    for edge in over:
        yield from _label(edge, fill)


def _marked(box: Box, marks: Mapping[str, str]) -> Iterator[str]:
    """Yield a thick border for each marked state; these borders are above all other elements."""
    for inner in box.boxes:
        mark = marks.get(inner.name)
        if mark is not None:
            area = svg.area(inner.x - 3, inner.y - 3, inner.width + 6, inner.height + 6)
            border = f'fill="none" stroke="{MARKS[mark]}" stroke-width="3.5"'
            yield f'<rect class="{mark}" {area} rx="12" {border}/>'
        yield from _marked(inner, marks)


def _shape(box: Box, fill: str, stroke: str) -> Iterator[str]:
    if box.kind in {BoxKind.REGION, BoxKind.FINAL, BoxKind.HISTORY}:
        return
    centre = f'cx="{svg.number(box.x + box.width / 2)}" cy="{svg.number(box.y + box.height / 2)}"'
    radius = svg.number(box.height / 2)
    if box.kind is BoxKind.INITIAL:
        yield f'<circle {centre} r="{radius}" fill="{svg.INK}"/>'
    elif box.kind is BoxKind.CIRCLE:
        yield f'<circle {centre} r="{radius}" fill="#ffffff" stroke="{svg.INK}" stroke-width="1.4"/>'
    elif box.kind is BoxKind.BULLSEYE:
        yield f'<circle {centre} r="9" fill="#ffffff" stroke="{svg.INK}" stroke-width="1.6"/>'
        yield f'<circle {centre} r="5" fill="{svg.INK}"/>'
    elif box.kind is BoxKind.CHOICE:
        yield _diamond(box, fill, stroke)
    else:
        dash = ' stroke-dasharray="6 4"' if box.kind is BoxKind.DYNAMIC else ""
        thick = "1" if box.kind in {BoxKind.PLOT, BoxKind.NOTE} else "1.6"
        yield _rect(box, fill, f'stroke="{stroke}" stroke-width="{thick}"{dash}')
        yield from (_across(box, y, stroke) for y in box.lines)
        yield from _mark(box, stroke)


def _rect(box: Box, fill: str, border: str) -> str:
    area = svg.area(box.x, box.y, box.width, box.height)
    radius = 4 if box.kind is BoxKind.NOTE else 10
    return f'<rect {area} rx="{radius}" fill="{fill}" {border}/>'


def _diamond(box: Box, fill: str, stroke: str) -> str:
    x, y = box.x + box.width / 2, box.y + box.height / 2
    corners = [(x, box.y), (box.x + box.width, y), (x, box.y + box.height), (box.x, y)]
    points = "L".join(map(svg.point, corners))
    return f'<path d="M{points}Z" fill="{fill}" stroke="{stroke}" stroke-width="1.6" stroke-linejoin="round"/>'


def _across(box: Box, y: float, stroke: str) -> str:
    return f'<line {svg.ends((box.x, y), (box.x + box.width, y))} stroke="{stroke}" stroke-opacity="0.45"/>'


def _mark(box: Box, stroke: str) -> Iterator[str]:
    """Yield the symbol of a submachine state (two linked states) or a dynamic state (a branching path)."""
    x, y = box.x + box.width - 30, box.y + 15
    style = f'fill="none" stroke="{stroke}" stroke-width="1.4"'
    if box.kind is BoxKind.SUBMACHINE:
        yield f'<rect {svg.area(x, y - 3.5, 8, 7)} rx="2.5" {style}/>'
        yield f'<rect {svg.area(x + 12, y - 3.5, 8, 7)} rx="2.5" {style}/>'
        yield f"<line {svg.ends((x + 8, y), (x + 12, y))} {style}/>"
    elif box.kind is BoxKind.DYNAMIC:
        points = f"M{svg.point((x, y))}h6M{svg.point((x + 18, y - 5))}l-6 0l-6 5l6 5l6 0"
        yield f'<path d="{points}" {style}/>'


def _separators(boxes: Iterable[Box], stroke: str) -> Iterator[str]:
    """Yield the dashed lines between neighbouring regions."""
    regions = [box for box in boxes if box.kind is BoxKind.REGION]
    for one, other in pairwise(regions):
        end = (other.x, other.y + other.height) if other.x > one.x else (other.x + other.width, other.y)
        yield f'<line {svg.ends((other.x, other.y), end)} stroke="{stroke}" stroke-dasharray="7 5"/>'


def _text(text: Text) -> str:
    classes = f"{text.style} mid" if text.centred else text.style
    return f'<text class="{classes}" x="{svg.number(text.x)}" y="{svg.number(text.y)}">{svg.escaped(text.text)}</text>'


def _edge(edge: DrawnEdge) -> Iterator[str]:
    by_rule = " by-rule" * edge.rule
    *points, before, end = edge.points
    base, head = svg.arrowhead(before, end)
    yield f'<path class="edge{by_rule}" d="{_path([*points, before, base])}"/>'
    yield f'<path class="head{by_rule}" d="{head}"/>'


def _label(edge: DrawnEdge, fill: str) -> Iterator[str]:
    if edge.area is None:
        return
    x, y, width, height = edge.area
    area = svg.area(x - 3, y - 1, width + 6, height + 2)
    yield f'<g class="transition"><title>{svg.escaped(edge.title)}</title>'
    yield f'<rect {area} rx="4" fill="{fill}" fill-opacity="0.92"/>'
    yield from (_text(text) for text in edge.label)
    yield "</g>"


def _path(points: list[svg.Point]) -> str:
    """Return the SVG path of a polyline with round corners."""
    path = [f"M{svg.point(points[0])}"]
    for (x0, y0), (x1, y1), (x2, y2) in zip(points, points[1:], points[2:], strict=False):
        before, after = hypot(x1 - x0, y1 - y0), hypot(x2 - x1, y2 - y1)
        radius = min(RADIUS, before / 2, after / 2)
        start = (x1 + (x0 - x1) * radius / (before or 1), y1 + (y0 - y1) * radius / (before or 1))
        stop = (x1 + (x2 - x1) * radius / (after or 1), y1 + (y2 - y1) * radius / (after or 1))
        path.append(f"L{svg.point(start)}Q{svg.point((x1, y1))} {svg.point(stop)}")
    return "".join([*path, f"L{svg.point(points[-1])}"])
