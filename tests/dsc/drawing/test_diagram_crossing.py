"""Edges across borders lead from the border of their source to the border of their target, wherever these are."""

from __future__ import annotations

from itertools import pairwise

import pytest
from dsc_charts import PROPERTY, plot
from dsc_drawings import apart, area, boxes, edges, inside, on_border
from hypothesis import given, settings
from hypothesis import strategies as st

from dsc.drawing import draw, lay_out
from dsc.drawing.layout import Box, BoxKind, DrawnEdge
from dsc.drawing.maze import Maze
from dsc.model.plot import ActionPlot
from dsc.model.states import HistoryState
from dsc.model.transitions import TransitionSource
from knowledge_base.errors import UnknownNameError

# -- random charts -----------------------------------------------------------------------------------------


@st.composite
def charts(draw_: st.DrawFn) -> ActionPlot:
    """States in states, with transitions from anywhere to anywhere, several targets, histories, deep initials."""
    names: list[str] = []
    states = draw_(scopes(names, 3))
    for name, state in _sources(states):
        state["on"] = draw_(st.dictionaries(st.sampled_from("uvw"), _transitions(names), max_size=2))
        state["about"] = name
    form = {"plot": "random", "dialect": "scxml", "states": states}
    return ActionPlot.model_validate(form)


@st.composite
def scopes(draw_: st.DrawFn, names: list[str], depth: int) -> dict[str, dict[str, object]]:
    return dict(draw_(_states(names, depth)) for _ in range(draw_(st.integers(1, 3))))


@st.composite
def _states(draw_: st.DrawFn, names: list[str], depth: int) -> tuple[str, dict[str, object]]:
    name = f"s{len(names)}"
    names.append(name)
    kind = draw_(st.sampled_from(["simple", "final"] + ["composite", "regions"] * 2 * (depth > 0)))
    if kind == "final":
        return name, {"final": True}
    if kind == "simple":
        return name, {}
    first = len(names)
    if kind == "composite":
        inner = draw_(scopes(names, depth - 1))
        initial = draw_(st.sampled_from(names[first:]))
        inner |= draw_(_histories(names, first))
        return name, {"states": inner, "initial": initial}
    regions = {f"r{number}": {"states": draw_(scopes(names, depth - 1))} for number in range(2)}
    return name, {"regions": regions, "connectors": draw_(_histories(names, first))}


@st.composite
def _histories(draw_: st.DrawFn, names: list[str], first: int) -> dict[str, dict[str, object]]:
    targets = draw_(st.lists(st.sampled_from(names[first:]), max_size=1))
    made: dict[str, dict[str, object]] = {
        f"h{len(names)}": {"history": draw_(st.sampled_from(["deep", "shallow"])), "to": to} for to in targets
    }
    names += made
    return made


def _transitions(names: list[str]) -> st.SearchStrategy[dict[str, object]]:
    somewhere = st.sampled_from(names)
    return st.fixed_dictionaries({"to": somewhere, "also": st.lists(somewhere, max_size=1), "internal": st.booleans()})


def _sources(states: dict[str, dict[str, object]]) -> list[tuple[str, dict[str, object]]]:
    found = []
    for name, state in states.items():
        if not {"final", "history"} & state.keys():
            found.append((name, state))
        for scope in (state, *state.get("regions", {}).values()):  # type: ignore[attr-defined]
            found += _sources(scope.get("states", {}))
    return found


directions = st.sampled_from(["down", "right"])


def shape(root: Box, around: Box, name: str) -> Box:
    """The box, diamond or circle that edges of a state meet; without a name the dot in `around`."""
    if not name:
        return next(box for box in around.boxes if box.kind is BoxKind.INITIAL)
    (box,) = [box for box in boxes(root) if box.name == name and box.kind is not BoxKind.REGION]
    return box.boxes[0] if box.kind in {BoxKind.FINAL, BoxKind.HISTORY} else box


