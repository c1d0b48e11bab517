"""Scopes of a drawing: the scopes around each state, and the layout of one scope with its edges."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from dsc.drawing.cards import name_below, name_beside
from dsc.drawing.crossing import prolonged
from dsc.drawing.edges import EdgeBundle, loops, room_along_loops, room_for_loops
from dsc.drawing.layered.arrange import arrange
from dsc.drawing.layered.graph import LayerLink, LayerNode
from dsc.drawing.layout import Box, BoxKind, DrawnEdge
from dsc.model.plot import ActionPlot, Path


class ScopeNesting:
    """The scopes around each state of a plot, by their paths; the plot itself is the scope `()`."""

    def __init__(self, plot: ActionPlot) -> None:
        self._holders = {name: dict(_holders(path)) for name, _, path in plot.walk()}

    def __iter__(self) -> Iterator[str]:
        return iter(self._holders)

    def inside(self, scope: Path) -> list[str]:
        """Return all states in a scope, at any depth."""
        return [name for name, holders in self._holders.items() if scope in holders]

    def holder(self, scope: Path, name: str) -> str:
        """Return the state of the scope that is or holds the state `name`; for the initial pseudostate, `""`."""
        return self._holders[name][scope] if name else ""

    def common_scope(self, names: Iterable[str]) -> Path:
        """Return the innermost scope that holds all these states; regions are scopes, orthogonal states are not.

        SCXML calls it the least common compound ancestor (appendix D, `findLCCA`).
        """
        first, *others = (self._holders[name] for name in names)
        return [scope for scope in first if all(scope in other for other in others)][-1]


def _holders(path: Path) -> Iterator[tuple[Path, str]]:
    """Yield the scopes around the state at `path`, outermost first, each with its state that is or holds that one."""
    for place in range(0, len(path), 2):
        if path[place] == "states":
            yield path[:place], str(path[place + 1])


@dataclass(frozen=True, slots=True)
class ScopeSpan:
    """The transitions of an edge, and the boxes of the scope that are, or hold, its source and its target."""

    bundle: EdgeBundle
    start: str
    end: str


@dataclass(frozen=True, slots=True)
class Inside:
    """The contents of a scope, in a rectangle that begins at (0, 0)."""

    width: float
    height: float
    boxes: tuple[Box, ...]
    edges: tuple[DrawnEdge, ...] = ()


@dataclass(frozen=True, slots=True)
class Draft:
    """A scope with its edges up to the borders of its boxes, in a rectangle that begins at (0, 0)."""

    width: float
    height: float
    boxes: tuple[Box, ...]
    edges: tuple[tuple[ScopeSpan, DrawnEdge], ...]

    def finished(self) -> Inside:
        """Return the scope with all edges prolonged to their states."""
        boxes = {box.name: box for box in self.boxes}
        edges: list[DrawnEdge] = []
        for span, edge in self.edges:
            edges += prolonged(edge, boxes[span.start], boxes[span.end], span.bundle.also, edges)
        return Inside(self.width, self.height, self.boxes, tuple(edges))


def arranged(boxes: Mapping[str, Box], spans: Sequence[ScopeSpan], *, sideways: bool) -> Draft:
    """Place the boxes of a scope and its edges, with room for all labels."""
    own: dict[str, list[ScopeSpan]] = {}
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


def _link(source: int, target: int, span: ScopeSpan) -> LayerLink:
    bundle = span.bundle
    meant = "" if bundle.target == span.end else bundle.target
    # Edges of the regular flow are straight; edges of rules, for failures, bend around them.
    return LayerLink(source, target, bundle.width, bundle.height, weight=0.1 if bundle.rule else 1.0, meant=meant)


def _written_aside(box: Box) -> Box:
    """Return the box with its texts away from horizontal edges."""
    return name_beside(box) if box.kind is BoxKind.FINAL else name_below(box) if box.kind is BoxKind.HISTORY else box


def _node(box: Box, own: Sequence[ScopeSpan], *, sideways: bool) -> LayerNode:
    pointed = box.kind in {BoxKind.INITIAL, BoxKind.FINAL, BoxKind.HISTORY}
    diamond, last = box.kind is BoxKind.CHOICE, box.kind is BoxKind.FINAL
    beside = room_for_loops([span.bundle for span in own], sideways=sideways)
    return LayerNode(box.width, box.height, beside, pointed=pointed, diamond=diamond, last=last)


def _roomy(box: Box, own: Sequence[ScopeSpan], *, sideways: bool) -> Box:
    """Return a box at least as large as the labels of its loops, so that they do not touch other boxes."""
    room = room_along_loops([span.bundle for span in own], sideways=sideways)
    width, height = (room, 0.0) if sideways else (0.0, room)
    return widened(box, max(box.width, width), max(box.height, height))


def widened(box: Box, width: float, height: float) -> Box:
    """Return a box of another size with its texts in the middle."""
    texts = tuple(replace(text, x=text.x + (width - box.width) / 2) if text.centred else text for text in box.texts)
    return replace(box, width=width, height=height, texts=texts)
