"""Drawings say everything once, overlap nothing, and come out the same every time."""

from __future__ import annotations

from itertools import combinations, pairwise
from pathlib import Path
from time import process_time
from xml.etree import ElementTree as ET

import pytest
from dsc_drawings import apart, area, boxes, edges, inside, on_border
from hypothesis import given, settings
from hypothesis import strategies as st

from dsc.drawing import draw, lay_out
from dsc.drawing.layered.arrange import Net, assign_tracks
from dsc.drawing.layered.columns import fit
from dsc.drawing.layout import Box, BoxKind, TextStyle, pack, shorten, text_width
from dsc.dynamic.library import Library
from dsc.model.plot import ActionPlot
from dsc.model.states import State
from dsc.text.plot_files import load_library, parse_plot
from knowledge_base.errors import UnknownNameError

SHIPPED = Path(__file__).parents[3] / "domains" / "clean_up_table" / "plots"
NS = "{http://www.w3.org/2000/svg}"
HULLS = {BoxKind.PLOT, BoxKind.GENERATED, BoxKind.COMPOSITE, BoxKind.ORTHOGONAL, BoxKind.REGION}
EVENTS = ("done", "failed", "seen", "nothing_found", "gone")


@pytest.fixture(scope="module")
def library() -> Library:
    return load_library(SHIPPED)


def texts(svg: str, style: TextStyle) -> list[str]:
    found = ET.fromstring(svg).iter(f"{NS}text")  # noqa: S314  our own text
    return [one.text or "" for one in found if style in (one.get("class") or "").split()]


def everything(svg: str) -> str:
    return " ".join(ET.fromstring(svg).itertext())  # noqa: S314  our own text


# -- random plots ------------------------------------------------------------------------------------------


@st.composite
def scopes(draw_: st.DrawFn, prefix: str = "s", depth: int = 0) -> dict[str, object]:
    """States of one scope with random transitions among them, and composites a few levels deep."""
    names = [f"{prefix}{number}" for number in range(draw_(st.integers(1, 6 - depth)))]
    return {name: draw_(_states(name, names, depth)) for name in names}


@st.composite
def _states(draw_: st.DrawFn, name: str, siblings: list[str], depth: int) -> dict[str, object]:
    kinds = ["simple", "use", "dynamic", "final", "choice", "select"] + ["composite", "regions"] * (depth < 2)
    kind = draw_(st.sampled_from(kinds))
    if kind == "final":
        return {"final": True}
    if kind in {"choice", "select"}:
        return draw_(_connectors(kind, [other for other in siblings if other != name] or [name]))
    targets = st.dictionaries(st.sampled_from(EVENTS), st.sampled_from(siblings), max_size=4)
    state: dict[str, object] = {"on": draw_(targets)}
    if draw_(st.booleans()):
        state["entry"] = {"trigger": "arm.move", "with": {"to": "a place with a rather long name"}}
    if kind == "use":
        state |= {"use": "other"}
    elif kind == "dynamic":
        state |= {"dynamic": ["one", "other"], "goal": "(forall (?o - item) (tidy ?o))"}
    elif kind == "composite":
        state |= {"states": draw_(scopes(f"{name}_", depth + 1))}
    elif kind == "regions":
        state |= {"regions": {f"r{n}": {"states": draw_(scopes(f"{name}_{n}_", depth + 1))} for n in range(2)}}
    return state


@st.composite
def _connectors(draw_: st.DrawFn, kind: str, others: list[str]) -> dict[str, object]:
    targets = draw_(st.lists(st.sampled_from(others), min_size=1, max_size=4))
    if kind == "choice":
        *guarded, last = targets
        return {"choice": [{"when": f"(is a{number})", "to": one} for number, one in enumerate(guarded)] + [last]}
    cases = {f"case{number}": one for number, one in enumerate(targets)}
    return {
        "select": draw_(st.sampled_from(["?n", "(+ ?event.a_rather_long_name ?n)"])),
        "cases": cases,
        "else": others[0],
    }


plots = scopes().map(lambda states: ActionPlot.model_validate({"plot": "random", "states": states}))
directions = st.sampled_from(["down", "right"])