@settings(PROPERTY, max_examples=8)
@given(charts(), directions)
def test_every_end_of_an_edge_lies_on_the_border_of_its_state(chart: ActionPlot, direction: str) -> None:
    root = lay_out(chart, direction=direction)  # type: ignore[arg-type]
    for box in boxes(root):
        for edge in box.edges:
            assert on_border(edge.points[0], shape(root, box, edge.source))
            assert on_border(edge.points[-1], shape(root, box, edge.target))


@settings(PROPERTY, max_examples=8)
@given(charts(), directions)
def test_edges_run_straight_inside_the_state_around_and_through_no_state(chart: ActionPlot, direction: str) -> None:
    root = lay_out(chart, direction=direction)  # type: ignore[arg-type]
    leaves = [box for box in boxes(root) if not box.boxes and box.kind is not BoxKind.REGION]
    for box in boxes(root):
        for piece in (piece for edge in box.edges for piece in pairwise(edge.points)):
            (x, y), (u, v) = piece
            assert x == pytest.approx(u) or y == pytest.approx(v)
            segment = (min(x, u), min(y, v), abs(x - u), abs(y - v))
            assert inside(segment, area(box))
            assert all(apart(segment, area(leaf)) for leaf in leaves)


@settings(PROPERTY, max_examples=8)
@given(charts(), directions)
def test_every_transition_is_drawn_to_all_its_targets_and_every_caption_is_there(
    chart: ActionPlot, direction: str
) -> None:
    drawn = edges(lay_out(chart, direction=direction))  # type: ignore[arg-type]
    for name, state, _ in chart.walk():
        if isinstance(state, HistoryState):
            assert (name, state.target) in {(edge.source, edge.target) for edge in drawn}
        for event, transition in state.transitions() if isinstance(state, TransitionSource) else ():
            for target in transition.targets:
                assert any((edge.source, edge.target) == (name, target) for edge in drawn)
            said = [words(edge) for edge in drawn if (edge.source, edge.target) == (name, transition.target)]
            mark = " {internal}" if transition.internal else ""
            assert any(event in text and mark in text for text in said)


def words(edge: DrawnEdge) -> str:
    return " ".join(text.text for text in edge.label)


# -- single charts -----------------------------------------------------------------------------------------


def drawn(text: str, direction: str = "down") -> tuple[Box, dict[tuple[str, str], DrawnEdge]]:
    root = lay_out(plot("plot: p\ndialect: scxml\nstates:\n" + text), direction=direction)  # type: ignore[arg-type]
    return root, {(edge.source, edge.target): edge for edge in edges(root)}


def crosses(edge: DrawnEdge, box: Box) -> bool:
    """Whether it passes the border of a box somewhere between its ends."""
    held = [inside((*point, 0, 0), area(box), slack=-0.5) for point in edge.points]
    return len(set(held)) > 1


def named(root: Box, name: str) -> Box:
    return next(box for box in boxes(root) if box.name == name)


DEEP = """
  a: {on: {x: b2, y: c}}
  b:
    initial: b2
    states:
      b1:
      c: {states: {d: {on: {up: b}}, b2: {on: {x: {to: a, when: (p)}}}}}
    on: {down: {to: d, internal: true}, again: b}
"""


def test_an_edge_ends_at_the_inner_state_and_not_at_the_one_around() -> None:
    root, found = drawn(DEEP)
    assert crosses(found["a", "b2"], named(root, "b"))
    assert crosses(found["a", "b2"], named(root, "c"))
    assert not crosses(found["a", "c"], named(root, "c"))
    assert words(found["b2", "a"]) == "x [(p)]"


def test_a_deep_initial_state_has_the_arrow_of_the_dot() -> None:
    root, found = drawn(DEEP)
    assert on_border(found["", "b2"].points[-1], named(root, "b2"))
    assert crosses(found["", "b2"], named(root, "c"))


@pytest.mark.parametrize("direction", ["down", "right"])
def test_loops_of_one_state_lead_in_and_out_side_by_side(direction: str) -> None:
    root, found = drawn(DEEP, direction)
    loops = [found["b", "d"], found["d", "b"], found["b", "b"]]
    assert [words(edge) for edge in loops] == ["down {internal}", "up", "again"]
    areas = [edge.area for edge in loops if edge.area is not None]
    assert all(apart(one, other) for one in areas for other in areas if one is not other)
    assert all(apart(one, area(named(root, "b"))) for one in areas)


