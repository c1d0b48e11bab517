"""Scopes of a drawing: the scopes that contain each state, and the layout of one scope with its edges.

Transitions with equal ends share an edge. Loops are placed next to their state.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from dsc.drawing.captions import Caption, Labelled, captions, labelled_by_value
from dsc.drawing.cards import name_below, name_next_to
from dsc.drawing.crossing import prolonged
from dsc.drawing.layered.arrange import arrange
from dsc.drawing.layered.graph import LayerLink, LayerNode, Route
from dsc.drawing.layout import LINE_HEIGHT, Box, BoxKind, DrawnEdge, Point, Text, text_width
from dsc.model.plot import ActionPlot, Path
from dsc.model.states import AnyState, HistoryState
from dsc.model.transitions import TransitionSource


class ScopeNesting:
    """The scopes that contain each state of a plot, by path; the plot itself is the scope `()`."""

    def __init__(self, plot: ActionPlot) -> None:
        self._holders = {name: dict(_holders(path)) for name, _, path in plot.walk()}

    def inside(self, scope: Path) -> list[str]:
        """Return the names of all states in a scope, at any depth."""
        return [name for name, holders in self._holders.items() if scope in holders]

    def holder(self, scope: Path, name: str) -> str:
        """Return the name of the scope's direct state that is or contains the state `name`; `""` for the name `""`."""
        return self._holders[name][scope] if name else ""

    def common_scope(self, names: Iterable[str]) -> Path:
        """Return the innermost scope that contains all these states; regions are scopes, orthogonal states are not.

        This scope is SCXML's least common compound ancestor (appendix D, `findLCCA`).
        """
        first, *others = (self._holders[name] for name in names)
        return [scope for scope in first if all(scope in other for other in others)][-1]


def _holders(path: Path) -> Iterator[tuple[Path, str]]:
    """Yield each scope that contains the state at `path`, outermost first, with the name of its state on the path."""
    for place in range(0, len(path), 2):
        if path[place] == "states":
            yield path[:place], str(path[place + 1])


@dataclass(frozen=True, slots=True)
class ScopeSpan:
    """The transitions of an edge, and the scope's boxes that represent or contain the edge's source and target."""

    bundle: EdgeBundle
    start: str
    end: str


def contents(width: float, height: float, boxes: Iterable[Box], edges: Iterable[DrawnEdge] = ()) -> Box:
    """Return a box with the content of a scope; its upper left corner is (0, 0)."""
    return Box(BoxKind.REGION, "", 0, 0, width, height, boxes=tuple(boxes), edges=tuple(edges))


@dataclass(frozen=True, slots=True)
class Draft:
    """Layout of a scope whose edges end at the borders of the scope's boxes; the upper left corner is (0, 0)."""

    width: float
    height: float
    boxes: tuple[Box, ...]
    edges: tuple[tuple[ScopeSpan, DrawnEdge], ...]

    def finished(self) -> Box:
        """Return the scope as a box, with each edge prolonged to the states inside the boxes."""
        boxes = {box.name: box for box in self.boxes}
        edges: list[DrawnEdge] = []
        for span, edge in self.edges:
            edges += prolonged(edge, boxes[span.start], boxes[span.end], span.bundle.also, edges)
        return contents(self.width, self.height, self.boxes, edges)


def arranged(boxes: Mapping[str, Box], spans: Sequence[ScopeSpan], *, sideways: bool) -> Draft:
    """Return the layout of a scope: its boxes and edges, with space for all labels."""
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
    # Straight lines matter more for the regular flow than for the edges of rules, which handle failures.
    return LayerLink(source, target, bundle.width, bundle.height, weight=0.1 if bundle.rule else 1.0, meant=meant)


def _written_aside(box: Box) -> Box:
    """Return a box whose texts do not cover horizontal edges; only final states and histories change."""
    return name_next_to(box) if box.kind is BoxKind.FINAL else name_below(box) if box.kind is BoxKind.HISTORY else box


def _node(box: Box, own: Sequence[ScopeSpan], *, sideways: bool) -> LayerNode:
    pointed = box.kind in {BoxKind.INITIAL, BoxKind.FINAL, BoxKind.HISTORY}
    diamond, last = box.kind is BoxKind.CHOICE, box.kind is BoxKind.FINAL
    beside = room_for_loops([span.bundle for span in own], sideways=sideways)
    return LayerNode(box.width, box.height, beside, pointed=pointed, diamond=diamond, last=last)


def _roomy(box: Box, own: Sequence[ScopeSpan], *, sideways: bool) -> Box:
    """Return a box at least as large as the labels of its loops, so that the labels do not touch other boxes."""
    room = room_along_loops([span.bundle for span in own], sideways=sideways)
    width, height = (room, 0.0) if sideways else (0.0, room)
    return widened(box, max(box.width, width), max(box.height, height))


def widened(box: Box, width: float, height: float) -> Box:
    """Return the box with another size, and with its texts in the middle."""
    texts = tuple(replace(text, x=text.x + (width - box.width) / 2) if text.centred else text for text in box.texts)
    return replace(box, width=width, height=height, texts=texts)


LOOP = 18.0
"""Distance between a state and the far side of a loop, in pixels."""
LOOP_HALF = 8.0
LOOP_GAP = 8.0
"""Space between the loops of one state, in pixels."""
CAPTION_GAP = 4.0