@settings(max_examples=40, deadline=None, derandomize=True)
@given(plots, directions)
def test_boxes_and_labels_lie_inside_their_parent_and_overlap_nothing(plot: ActionPlot, direction: str) -> None:
    for box in boxes(lay_out(plot, direction=direction)):  # type: ignore[arg-type]
        labels = [edge.area for edge in box.edges if edge.area is not None]
        parts = [area(inner) for inner in box.boxes] + labels
        assert all(inside(part, area(box)) for part in parts)
        assert all(apart(one, other) for one, other in combinations(parts, 2))
        if box.kind not in HULLS:
            for text in box.texts:
                half = text_width(text.text, text.style) / (2 if text.centred else 1)
                left = text.x - half if text.centred else text.x
                assert inside((left, text.y, half, 0), area(box))


@settings(max_examples=40, deadline=None, derandomize=True)
@given(plots, directions)
def test_edges_begin_and_end_at_their_states_and_run_through_none(plot: ActionPlot, direction: str) -> None:
    for box in boxes(lay_out(plot, direction=direction)):  # type: ignore[arg-type]
        states = {inner.name: inner for inner in box.boxes}
        for edge in box.edges:
            assert on_border(edge.points[0], states[edge.source])
            assert on_border(edge.points[-1], states[edge.target])
            for (x1, y1), (x2, y2) in pairwise(edge.points):
                assert x1 == pytest.approx(x2) or y1 == pytest.approx(y2)
                segment = (min(x1, x2), min(y1, y2), abs(x1 - x2), abs(y1 - y2))
                assert all(apart(segment, core(inner)) for inner in box.boxes)


def core(box: Box) -> tuple[float, float, float, float]:
    """What no edge may touch; a diamond does not reach into its corners."""
    if box.kind is not BoxKind.CHOICE:
        return area(box)
    return box.x + box.width / 4, box.y + box.height / 4, box.width / 2, box.height / 2


@settings(max_examples=25, deadline=None, derandomize=True)
@given(plots)
def test_every_state_is_named_once_and_every_event_is_written(plot: ActionPlot) -> None:
    svg = draw(plot)
    states = {name: state for name, state, _ in plot.walk()}
    assert sorted(texts(svg, TextStyle.NAME)) == sorted(states)
    drawn = edges(lay_out(plot))
    for name, state in states.items():
        for event, transition in state.transitions() if isinstance(state, State) else ():
            (edge,) = [one for one in drawn if (one.source, one.target) == (name, transition.target)]
            assert event in " ".join(text.text for text in edge.label)
    assert draw(plot.model_copy(deep=True)) == svg


# -- the shipped plots -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [file.stem for file in sorted(SHIPPED.glob("*.yaml"))])
def test_shipped_plots_are_drawn_with_all_states_that_rules_add(name: str, library: Library) -> None:
    plot = library.plot(name)
    svg = draw(plot, library)
    expanded = library.expanded(plot)
    assert sorted(texts(svg, TextStyle.NAME)) == sorted(state for state, _, _ in expanded.walk())
    said = everything(svg)
    for _, state, _ in expanded.walk():
        for event, transition in state.transitions() if isinstance(state, State) else ():
            assert event in said or event in {"always", "after"}
            assert transition.rule is None or transition.rule in said
    assert draw(plot, library) == svg


def test_recoveries_are_tinted_and_their_rule_stands_at_the_edge(library: Library) -> None:
    root = lay_out(library.plot("report"), library)
    recovery = next(box for box in root.boxes if box.rule)
    (edge,) = [edge for edge in root.edges if edge.target == recovery.name]
    assert edge.rule
    assert edge.label[0].text == "no_path: wait, retry"
    assert edge.label[1].text == "[at most 4 times]"
    assert not any(edge.rule for edge in root.edges if edge.target == "told")


def test_rules_that_no_edge_shows_are_listed(library: Library) -> None:
    plot = library.plot("report")
    assert not any(box.kind is BoxKind.NOTE for box in lay_out(plot, library).boxes)
    without = lay_out(plot, library, rules=False)
    (note,) = [box for box in without.boxes if box.kind is BoxKind.NOTE]
    assert any("no_path → wait, retry (at most 4 times)" in text.text for text in note.texts)
    assert not any(box.rule for box in without.boxes)


def test_dynamic_states_say_when_candidates_fit(library: Library) -> None:
    plot = library.plot("search")
    known, unknown = everything(draw(plot, library)), everything(draw(plot))
    assert "◇ drive_direct(?surface) [(and (surface ?to)" in known
    assert "◇ drive_direct(?surface)" in unknown
    assert "[(and (surface ?to)" not in unknown