def test_a_fork_says_its_event_once_and_shares_the_way_to_the_border() -> None:
    root, found = drawn("""
  a: {on: {go: {to: b, also: [c]}}}
  o: {regions: {left: {states: {u: , b: }}, right: {states: {v: , c: }}}}
""")
    first, second = found["a", "b"], found["a", "c"]
    assert words(first) == "go"
    assert second.label == ()
    assert first.points[0] == second.points[0]
    assert on_border(first.points[-1], named(root, "b"))
    assert on_border(second.points[-1], named(root, "c"))


def test_between_regions_an_edge_leaves_the_state_around_and_comes_back() -> None:
    root, found = drawn("  o: {regions: {left: {states: {a: {on: {x: b}}}}, right: {states: {b: }}}}")
    assert crosses(found["a", "b"], named(root, "o"))
    assert found["a", "b"].area is not None
    assert apart(found["a", "b"].area, area(named(root, "o")))


HISTORIES = """
  a: {on: {back: h, whole: all}}
  o:
    regions:
      left: {states: {b: {states: {c: , d: , h: {history: deep, to: d, do: [{emit: began}]}}}}}
      right: {states: {e: }}
    connectors: {all: {history: shallow, to: c}}
"""


@pytest.mark.parametrize("direction", ["down", "right"])
def test_histories_are_circles_with_their_default(direction: str) -> None:
    root, found = drawn(HISTORIES, direction)
    circles = {box.name: box for box in boxes(root) if box.kind is BoxKind.HISTORY}
    assert [circles[name].boxes[0].texts[0].text for name in ("h", "all")] == ["H*", "H"]
    assert [text.text for text in circles["h"].texts] == ["h", "/ ^began"]
    for ends in (("h", "d"), ("all", "c"), ("a", "h"), ("a", "all")):
        edge = found[ends]
        for point, name in zip((edge.points[0], edge.points[-1]), ends, strict=True):
            assert on_border(point, circles[name].boxes[0] if name in circles else named(root, name))


def test_the_label_of_an_edge_into_a_state_is_drawn_over_the_state() -> None:
    svg = draw(plot("plot: p\ndialect: scxml\nstates:\n  a: {on: {x: b}}\n  c: {states: {b: }}"))
    assert svg.index('class="label mid"') > svg.index(">b</text>")


def test_a_target_that_is_nowhere_is_named_with_its_nearest() -> None:
    with pytest.raises(UnknownNameError, match="there is no state 'inne' here; did you mean 'inner'"):
        drawn("  a: {on: {x: {to: a, also: [inne]}}}\n  c: {states: {inner: }}")


def test_a_way_goes_around_things_where_it_can() -> None:
    places = [0.0, 10.0, 20.0, 30.0]
    maze = Maze(places, places, [(5.0, -5.0, 10.0, 30.0)], [])
    way = maze.way((0.0, 0.0), {((30.0, 0.0), False): 0.0}, vertical=False)
    assert (way[0], way[-1]) == ((0.0, 0.0), (30.0, 0.0))
    assert [point for point in way if point[0] == 10.0] == [(10.0, 30.0)]


def test_a_way_leads_through_things_where_there_is_no_other() -> None:
    maze = Maze([0.0, 10.0, 20.0], [0.0], [(5.0, -5.0, 10.0, 30.0)], [])
    goal = {((20.0, 0.0), False): 0.0}
    assert maze.way((0.0, 0.0), goal, vertical=False) == [(0.0, 0.0), (10.0, 0.0), (20.0, 0.0)]


def test_a_way_crosses_a_line_and_does_not_run_on_it() -> None:
    maze = Maze([0.0, 10.0, 20.0], [0.0, 10.0], [], [((0.0, 0.0), (20.0, 0.0))])
    way = maze.way((0.0, 0.0), {((20.0, 0.0), True): 0.0}, vertical=True)
    assert way == [(0.0, 0.0), (0.0, 10.0), (10.0, 10.0), (20.0, 10.0), (20.0, 0.0)]
