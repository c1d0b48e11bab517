"""SVG of a drawing. The colours suit readers with red-green colour blindness (Okabe and Ito 2008)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from html import escape
from itertools import pairwise
from math import hypot
from types import MappingProxyType

from dsc.drawing.layout import Box, BoxKind, DrawnEdge, Point, Text
from dsc.drawing.measure import BOLD, FONT_SIZES

MARGIN = 12.0
RADIUS = 7.0
ARROW = (9.0, 3.6)
"""Length and half width of an arrowhead."""

_SIZE = re.compile(r'width="([\d.]+)" height="([\d.]+)"')
NO_MARKS: Mapping[str, str] = MappingProxyType({})

_FORBIDDEN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
_INK, _SOFT = "#1f2937", "#64748b"
_RULE = "#a3195b"
_LOOKS: dict[BoxKind, tuple[str, str]] = {
    BoxKind.PLOT: ("#ffffff", "#cbd5e1"),
    BoxKind.GENERATED: ("#effaf6", "#00795a"),
    BoxKind.SIMPLE: ("#ffffff", "#475569"),
    BoxKind.COMPOSITE: ("#f6f8fb", "#475569"),
    BoxKind.ORTHOGONAL: ("#f6f8fb", "#475569"),
    BoxKind.SUBMACHINE: ("#e3f0fb", "#0064a8"),
    BoxKind.DYNAMIC: ("#fff3d6", "#b35c00"),
    BoxKind.CHOICE: ("#eef2f7", "#475569"),
    BoxKind.NOTE: ("#fdf1f6", "#e3b5cb"),
}
"""Fill and border of each kind."""
_RECOVERY = ("#fbe8f1", _RULE)


MARKS = {"active": "#d55e00", "added": "#0072b2", "removed": "#a3195b", "changed": "#b8860b"}
"""Marks of states, each with its colour."""


def to_svg(root: Box, marks: Mapping[str, str] = NO_MARKS) -> str:
    """Return the drawing as one SVG document with a background; `marks` are by names of states."""
    width, height = _n(root.width + 2 * MARGIN), _n(root.height + 2 * MARGIN)
    body = "\n".join((*_box(root.moved(MARGIN, MARGIN), "#ffffff"), *_marked(root.moved(MARGIN, MARGIN), marks)))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}" role="img">\n'
        f"<title>{_x(root.name)}</title>\n<style>{_css()}</style>\n"
        f'<rect width="{width}" height="{height}" rx="10" fill="#ffffff"/>\n{body}\n</svg>\n'
    )


def above(upper: str, lower: str) -> str:
    """Return two drawings as one, one above the other."""
    sizes = [tuple(map(float, _SIZE.search(svg).groups())) for svg in (upper, lower)]  # type: ignore[union-attr]
    width, height = max(w for w, _ in sizes), sizes[0][1] + MARGIN + sizes[1][1]
    moved = lower.replace("<svg ", f'<svg y="{_n(sizes[0][1] + MARGIN)}" ', 1)
    return f'<svg xmlns="http://www.w3.org/2000/svg" width="{_n(width)}" height="{_n(height)}">\n{upper}{moved}</svg>\n'


def _css() -> str:
    fonts = "text{font-family:Inter,'Segoe UI','Helvetica Neue',Arial,'DejaVu Sans',sans-serif}"
    sizes = "".join(
        f".{style}{{font-size:{_n(size)}px;{'font-weight:bold;' * (style in BOLD)}}}"
        for style, size in FONT_SIZES.items()
    )
    colours = (
        f".title,.name{{fill:{_INK}}}.about{{fill:{_SOFT};font-style:italic}}.detail,.label{{fill:#334155}}"
        f".rule{{fill:{_RULE}}}.edge{{fill:none;stroke:{_SOFT};stroke-width:1.4}}.edge.by-rule{{stroke:{_RULE}}}"
        f".head{{fill:{_SOFT}}}.head.by-rule{{fill:{_RULE}}}.mid{{text-anchor:middle}}"
    )
    return fonts + sizes + colours


def _box(box: Box, around: str) -> Iterator[str]:
    """Yield a box and its contents, from the back to the front."""
    fill, stroke = _RECOVERY if box.rule else _LOOKS.get(box.kind, (around, _SOFT))
    yield f'<g class="{box.kind}">'
    if box.title:
        yield f"<title>{_x(box.title)}</title>"
    yield from _shape(box, fill, stroke)
    yield from (_text(text) for text in box.texts)
    yield from _separators(box.boxes, stroke)
    yield "</g>"
    names = {inner.name for inner in box.boxes}
    flat = [edge for edge in box.edges if names.issuperset((edge.source, edge.target))]
    over = [edge for edge in box.edges if not names.issuperset((edge.source, edge.target))]
    # All lines are below all labels; where lines of rules cover others, the others stay visible.
    for edge in sorted(flat, key=lambda one: not one.rule):
        yield from _edge(edge)
    for edge in flat:
        yield from _label(edge, fill)
    for inner in box.boxes:
        yield from _box(inner, fill)
    # Edges into inner boxes are above these.
    for edge in over:
        yield from _edge(edge)
    for edge in over:
        yield from _label(edge, fill)


def _marked(box: Box, marks: Mapping[str, str]) -> Iterator[str]:
    """Yield a thick border around each marked state, above all other elements."""
    for inner in box.boxes:
        mark = marks.get(inner.name)
        if mark is not None:
            size = f'x="{_n(inner.x - 3)}" y="{_n(inner.y - 3)}" width="{_n(inner.width + 6)}"'
            border = f'fill="none" stroke="{MARKS[mark]}" stroke-width="3.5"'
            yield f'<rect class="{mark}" {size} height="{_n(inner.height + 6)}" rx="12" {border}/>'
        yield from _marked(inner, marks)


def _shape(box: Box, fill: str, stroke: str) -> Iterator[str]:
    if box.kind in {BoxKind.REGION, BoxKind.FINAL, BoxKind.HISTORY}:
        return
    centre = f'cx="{_n(box.x + box.width / 2)}" cy="{_n(box.y + box.height / 2)}"'
    if box.kind is BoxKind.INITIAL:
        yield f'<circle {centre} r="{_n(box.height / 2)}" fill="{_INK}"/>'
    elif box.kind is BoxKind.CIRCLE:
        yield f'<circle {centre} r="{_n(box.height / 2)}" fill="#ffffff" stroke="{_INK}" stroke-width="1.4"/>'
    elif box.kind is BoxKind.BULLSEYE:
        yield f'<circle {centre} r="9" fill="#ffffff" stroke="{_INK}" stroke-width="1.6"/>'
        yield f'<circle {centre} r="5" fill="{_INK}"/>'
    elif box.kind is BoxKind.CHOICE:
        yield _diamond(box, fill, stroke)
    else:
        dash = ' stroke-dasharray="6 4"' if box.kind is BoxKind.DYNAMIC else ""
        thick = "1" if box.kind in {BoxKind.PLOT, BoxKind.NOTE} else "1.6"
        yield _rect(box, fill, f'stroke="{stroke}" stroke-width="{thick}"{dash}')
        yield from (_across(box, y, stroke) for y in box.lines)
        yield from _mark(box, stroke)


def _rect(box: Box, fill: str, border: str) -> str:
    size = f'x="{_n(box.x)}" y="{_n(box.y)}" width="{_n(box.width)}" height="{_n(box.height)}"'
    radius = 4 if box.kind is BoxKind.NOTE else 10
    return f'<rect {size} rx="{radius}" fill="{fill}" {border}/>'


def _diamond(box: Box, fill: str, stroke: str) -> str:
    x, y = box.x + box.width / 2, box.y + box.height / 2
    corners = [(x, box.y), (box.x + box.width, y), (x, box.y + box.height), (box.x, y)]
    points = "L".join(map(_p, corners))
    return f'<path d="M{points}Z" fill="{fill}" stroke="{stroke}" stroke-width="1.6" stroke-linejoin="round"/>'


def _across(box: Box, y: float, stroke: str) -> str:
    line = f'x1="{_n(box.x)}" y1="{_n(y)}" x2="{_n(box.x + box.width)}" y2="{_n(y)}"'
    return f'<line {line} stroke="{stroke}" stroke-opacity="0.45"/>'


def _mark(box: Box, stroke: str) -> Iterator[str]:
    """Yield two linked states for a submachine state; a branching path for a dynamic state."""
    x, y = box.x + box.width - 30, box.y + 15
    style = f'fill="none" stroke="{stroke}" stroke-width="1.4"'
    if box.kind is BoxKind.SUBMACHINE:
        yield f'<rect x="{_n(x)}" y="{_n(y - 3.5)}" width="8" height="7" rx="2.5" {style}/>'
        yield f'<rect x="{_n(x + 12)}" y="{_n(y - 3.5)}" width="8" height="7" rx="2.5" {style}/>'
        yield f'<line x1="{_n(x + 8)}" y1="{_n(y)}" x2="{_n(x + 12)}" y2="{_n(y)}" {style}/>'
    elif box.kind is BoxKind.DYNAMIC:
        points = f"M{_n(x)} {_n(y)}h6M{_n(x + 18)} {_n(y - 5)}l-6 0l-6 5l6 5l6 0"
        yield f'<path d="{points}" {style}/>'


def _separators(boxes: Iterable[Box], stroke: str) -> Iterator[str]:
    """Yield dashed lines between regions."""
    regions = [box for box in boxes if box.kind is BoxKind.REGION]
    for one, other in pairwise(regions):
        end = (other.x, other.y + other.height) if other.x > one.x else (other.x + other.width, other.y)
        line = f'x1="{_n(other.x)}" y1="{_n(other.y)}" x2="{_n(end[0])}" y2="{_n(end[1])}"'
        yield f'<line {line} stroke="{stroke}" stroke-dasharray="7 5"/>'


def _text(text: Text) -> str:
    classes = f"{text.style} mid" if text.centred else text.style
    return f'<text class="{classes}" x="{_n(text.x)}" y="{_n(text.y)}">{_x(text.text)}</text>'


def _edge(edge: DrawnEdge) -> Iterator[str]:
    by_rule = " by-rule" * edge.rule
    *points, before, end = edge.points
    length = hypot(end[0] - before[0], end[1] - before[1]) or 1.0
    ux, uy = (end[0] - before[0]) / length, (end[1] - before[1]) / length
    base = (end[0] - ux * (ARROW[0] - 1), end[1] - uy * (ARROW[0] - 1))
    yield f'<path class="edge{by_rule}" d="{_path([*points, before, base])}"/>'
    x, y, half = end[0] - ux * ARROW[0], end[1] - uy * ARROW[0], ARROW[1]
    corners = [end, (x - uy * half, y + ux * half), (x + uy * half, y - ux * half)]
    yield f'<path class="head{by_rule}" d="M{"L".join(map(_p, corners))}Z"/>'


def _label(edge: DrawnEdge, fill: str) -> Iterator[str]:
    if edge.area is None:
        return
    x, y, width, height = edge.area
    size = f'x="{_n(x - 3)}" y="{_n(y - 1)}" width="{_n(width + 6)}" height="{_n(height + 2)}"'
    yield f'<g class="transition"><title>{_x(edge.title)}</title>'
    yield f'<rect {size} rx="4" fill="{fill}" fill-opacity="0.92"/>'
    yield from (_text(text) for text in edge.label)
    yield "</g>"


def _path(points: list[Point]) -> str:
    """Return a polyline with round corners."""
    path = [f"M{_p(points[0])}"]
    for (x0, y0), (x1, y1), (x2, y2) in zip(points, points[1:], points[2:], strict=False):
        before, after = hypot(x1 - x0, y1 - y0), hypot(x2 - x1, y2 - y1)
        radius = min(RADIUS, before / 2, after / 2)
        start = (x1 + (x0 - x1) * radius / (before or 1), y1 + (y0 - y1) * radius / (before or 1))
        stop = (x1 + (x2 - x1) * radius / (after or 1), y1 + (y2 - y1) * radius / (after or 1))
        path.append(f"L{_p(start)}Q{_p((x1, y1))} {_p(stop)}")
    return "".join([*path, f"L{_p(points[-1])}"])


def _p(point: Point) -> str:
    return f"{_n(point[0])} {_n(point[1])}"


def _n(value: float) -> str:
    return f"{round(value, 1) + 0.0:g}"


def _x(text: str) -> str:
    """Return text for XML, without the characters that XML 1.0 forbids."""
    return escape(_FORBIDDEN.sub("", text))