# -- single things -----------------------------------------------------------------------------------------


def plot_of(states: str) -> ActionPlot:
    return parse_plot(f"plot: p\nvariables: {{n: number}}\nstates:\n{states}")


def test_long_guards_are_shortened_and_the_whole_is_in_the_tooltip() -> None:
    guard = "(and " + " ".join(f"(on cup{n} table)" for n in range(30)) + ")"
    (edge,) = [e for e in lay_out(plot_of(f"  a: {{on: {{x: {{to: b, when: '{guard}'}}}}}}\n  b:")).edges if e.label]
    assert edge.label[-1].text.endswith("…")
    assert f"[{guard}]" in edge.title


def test_transitions_between_two_states_share_an_edge_and_equal_ones_a_line() -> None:
    plot = plot_of("  a: {on: {x: b, y: b, z: {to: b, assign: {n: 1}}}, after: {seconds: 2.5, to: b}}\n  b:")
    (edge,) = [edge for edge in lay_out(plot).edges if edge.source == "a"]
    assert [text.text for text in edge.label] == ["x, y, after 2.5 s", "z / n := 1"]


def test_a_transition_without_a_target_is_written_in_its_state() -> None:
    root = lay_out(plot_of("  a: {on: {x: {assign: {n: 1}}, y: a}}"))
    assert "x / n := 1" in [text.text for text in root.boxes[1].texts]
    (loop,) = [edge for edge in root.edges if edge.source == "a"]
    assert loop.target == "a"


def test_guardless_alternatives_say_else() -> None:
    root = lay_out(plot_of("  a: {always: [{to: b, when: (< ?n 1)}, c]}\n  b:\n  c:"))
    said = {edge.target: [text.text for text in edge.label] for edge in root.edges if edge.source}
    assert said == {"b": ["[(< ?n 1)]"], "c": ["[else]"]}


CHOICES = """
  a: {on: {x: which, y: first}, at_least: 2, every: [{seconds: 0.5, assign: {n: 1}}, {seconds: ?n, to: d}]}
  which:
    select: ?event.kind
    cases: {cup: b, can: b, 3: {to: c, when: (< ?n 1)}, Big Cup: a}
    else: {to: d, pass: {item: ?n}, clear: [box, "cup*"]}
  first: {choice: [{when: (< ?n 1), to: b}, a]}
  b: {on_break: {switch: arm, to: up}, exit: {switch: arm, to: down}, on: {x: d}}
  c: {on: {x: d}}
  d: {final: true}
"""


def test_connectors_are_diamonds_that_say_what_they_select() -> None:
    root = lay_out(plot_of(CHOICES))
    diamonds = {box.name: [text.text for text in box.texts] for box in root.boxes if box.kind is BoxKind.CHOICE}
    assert diamonds == {"which": ["which", "?event.kind"], "first": ["first"]}
    assert draw(plot_of(CHOICES)).count('<g class="choice">') == 2


def test_the_cases_of_a_selection_stand_at_its_edges_by_their_values() -> None:
    root = lay_out(plot_of(CHOICES))
    said = {(edge.source, edge.target): [text.text for text in edge.label] for edge in root.edges if edge.source}
    assert said["which", "b"] == ["cup, can"]
    assert said["which", "c"] == ["3 [(< ?n 1)]"]
    assert said["which", "a"] == ['"Big Cup"']
    assert said["which", "d"] == ["[else] / pass item;", "clear box, cup*"]
    assert said["first", "b"] == ["[(< ?n 1)]"]
    assert said["first", "a"] == ["[else]"]
    (edge,) = [edge for edge in root.edges if (edge.source, edge.target) == ("which", "d")]
    assert edge.title == "[else] / pass item = ?n; clear box, cup*"


@pytest.mark.parametrize("direction", ["down", "right"])
def test_edges_into_a_diamond_share_no_point_with_edges_out_of_it(direction: str) -> None:
    plot = plot_of("  c: {choice: [{when: (< ?n 1), to: a}, b]}\n  a: {on: {x: c}}\n  b: {on: {x: c}}")
    drawn = lay_out(plot, direction=direction).edges  # type: ignore[arg-type]
    leaving = {edge.points[0] for edge in drawn if edge.source == "c"}
    coming = {edge.points[-1] for edge in drawn if edge.target == "c"}
    assert not leaving & coming


