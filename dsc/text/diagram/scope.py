"""The states of one scope with the edges between them, laid out; edges may lead on into the states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from dsc.text.diagram.cards import name_below, name_beside
from dsc.text.diagram.crossing import prolonged
from dsc.text.diagram.edges import Bundle, loops, room_along_loops, room_for_loops
from dsc.text.diagram.layered.arrange import arrange
from dsc.text.diagram.layered.graph import Link, Node
from dsc.text.diagram.layout import Box, BoxKind, Edge


@dataclass(frozen=True, slots=True)
class Span:
    """The transitions of an edge, and the boxes of the scope that are, or hold, its source and its target."""

    bundle: Bundle
    start: str
    end: str


@dataclass(frozen=True, slots=True)
class Inside:
    """What a scope holds, in a rectangle that begins at (0, 0)."""

    width: float
    height: float
    boxes: tuple[Box, ...]
    edges: tuple[Edge, ...] = ()


@dataclass(frozen=True, slots=True)
class Draft:
    """A scope with its edges up to the borders of its boxes, in a rectangle that begins at (0, 0)."""

    width: float
    height: float
    boxes: tuple[Box, ...]
    edges: tuple[tuple[Span, Edge], ...]

    def finished(self) -> Inside:
        """With all edges up to the states that they mean."""
        boxes = {box.name: box for box in self.boxes}
        edges: list[Edge] = []
        for span, edge in self.edges:
            edges += prolonged(edge, boxes[span.start], boxes[span.end], span.bundle.also, edges)
        return Inside(self.width, self.height, self.boxes, tuple(edges))


def arranged(boxes: Mapping[str, Box], spans: Sequence[Span], *, sideways: bool) -> Draft:
    """Place the boxes of a scope and its edges, with room for all labels."""
    own: dict[str, list[Span]] = {}
    for span in spans:
        if span.start == span.end:
            own.setdefault(span.start, []).append(span)
    others = [span for span in spans if span.start != span.end]
    roomy = [_roomy(box, own.get(name, []), sideways=sideways) for name, box in boxes.items()]
    if sideways:
        roomy = [_written_aside(box) for box in roomy]
    number = {name: index for index, name in enumerate(boxes)}
    drawing = arrange(
        [_node(box, own.get(box.name, []), sideways=sideways) for box in roomy],
        [_link(number[span.start], number[span.end], span) for span in others],
        sideways=sideways,
    )
    placed = [box.moved(*corner) for box, corner in zip(roomy, drawing.corners, strict=True)]
    edges = [(span, span.bundle.along(route)) for span, route in zip(others, drawing.routes, strict=True)]
    for name, spans_of_one in own.items():
        drawn = loops([span.bundle for span in spans_of_one], placed[number[name]], sideways=sideways)
        edges += zip(spans_of_one, drawn, strict=True)
    return Draft(drawing.width, drawing.height, tuple(placed), tuple(edges))


def _link(source: int, target: int, span: Span) -> Link:
    bundle = span.bundle
    meant = "" if bundle.target == span.end else bundle.target
    # What was foreseen is the thread to follow; what rules do about failures goes around it.
    return Link(source, target, bundle.width, bundle.height, weight=0.1 if bundle.rule else 1.0, meant=meant)


def _written_aside(box: Box) -> Box:
    """The box with its texts where no edge comes or goes sideways."""
    return name_beside(box) if box.kind is BoxKind.FINAL else name_below(box) if box.kind is BoxKind.HISTORY else box


def _node(box: Box, own: Sequence[Span], *, sideways: bool) -> Node:
    pointed = box.kind in {BoxKind.INITIAL, BoxKind.FINAL, BoxKind.HISTORY}
    diamond, last = box.kind is BoxKind.CHOICE, box.kind is BoxKind.FINAL
    beside = room_for_loops([span.bundle for span in own], sideways=sideways)
    return Node(box.width, box.height, beside, pointed=pointed, diamond=diamond, last=last)


def _roomy(box: Box, own: Sequence[Span], *, sideways: bool) -> Box:
    """A box as large as the labels of its loops, so that these keep clear of other boxes."""
    room = room_along_loops([span.bundle for span in own], sideways=sideways)
    width, height = (room, 0.0) if sideways else (0.0, room)
    return widened(box, max(box.width, width), max(box.height, height))


def widened(box: Box, width: float, height: float) -> Box:
    """A box of another size with its texts in the middle."""
    texts = tuple(replace(text, x=text.x + (width - box.width) / 2) if text.centred else text for text in box.texts)
    return replace(box, width=width, height=height, texts=texts)
