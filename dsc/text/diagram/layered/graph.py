"""What goes into a layered drawing and what comes out of it; lengths in pixels, y grows downwards."""

from __future__ import annotations

from dataclasses import dataclass

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Node:
    """A box to be placed.

    Attributes:
        width, height: its size.
        beside: room to keep free on its right, e.g. for a loop.
        pointed: all links meet it in the middle of its side, not spread along it.
        diamond: it is pointed and only its corners reach its sides; links against the order meet it beside them.
        last: no link may lead upwards to it.
    """

    width: float
    height: float
    beside: float = 0.0
    pointed: bool = False
    diamond: bool = False
    last: bool = False


@dataclass(frozen=True, slots=True)
class Link:
    """An edge between two different nodes.

    Attributes:
        source, target: positions of the nodes in the input.
        width, height: size of its label; 0 if it has none.
        weight: how much it matters that it is straight.
    """

    source: int
    target: int
    width: float = 0.0
    height: float = 0.0
    weight: float = 1.0


@dataclass(frozen=True, slots=True)
class Route:
    """How a link runs from its source to its target, and the middle of its label."""

    points: tuple[Point, ...]
    label: Point


@dataclass(frozen=True, slots=True)
class Arrangement:
    """A finished drawing: the nodes' upper left corners and the links' routes, in the order of the input."""

    width: float
    height: float
    corners: tuple[Point, ...]
    routes: tuple[Route, ...]
