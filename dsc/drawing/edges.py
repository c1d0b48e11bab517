"""Edges of a drawing: transitions merged by their ends, with labels and routes; loops next to their state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from dsc.drawing.captions import Caption, Labelled, captions, labelled_by_value
from dsc.drawing.layered.graph import Route
from dsc.drawing.layout import Box, BoxKind, DrawnEdge, Point, Text
from dsc.drawing.measure import LINE_HEIGHT, text_width
from dsc.model.states import AnyState, HistoryState
from dsc.model.transitions import TransitionSource

LOOP = 18.0
"""Reach of a loop from its state."""
LOOP_HALF = 8.0
LOOP_GAP = 8.0
"""Space between loops of one state."""
CAPTION_GAP = 4.0


@dataclass(frozen=True, slots=True)
class EdgeBundle:
    """All transitions from one state to another (`also`: and more), with the size of their common label."""

    source: str
    target: str
    captions: tuple[Caption, ...]
    rule: bool
    width: float = 0.0
    height: float = 0.0
    also: tuple[str, ...] = ()

    @property
    def targets(self) -> tuple[str, ...]:
        """All states it leads to."""
        return (self.target, *self.also)

    @property
    def title(self) -> str:
        """All captions in full."""
        return "\n".join(caption.full for caption in self.captions)

    def texts(self, middle: Point) -> tuple[Text, ...]:
        """Return the label, centred on a point."""
        x, y = middle[0], middle[1] - self.height / 2 + 11.5
        texts = []
        for caption in self.captions:
            for line in caption.lines:
                texts.append(Text(x, round(y, 1), line, caption.style, centred=True))
                y += LINE_HEIGHT
            y += _gap(self.captions)
        return tuple(texts)

    def edge(self, points: tuple[Point, ...], middle: Point) -> DrawnEdge:
        """Return the edge along `points` with its label around `middle`."""
        edge = DrawnEdge(self.source, self.target, points, title=self.title, rule=self.rule)
        if not self.height:
            return edge
        area = (middle[0] - self.width / 2, middle[1] - self.height / 2, self.width, self.height)
        return replace(edge, label=self.texts(middle), area=area)

    def along(self, route: Route) -> DrawnEdge:
        """Return the edge along a route."""
        return self.edge(route.points, route.label)


def bundles(states: Mapping[str, AnyState], recoveries: frozenset[str], *, terse: bool) -> list[EdgeBundle]:
    """Merge the transitions of states and the defaults of histories by their ends, in the order of the states.

    Args:
        states: by name.
        recoveries: names of states that rules added.
        terse: see `captions`.
    """
    groups: dict[tuple[str, tuple[str, ...]], list[Labelled]] = {}
    for name, state in states.items():
        if isinstance(state, HistoryState):  # the history's card shows the default's actions
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
    """Return the space between captions that separates their lines."""
    return CAPTION_GAP if any(len(caption.lines) > 1 for caption in said) else 0.0


def initial_bundle(target: str) -> EdgeBundle:
    """Return the edge from the initial pseudostate, which has an empty name, to the first state."""
    return EdgeBundle("", target, (), rule=False)


def room_for_loops(bundles: Sequence[EdgeBundle], *, sideways: bool) -> float:
    """Return the space for loops with their labels right of their state (below it if `sideways`)."""
    return max((LOOP + 6 + (one.height if sideways else one.width) for one in bundles), default=0.0)


def room_along_loops(bundles: Sequence[EdgeBundle], *, sideways: bool) -> float:
    """Return the height (width if `sideways`) of a state for the labels of its loops."""
    if len(bundles) < 2:  # a single one may reach beyond its state
        return sum(one.width if sideways else one.height for one in bundles)
    return sum(_extent(one, sideways=sideways) + LOOP_GAP for one in bundles)


def _extent(bundle: EdgeBundle, *, sideways: bool) -> float:
    return max(bundle.width if sideways else bundle.height, 2 * LOOP_HALF)


def loops(bundles: Sequence[EdgeBundle], box: Box, *, sideways: bool) -> list[DrawnEdge]:
    """Return edges in parallel for transitions from a state to itself or into it."""
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
