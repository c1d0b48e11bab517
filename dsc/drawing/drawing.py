"""Drawing of a plot: each state is a box, and each scope is a layered drawing inside its state's box."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Literal

from dsc.drawing.captions import handler_text, rule_text
from dsc.drawing.cards import action_rows, card, diamond, dot, final_card, header, history_card, leaf_card, rules_note
from dsc.drawing.crossing import join, way_to
from dsc.drawing.layout import Box, BoxKind, Text, TextStyle
from dsc.drawing.scopes import EdgeBundle, ScopeNesting, ScopeSpan, arranged, bundles, contents, initial_bundle, widened
from dsc.drawing.svg import NO_MARKS, to_svg
from dsc.dynamic.library import Library
from dsc.dynamic.steps import is_planned
from dsc.model.plot import ActionPlot, Path, Scope, initial_of
from dsc.model.states import (
    AnyState,
    CompositeState,
    FinalState,
    HistoryState,
    OrthogonalState,
    Region,
    State,
)
from dsc.model.transitions import Connector
from knowledge_base.errors import UnknownNameError

PAD = 16.0
REGION_TITLE = 22.0
HULLS = frozenset({BoxKind.COMPOSITE, BoxKind.ORTHOGONAL})


def _notes(plot: ActionPlot, *, shown: bool) -> Box | None:
    """Return a list of the rules that no edge shows: unexpanded rules, and rules for steps of future plans."""
    planned = any(is_planned(state) for _, state, _ in plot.walk())
    rows = [rule_text(rule) for rule in plot.rules] if planned or not shown else []
    rows += [handler_text(handler) for handler in plot.handlers] if not shown else []
    about = "rules and handlers" if plot.handlers and not shown else "rules"
    about += ", also for the steps of plans" if planned and plot.rules else ""
    return rules_note(rows, about) if rows else None


def _frame(plot: ActionPlot, inside: Box, notes: Box | None) -> Box:
    room = max(inside.width, notes.width if notes is not None else 0.0)
    top = header(plot, room)
    width = max(room + 2 * PAD, top.width)
    content = inside.moved((width - inside.width) / 2, top.height + PAD)
    boxes, height = content.boxes, top.height + PAD + inside.height + PAD
    if notes is not None:
        boxes, height = (*boxes, notes.moved(PAD, height)), height + notes.height + PAD
    return replace(top, width=width, height=height, lines=(top.height,), boxes=boxes, edges=content.edges)


class _Builder:
    def __init__(self, plot: ActionPlot, library: Library | None, added: frozenset[str], *, sideways: bool) -> None:
        self._plot, self._library = plot, library
        self._added, self._sideways = added, sideways
        self._nesting = ScopeNesting(plot)
        self._bundles = self._by_scope()

    def _by_scope(self) -> dict[Path, list[EdgeBundle]]:
        """Return the edges of the plot by the path of the innermost scope that contains all ends of the edge."""
        states = {name: state for name, state, _ in self._plot.walk()}
        paths = {name: path for name, _, path in self._plot.walk()}
        among_regions = {name for name, path in paths.items() if path[-2] == "connectors"}
        scopes: dict[Path, list[EdgeBundle]] = {}
        for one in bundles(states, self._added, terse=self._plot.generated):
            for target in one.targets:
                self._require_known(target, list(states), paths[one.source])
            if one.source in among_regions:
                continue
            scopes.setdefault(self._nesting.common_scope((one.source, *one.targets)), []).append(one)
        return scopes

    def scope(self, scope: Scope, path: Path) -> Box:
        """Return a box with the layout of a scope's states and edges."""
        initial = initial_of(scope)
        self._require_known(initial, self._nesting.inside(path), (*path, "initial"))
        boxes = {"": dot(), **{name: self._state(name, state, path) for name, state in scope.states.items()}}
        edges = (initial_bundle(initial), *self._bundles.get(path, ()))
        spans = [span for one in edges for span in self._spans(path, one)]
        if not any(box.kind in HULLS for box in boxes.values()):
            return arranged(boxes, spans, sideways=self._sideways).finished()
        # A large box is easier to read if it is close to a square, so both directions are tried.
        both = [arranged(boxes, spans, sideways=sideways) for sideways in (self._sideways, not self._sideways)]
        return min(both, key=lambda draft: max(draft.width, draft.height)).finished()

    def _spans(self, scope: Path, bundle: EdgeBundle) -> Iterator[ScopeSpan]:
        """Yield one span for all targets of an edge; an invalid plot, with targets in several states, needs several."""
        holder = self._nesting.holder
        start, end = holder(scope, bundle.source), holder(scope, bundle.target)
        also = tuple(target for target in bundle.also if holder(scope, target) == end)
        yield ScopeSpan(replace(bundle, also=also), start, end)
        for target in bundle.also:
            if target not in also:
                yield ScopeSpan(EdgeBundle(bundle.source, target, (), bundle.rule), start, holder(scope, target))

    def _require_known(self, target: str, valid: list[str], path: Path) -> None:
        if target not in valid:
            raise UnknownNameError(
                f"there is no state '{target}' here", place=self._plot.place(path), found=target, valid=valid
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
            inside = _below([history_card(*one) for one in state.connectors.items()], _in_row(regions))
            hull = self._hull(BoxKind.ORTHOGONAL, name, state, inside)
            joins = [join(hull, each, one.target) for each, one in state.connectors.items() if way_to(hull, one.target)]
            return replace(hull, edges=tuple(joins))
        if isinstance(state, Connector):
            return diamond(name, state)
        return leaf_card(
            name, state, self._library, rule=name in self._added, told=self._plot.generated, emits=self._plot.emits
        )

    def _hull(self, kind: BoxKind, name: str, state: State, inside: Box) -> Box:
        """Return a state's box around its content; regions touch the box's border, states have a margin."""
        pad = 0.0 if kind is BoxKind.ORTHOGONAL else PAD
        head = card(kind, name, action_rows(state, self._plot.emits), about=state.about or "")
        width = max(head.width, inside.width + 2 * pad)
        moved = inside.moved((width - inside.width) / 2, head.height + pad)
        return replace(
            widened(head, width, head.height + inside.height + 2 * pad),
            lines=(*head.lines, head.height),
            boxes=moved.boxes,
            edges=moved.edges,
        )

    def _region(self, name: str, region: Region, path: Path) -> Box:
        inside = self.scope(region, path)
        title = Text(10.0, 16.0, name, TextStyle.ABOUT)
        hull = inside.moved(PAD, REGION_TITLE + 4)
        width, height = inside.width + 2 * PAD, inside.height + REGION_TITLE + 4 + PAD
        return replace(hull, name=name, x=0, y=0, width=width, height=height, texts=(title,))


def _in_row(regions: list[Box]) -> Box:
    """Return the regions in a row or in a column, so that the result is closer to a square; no region leaves a gap."""
    widths, heights = [one.width for one in regions], [one.height for one in regions]
    in_row = max(sum(widths), *heights) <= max(*widths, sum(heights))
    width = sum(widths) if in_row else max(widths)
    height = max(heights) if in_row else sum(heights)
    boxes, x, y = [], 0.0, 0.0
    for one in regions:
        full = replace(one, height=height) if in_row else replace(one, width=width)
        boxes.append(full.moved(x, y))
        x, y = (x + one.width, y) if in_row else (x, y + one.height)
    return contents(width, height, boxes)


def _below(histories: Sequence[Box], regions: Box) -> Box:
    """Return a box with the histories of an orthogonal state, and its regions below the histories."""
    if not histories:
        return regions
    boxes, x = [], PAD
    for one in histories:
        boxes.append(one.moved(x, PAD))
        x += one.width + PAD
    top = max(one.height for one in histories) + 2 * PAD
    stretch = max(x / regions.width, 1.0)
    boxes += [replace(one, width=one.width * stretch).moved(one.x * (stretch - 1), top) for one in regions.boxes]
    return contents(regions.width * stretch, regions.height + top, boxes)


Direction = Literal["down", "right"]


def draw(
    plot: ActionPlot,
    library: Library | None = None,
    *,
    rules: bool = True,
    direction: Direction = "down",
    marks: Mapping[str, str] = NO_MARKS,
) -> str:
    """Return the plot as SVG; equal arguments give equal text.

    Args:
        plot: the plot to draw.
        library: provider of the plots to which `plot` refers. With a library, rules are drawn as their expanded states
            and transitions, and dynamic states show each candidate's condition.
        rules: whether to draw rules in expanded form; `False` lists the rules as text.
        direction: direction of the flow of control.
        marks: marks of states by name: `active`, `added`, `removed`, `changed`.

    Raises:
        UnknownNameError: a transition refers to a missing state, or a rule or state to a missing plot.
    """
    return to_svg(lay_out(plot, library, rules=rules, direction=direction), marks)


def lay_out(
    plot: ActionPlot, library: Library | None = None, *, rules: bool = True, direction: Direction = "down"
) -> Box:
    """Return the drawing as nested boxes, for renderers other than SVG; arguments and errors as for `draw`."""
    expanded = library.expanded(plot) if library is not None and rules else plot
    added = {name for name, _, _ in expanded.walk()} - {name for name, _, _ in plot.walk()}
    builder = _Builder(expanded, library, frozenset(added), sideways=direction == "right")
    return _frame(plot, builder.scope(expanded, ()), _notes(plot, shown=library is not None and rules))