@dataclass(frozen=True, slots=True)
class EdgeBundle:
    """All transitions with equal source and targets, with the size of their common label.

    `also` contains the names of further targets.
    """

    source: str
    target: str
    captions: tuple[Caption, ...]
    rule: bool
    width: float = 0.0
    height: float = 0.0
    also: tuple[str, ...] = ()

    @property
    def targets(self) -> tuple[str, ...]:
        """Names of all target states."""
        return (self.target, *self.also)

    @property
    def title(self) -> str:
        """Full text of all captions, one line for each caption."""
        return "\n".join(caption.full for caption in self.captions)

    def texts(self, middle: Point) -> tuple[Text, ...]:
        """Return the texts of the label, centred on the point `middle`."""
        x, y = middle[0], middle[1] - self.height / 2 + 11.5
        texts = []
        for caption in self.captions:
            for line in caption.lines:
                texts.append(Text(x, round(y, 1), line, caption.style, centred=True))
                y += LINE_HEIGHT
            y += _gap(self.captions)
        return tuple(texts)

    def edge(self, points: tuple[Point, ...], middle: Point) -> DrawnEdge:
        """Return the edge along `points`, with its label centred on `middle`."""
        edge = DrawnEdge(self.source, self.target, points, title=self.title, rule=self.rule)
        if not self.height:
            return edge
        area = (middle[0] - self.width / 2, middle[1] - self.height / 2, self.width, self.height)
        return replace(edge, label=self.texts(middle), area=area)

    def along(self, route: Route) -> DrawnEdge:
        """Return the edge along the route of a link."""
        return self.edge(route.points, route.label)


def bundles(states: Mapping[str, AnyState], recoveries: frozenset[str], *, terse: bool) -> list[EdgeBundle]:
    """Return one bundle for each combination of source and targets, in the order of the states.

    The transitions of states and connectors, and the defaults of histories, are bundled.

    Args:
        states: states of a plot by name.
        recoveries: names of states that rules added.
        terse: see `captions`.
    """
    groups: dict[tuple[str, tuple[str, ...]], list[Labelled]] = {}
    for name, state in states.items():
        if isinstance(state, HistoryState):  # the history's box shows the actions of its default
            groups[name, (state.target,)] = []
        for one in labelled_by_value(state) if isinstance(state, TransitionSource) else ():
            if one.transition.target is not None:
                groups.setdefault((name, one.transition.targets), []).append(one)
    return [
        _bundle(*ends, group, tuple(captions(group, terse=terse)), recovery=ends[0] in recoveries)
        for ends, group in groups.items()
    ]


def _bundle(
    source: str, targets: tuple[str, ...], group: list[Labelled], said: tuple[Caption, ...], *, recovery: bool
) -> EdgeBundle:
    lines = [(line, caption.style) for caption in said for line in caption.lines]
    rule = recovery or (bool(group) and all(one.transition.rule is not None for one in group))
    width = max((text_width(line, style) for line, style in lines), default=0.0)
    height = LINE_HEIGHT * len(lines) + _gap(said) * max(len(said) - 1, 0)
    return EdgeBundle(source, targets[0], said, rule, width, height, targets[1:])


def _gap(said: tuple[Caption, ...]) -> float:
    """Return the space between captions in pixels; captions of one line need no space."""
    return CAPTION_GAP if any(len(caption.lines) > 1 for caption in said) else 0.0


def initial_bundle(target: str) -> EdgeBundle:
    """Return the edge from the initial pseudostate, whose name is empty, to the initial state `target`."""
    return EdgeBundle("", target, (), rule=False)


def room_for_loops(bundles: Sequence[EdgeBundle], *, sideways: bool) -> float:
    """Return the space that the self-transitions of a state need at its right, labels included; below if `sideways`."""
    return max((LOOP + 6 + (one.height if sideways else one.width) for one in bundles), default=0.0)


def room_along_loops(bundles: Sequence[EdgeBundle], *, sideways: bool) -> float:
    """Return the height (width if `sideways`) that a state needs for the labels of its loops."""
    if len(bundles) < 2:  # the label of a single loop may be larger than the state
        return sum(one.width if sideways else one.height for one in bundles)
    return sum(_extent(one, sideways=sideways) + LOOP_GAP for one in bundles)


def _extent(bundle: EdgeBundle, *, sideways: bool) -> float:
    return max(bundle.width if sideways else bundle.height, 2 * LOOP_HALF)


def loops(bundles: Sequence[EdgeBundle], box: Box, *, sideways: bool) -> list[DrawnEdge]:
    """Return the loops of a state: parallel edges for transitions from the state to itself or to an inner state."""
    extents = [_extent(one, sideways=sideways) + LOOP_GAP for one in bundles]
    first = -sum(extents) / 2
    offsets = [first + sum(extents[:number]) + extent / 2 for number, extent in enumerate(extents)]
    return [_loop(one, box, offset, sideways=sideways) for one, offset in zip(bundles, offsets, strict=True)]


def _loop(bundle: EdgeBundle, box: Box, offset: float, *, sideways: bool) -> DrawnEdge:
    x, y = box.x + box.width, box.y + box.height / 2 + offset
    slope = box.height / box.width if box.kind is BoxKind.CHOICE else 0.0
    if sideways:
        x, y = box.x + box.width / 2 + offset, box.y + box.height
        end = y - LOOP_HALF * slope
        ends = ((x - LOOP_HALF, end), (x - LOOP_HALF, y + LOOP), (x + LOOP_HALF, y + LOOP), (x + LOOP_HALF, end))
        return bundle.edge(ends, (x, y + LOOP + 6 + bundle.height / 2))
    end = x - LOOP_HALF / slope if slope else x
    ends = ((end, y - LOOP_HALF), (x + LOOP, y - LOOP_HALF), (x + LOOP, y + LOOP_HALF), (end, y + LOOP_HALF))
    return bundle.edge(ends, (x + LOOP + 6 + bundle.width / 2, y))
