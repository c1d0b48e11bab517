"""Elements of SVG drawings: document, colours, numbers, texts and arrowheads.

Readers with red-green colour blindness can distinguish the colours (Okabe and Ito 2008).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import escape
from math import hypot

Point = tuple[float, float]

INK, SOFT, DETAIL = "#1f2937", "#64748b", "#334155"
BLUE, ORANGE, GREEN, PINK, VIOLET, GREY = (
    ("#e3f0fb", "#0064a8"),
    ("#fff3d6", "#b35c00"),
    ("#effaf6", "#00795a"),
    ("#fbe8f1", "#a3195b"),
    ("#f3effc", "#5b3fa0"),
    ("#f6f8fb", "#475569"),
)
"""Fill and border colour of boxes."""
_ARROW = (9.0, 3.6)
"""Length and half width of an arrowhead, in pixels."""
FONTS = "font-family:Inter,'Segoe UI','Helvetica Neue',Arial,'DejaVu Sans',sans-serif"
"""CSS of all texts."""
EDGES = f".edge{{fill:none;stroke:{SOFT};stroke-width:1.4}}"
"""CSS of all lines."""
_FORBIDDEN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


def document(title: str, width: float, height: float, style: str, body: Iterable[str]) -> str:
    """Return an SVG document with an opaque background; `style` is the CSS of its elements."""
    size = f'width="{number(width)}" height="{number(height)}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {number(width)} {number(height)}" role="img">\n'
        f"<title>{escaped(title)}</title>\n<style>{style}</style>\n"
        f'<rect {size} rx="10" fill="#ffffff"/>\n' + "\n".join(body) + "\n</svg>\n"
    )


def arrowhead(before: Point, end: Point) -> tuple[Point, str]:
    """Return the end of an arrow's line, and the path of its head.

    The arrow leads from `before` to `end`.
    """
    length = hypot(end[0] - before[0], end[1] - before[1]) or 1.0
    ux, uy = (end[0] - before[0]) / length, (end[1] - before[1]) / length
    long, half = _ARROW
    x, y = end[0] - ux * long, end[1] - uy * long
    corners = (end, (x - uy * half, y + ux * half), (x + uy * half, y - ux * half))
    return (x + ux, y + uy), f"M{'L'.join(map(point, corners))}Z"


def area(x: float, y: float, width: float, height: float) -> str:
    """Return the SVG attributes for the position and size of an element."""
    return f'x="{number(x)}" y="{number(y)}" width="{number(width)}" height="{number(height)}"'


def ends(start: Point, end: Point) -> str:
    """Return the SVG attributes for the ends of a line."""
    return f'x1="{number(start[0])}" y1="{number(start[1])}" x2="{number(end[0])}" y2="{number(end[1])}"'


def point(at: Point) -> str:
    """Return a point in the notation of an SVG path."""
    return f"{number(at[0])} {number(at[1])}"


def number(value: float) -> str:
    """Return a length with at most one decimal."""
    return f"{round(value, 1) + 0.0:.1f}".removesuffix(".0")


def escaped(text: str) -> str:
    """Return the text escaped for XML, without the characters that XML 1.0 forbids."""
    return escape(_FORBIDDEN.sub("", text))