def test_times_and_breaks_stand_in_the_state() -> None:
    rows = {box.name: [text.text for text in box.texts[1:]] for box in lay_out(plot_of(CHOICES)).boxes}
    assert rows["a"] == ["≥ 2 s", "every 0.5 s / n := 1"]
    assert rows["b"] == ["exit / arm → down", "break / arm → up"]
    (edge,) = [edge for edge in lay_out(plot_of(CHOICES)).edges if (edge.source, edge.target) == ("a", "d")]
    assert [text.text for text in edge.label] == ["every ?n s"]


def test_outputs_stand_in_the_header() -> None:
    plot = parse_plot("plot: p\noutputs: {where: place, n: {type: number, initial: 0}}\nstates: {a: {final: true}}")
    assert "outputs: where: place, n: number" in texts(draw(plot), TextStyle.DETAIL)


def test_generated_plots_are_tinted_and_tell_their_steps() -> None:
    states = {"step_1": {"about": "(pick-up cup)", "dynamic": ["pick"], "on": {"done": "end"}}, "end": {"final": True}}
    plot = ActionPlot.model_validate({"plot": "plan", "states": states, "generated": True})
    root = lay_out(plot)
    assert root.kind is BoxKind.GENERATED
    assert "(pick-up cup)" in [text.text for text in root.boxes[1].texts]


@pytest.mark.parametrize("name", ["größe", "状態", "a.b-c"])
def test_any_name_and_text_make_well_formed_xml(name: str) -> None:
    about = '<a & b> "c" ]]> bell\x07 \ud800 end'
    svg = draw(ActionPlot.model_validate({"plot": "p", "about": about, "states": {name: {"about": about}}}))
    assert texts(svg, TextStyle.NAME) == [name]
    assert texts(svg, TextStyle.ABOUT) == ['<a & b> "c" ]]> bell  end']
    svg.encode()


def test_a_transition_to_nowhere_is_a_clear_error() -> None:
    with pytest.raises(UnknownNameError, match=r"there is no state 'loook' here; did you mean 'look'"):
        draw(plot_of("  a: {on: {x: loook}}\n  look:"))


def test_five_hundred_states_take_seconds() -> None:
    count = 500
    states = {
        f"s{n}": {"on": {f"e{k}": f"s{(n + (n * (7 * k + 1) + 11 * k) % 14 - 5) % count}" for k in range(2)}}
        for n in range(count)
    }
    plot = ActionPlot.model_validate({"plot": "large", "states": states})
    start = process_time()
    svg = draw(plot)
    assert process_time() - start < 10
    assert len(texts(svg, TextStyle.NAME)) == count


numbers = st.integers(-50, 50).map(float)


@given(st.lists(st.tuples(numbers, st.integers(1, 5)), min_size=1, max_size=5), st.integers(0, 9))
def test_fitted_positions_keep_their_distance_and_cannot_be_improved_alone(
    wanted: list[tuple[float, int]], distance: int
) -> None:
    places = fit([[(value, float(weight))] for value, weight in wanted], [float(distance)] * (len(wanted) - 1))
    assert all(b - a >= distance - 1e-9 for a, b in pairwise(places))

    def cost(moved: list[float]) -> float:
        return sum(weight * abs(place - value) for place, (value, weight) in zip(moved, wanted, strict=True))

    for number in range(len(places)):
        for step in (-1.0, 1.0):
            moved = [place + step * (index == number) for index, place in enumerate(places)]
            if all(b - a >= distance for a, b in pairwise(moved)):
                assert cost(moved) >= cost(places) - 1e-9


nets = st.builds(
    Net, st.lists(numbers, min_size=1, max_size=3).map(tuple), st.lists(numbers, min_size=1, max_size=3).map(tuple)
)


@given(st.lists(nets, max_size=50))
def test_lines_that_overlap_never_share_a_track(lines: list[Net]) -> None:
    tracks = assign_tracks(lines)
    for (one, a), (other, b) in combinations(zip(lines, tracks, strict=True), 2):
        if not one.straight and not other.straight and a == b:
            assert one.high < other.low or other.high < one.low


@given(st.text(max_size=80), st.floats(20, 300))
def test_shortened_texts_fit(text: str, width: float) -> None:
    assert text_width(shorten(text, TextStyle.LABEL, width), TextStyle.LABEL) <= width
    assert all(text_width(line, TextStyle.LABEL) <= width for line in pack(text.split(), TextStyle.LABEL, width))
