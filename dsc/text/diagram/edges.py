"""Transitions as edges: merged by their ends, labelled, and laid along routes; loops beside their state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from dsc.model.states import AnyState
from dsc.model.transitions import Source
from dsc.text.diagram.captions import Caption, Labelled, captions, labelled_by_value
from dsc.text.diagram.layered.graph import Route
from dsc.text.diagram.layout import Box, BoxKind, Edge, Point, Text
from dsc.text.diagram.measure import LINE_HEIGHT, text_width

LOOP = 18.0
"""How far a loop leaves its state."""
LOOP_HALF = 8.0
CAPTION_GAP = 4.0


@dataclass(frozen=True, slots=True)
class Bundle:
    """All transitions from one state to another, with the size of their common label."""

    source: str
    target: str
    captions: tuple[Caption, ...]
    rule: bool
    width: float = 0.0
    height: float = 0.0

    @property
    def title(self) -> str:
        """All captions in full."""
        return "\n".join(caption.full for caption in self.captions)

    def texts(self, middle: Point) -> tuple[Text, ...]:
        """The label, centred on a point."""
        x, y = middle[0], middle[1] - self.height / 2 + 11.5
        texts = []
        for caption in self.captions:
            for line in caption.lines:
                texts.append(Text(x, round(y, 1), line, caption.style, centred=True))
                y += LINE_HEIGHT
            y += _gap(self.captions)
        return tuple(texts)

    def edge(self, points: tuple[Point, ...], middle: Point) -> Edge:
        """The edge along `points` with its label around `middle`."""
        edge = Edge(self.source, self.target, points, title=self.title, rule=self.rule)
        if not self.height:
            return edge
        area = (middle[0] - self.width / 2, middle[1] - self.height / 2, self.width, self.height)
        return replace(edge, label=self.texts(middle), area=area)

    def along(self, route: Route) -> Edge:
        """The edge along a route."""
        return self.edge(route.points, route.label)


def bundles(states: Mapping[str, AnyState], recoveries: frozenset[str], *, terse: bool) -> list[Bundle]:
    """The transitions of one scope, merged by source and target, in the order of the plot.

    Args:
        states: of the scope.
        recoveries: names of states that rules added.
        terse: see `captions`.
    """
    groups: dict[tuple[str, str], list[Labelled]] = {}
    for name, state in states.items():
        for one in labelled_by_value(state) if isinstance(state, Source) else ():
            if one.transition.target is not None:
                groups.setdefault((name, one.transition.target), []).append(one)
    return [
        _bundle(*ends, group, tuple(captions(group, terse=terse)), recovery=ends[0] in recoveries)
        for ends, group in groups.items()
    ]


def _bundle(source: str, target: str, group: list[Labelled], said: tuple[Caption, ...], *, recovery: bool) -> Bundle:
    lines = [(line, caption.style) for caption in said for line in caption.lines]
    rule = recovery or all(one.transition.rule is not None for one in group)
    width = max((text_width(line, style) for line, style in lines), default=0.0)
    height = LINE_HEIGHT * len(lines) + _gap(said) * max(len(said) - 1, 0)
    return Bundle(source, target, said, rule, width, height)


def _gap(said: tuple[Caption, ...]) -> float:
    """Between captions, so that one sees which lines belong together."""
    return CAPTION_GAP if any(len(caption.lines) > 1 for caption in said) else 0.0


def initial_bundle(target: str) -> Bundle:
    """From the initial pseudo-state, which has no name, to the first state."""
    return Bundle("", target, (), rule=False)


def room_for_loop(bundle: Bundle, *, sideways: bool) -> float:
    """The space a loop with its label needs beside its state (below it if `sideways`)."""
    return LOOP + 6 + (bundle.height if sideways else bundle.width)


def loop(bundle: Bundle, box: Box, *, sideways: bool) -> Edge:
    """A transition from a state to itself."""
    x, y = box.x + box.width, box.y + box.height / 2
    slope = box.height / box.width if box.kind is BoxKind.CHOICE else 0.0
    if sideways:
        x, y = box.x + box.width / 2, box.y + box.height
        end = y - LOOP_HALF * slope
        ends = ((x - LOOP_HALF, end), (x - LOOP_HALF, y + LOOP), (x + LOOP_HALF, y + LOOP), (x + LOOP_HALF, end))
        return bundle.edge(ends, (x, y + LOOP + 6 + bundle.height / 2))
    end = x - LOOP_HALF / slope if slope else x
    ends = ((end, y - LOOP_HALF), (x + LOOP, y - LOOP_HALF), (x + LOOP, y + LOOP_HALF), (end, y + LOOP_HALF))
    return bundle.edge(ends, (x + LOOP + 6 + bundle.width / 2, y))
