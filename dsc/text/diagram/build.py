"""A plot as a drawing: every state a box, every scope a layered drawing inside the box of its state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from dsc.dynamic.library import Library
from dsc.model.connectors import Connector
from dsc.model.plot import ActionPlot, Path, Scope, initial_of
from dsc.model.states import (
    AnyState,
    CompositeState,
    DynamicState,
    FinalState,
    HistoryState,
    OrthogonalState,
    Region,
    State,
)
from dsc.text.diagram.cards import action_rows, card, diamond, dot, final_card, history_card, leaf_card, name_beside
from dsc.text.diagram.edges import Bundle, bundles, initial_bundle, loop, room_for_loop
from dsc.text.diagram.header import header, rules_note
from dsc.text.diagram.layered.arrange import arrange
from dsc.text.diagram.layered.graph import Link, Node
from dsc.text.diagram.layout import Box, BoxKind, Edge, Text, TextStyle
from knowledge_base.errors import UnknownNameError

PAD = 16.0
REGION_TITLE = 22.0
HULLS = frozenset({BoxKind.COMPOSITE, BoxKind.ORTHOGONAL})


@dataclass(frozen=True, slots=True)
class _Inside:
    """What a scope holds, in a rectangle that begins at (0, 0)."""

    width: float
    height: float
    boxes: tuple[Box, ...]
    edges: tuple[Edge, ...] = ()


def build(plot: ActionPlot, library: Library | None, *, rules: bool, sideways: bool) -> Box:
    """The drawing of a plot.

    Args:
        plot: what to draw.
        library: where the plots it uses are found; without one, less is said about them.
        rules: whether to carry the plot's rules out, which needs the library; otherwise they are listed.
        sideways: from left to right instead of from top to bottom.

    Raises:
        UnknownNameError: a transition leads nowhere, or a rule or state names a plot that is not there.
    """
    expanded = library.expanded(plot) if library is not None and rules else plot
    added = {name for name, _, _ in expanded.walk()} - {name for name, _, _ in plot.walk()}
    inside = _Builder(expanded, library, frozenset(added), sideways=sideways).scope(expanded, ())
    notes = _notes(plot, shown=library is not None and rules)
    return _frame(plot, inside, notes)


def _notes(plot: ActionPlot, *, shown: bool) -> Box | None:
    """The rules that no edge shows: all that were not carried out, and those for what will be planned."""
    planned = any(isinstance(state, DynamicState) and state.goal is not None for _, state, _ in plot.walk())
    if not plot.rules or (shown and not planned):
        return None
    return rules_note(plot.rules, "rules, also for the steps of plans" if planned else "rules")


def _frame(plot: ActionPlot, inside: _Inside, notes: Box | None) -> Box:
    room = max(inside.width, notes.width if notes is not None else 0.0)
    top = header(plot, room)
    width = max(room + 2 * PAD, top.width)
    content = _wrapped(inside).moved((width - inside.width) / 2, top.height + PAD)
    boxes, height = content.boxes, top.height + PAD + inside.height + PAD
    if notes is not None:
        boxes, height = (*boxes, notes.moved(PAD, height)), height + notes.height + PAD
    kind = BoxKind.GENERATED if plot.generated else BoxKind.PLOT
    frame = Box(kind, plot.name, 0, 0, width, height, top.texts, (top.height,), top.title)
    return replace(frame, boxes=boxes, edges=content.edges)


def _wrapped(inside: _Inside) -> Box:
    return Box(BoxKind.REGION, "", 0, 0, inside.width, inside.height, boxes=inside.boxes, edges=inside.edges)


class _Builder:
    def __init__(self, plot: ActionPlot, library: Library | None, added: frozenset[str], *, sideways: bool) -> None:
        self._plot, self._library = plot, library
        self._added, self._sideways = added, sideways

    def scope(self, scope: Scope, path: Path) -> _Inside:
        """The states of a scope with their edges, laid out."""
        states, initial = scope.states, initial_of(scope)
        self._known(initial, states, (*path, "initial"))
        links = bundles(states, self._added, terse=self._plot.generated)
        for link in links:
            self._known(link.target, states, (*path, "states", link.source))
        boxes = {"": dot(), **{name: self._state(name, state, path) for name, state in states.items()}}
        links.insert(0, initial_bundle(initial))
        if not any(box.kind in HULLS for box in boxes.values()):
            return _arranged(boxes, links, sideways=self._sideways)
        # Around large boxes, the direction in which the whole is closer to a square reads better.
        both = [_arranged(boxes, links, sideways=sideways) for sideways in (self._sideways, not self._sideways)]
        return min(both, key=lambda inside: max(inside.width, inside.height))

    def _known(self, target: str, states: Mapping[str, AnyState], path: Path) -> None:
        if target not in states:
            raise UnknownNameError(
                f"there is no state '{target}' here", place=self._plot.place(path), found=target, valid=states
            )

    def _state(self, name: str, state: AnyState, path: Path) -> Box:
        here = (*path, "states", name)
        if isinstance(state, FinalState):
            return final_card(name, state)
        if isinstance(state, HistoryState):
            return history_card(name, state)
        if isinstance(state, CompositeState):
            return self._hull(BoxKind.COMPOSITE, name, state, self.scope(state, here))
        if isinstance(state, OrthogonalState):
            regions = [self._region(key, one, (*here, "regions", key)) for key, one in state.regions.items()]
            return self._hull(BoxKind.ORTHOGONAL, name, state, _side_by_side(regions))
        if isinstance(state, Connector):
            return diamond(name, state)
        return leaf_card(name, state, self._library, rule=name in self._added, told=self._plot.generated)

    def _hull(self, kind: BoxKind, name: str, state: State, inside: _Inside) -> Box:
        """A state around an inside; regions reach up to its border, states do not."""
        pad = 0.0 if kind is BoxKind.ORTHOGONAL else PAD
        head = card(kind, name, action_rows(state), about=state.about or "")
        width = max(head.width, inside.width + 2 * pad)
        moved = _wrapped(inside).moved((width - inside.width) / 2, head.height + pad)
        return replace(
            _widened(head, width, head.height + inside.height + 2 * pad),
            lines=(*head.lines, head.height),
            boxes=moved.boxes,
            edges=moved.edges,
        )

    def _region(self, name: str, region: Region, path: Path) -> Box:
        inside = self.scope(region, path)
        title = Text(10.0, 16.0, name, TextStyle.ABOUT)
        hull = _wrapped(inside).moved(PAD, REGION_TITLE + 4)
        width, height = inside.width + 2 * PAD, inside.height + REGION_TITLE + 4 + PAD
        return replace(hull, name=name, x=0, y=0, width=width, height=height, texts=(title,))


def _arranged(boxes: Mapping[str, Box], links: list[Bundle], *, sideways: bool) -> _Inside:
    loops = {link.source: link for link in links if link.source == link.target}
    others = [link for link in links if link.source != link.target]
    roomy = [_roomy(box, loops.get(name), sideways=sideways) for name, box in boxes.items()]
    if sideways:
        roomy = [name_beside(box) if box.kind is BoxKind.FINAL else box for box in roomy]
    number = {name: index for index, name in enumerate(boxes)}
    drawing = arrange(
        [_node(box, loops.get(box.name), sideways=sideways) for box in roomy],
        [_link(number[one.source], number[one.target], one) for one in others],
        sideways=sideways,
    )
    placed = [box.moved(*corner) for box, corner in zip(roomy, drawing.corners, strict=True)]
    edges = [link.along(route) for link, route in zip(others, drawing.routes, strict=True)]
    edges += [loop(one, placed[number[name]], sideways=sideways) for name, one in loops.items()]
    return _Inside(drawing.width, drawing.height, tuple(placed), tuple(edges))


def _link(source: int, target: int, bundle: Bundle) -> Link:
    # What was foreseen is the thread to follow; what rules do about failures goes around it.
    return Link(source, target, bundle.width, bundle.height, weight=0.1 if bundle.rule else 1.0)


def _node(box: Box, own: Bundle | None, *, sideways: bool) -> Node:
    beside = room_for_loop(own, sideways=sideways) if own is not None else 0.0
    pointed, diamond = box.kind in {BoxKind.INITIAL, BoxKind.FINAL}, box.kind is BoxKind.CHOICE
    return Node(
        box.width, box.height, beside, pointed=pointed, diamond=diamond, last=box.kind is BoxKind.FINAL
    )


def _roomy(box: Box, own: Bundle | None, *, sideways: bool) -> Box:
    """A box as large as the label of its loop, so that this keeps clear of other boxes."""
    if own is None:
        return box
    width, height = (own.width, 0.0) if sideways else (0.0, own.height)
    return _widened(box, max(box.width, width), max(box.height, height))


def _widened(box: Box, width: float, height: float) -> Box:
    texts = tuple(replace(text, x=text.x + (width - box.width) / 2) if text.centred else text for text in box.texts)
    return replace(box, width=width, height=height, texts=texts)


def _side_by_side(regions: list[Box]) -> _Inside:
    """Regions in a row or in a column, whichever is closer to a square; all reach from border to border."""
    widths, heights = [one.width for one in regions], [one.height for one in regions]
    in_row = max(sum(widths), *heights) <= max(*widths, sum(heights))
    width = sum(widths) if in_row else max(widths)
    height = max(heights) if in_row else sum(heights)
    boxes, x, y = [], 0.0, 0.0
    for one in regions:
        full = replace(one, height=height) if in_row else replace(one, width=width)
        boxes.append(full.moved(x, y))
        x, y = (x + one.width, y) if in_row else (x, y + one.height)
    return _Inside(width, height, tuple(boxes))
