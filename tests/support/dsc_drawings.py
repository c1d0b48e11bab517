"""What the tests of drawings share: walks over boxes and edges, and where things lie."""

from __future__ import annotations

import pytest

from dsc.drawing.layout import Area, Box, BoxKind, DrawnEdge, Point


def boxes(root: Box) -> list[Box]:
    return [root, *(one for inner in root.boxes for one in boxes(inner))]


def edges(root: Box) -> list[DrawnEdge]:
    return [edge for box in boxes(root) for edge in box.edges]


def area(box: Box) -> Area:
    return box.x, box.y, box.width, box.height


def apart(one: Area, other: Area, slack: float = 0.25) -> bool:
    (x, y, w, h), (u, v, a, b) = one, other
    return x + w <= u + slack or u + a <= x + slack or y + h <= v + slack or v + b <= y + slack


def inside(inner: Area, outer: Area, slack: float = 0.25) -> bool:
    (x, y, w, h), (u, v, a, b) = inner, outer
    return x >= u - slack and y >= v - slack and x + w <= u + a + slack and y + h <= v + b + slack


def on_border(point: Point, box: Box) -> bool:
    x, y = point
    if box.kind is BoxKind.CHOICE:
        across, along = abs(x - box.x - box.width / 2), abs(y - box.y - box.height / 2)
        return across / (box.width / 2) + along / (box.height / 2) == pytest.approx(1, abs=0.01)
    on_side = min(abs(x - box.x), abs(x - box.x - box.width), abs(y - box.y), abs(y - box.y - box.height))
    return inside((x, y, 0, 0), area(box)) and on_side < 0.25
