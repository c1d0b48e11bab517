"""What runs reached: exactly what they went through, wherever it ran, and nothing that only looks like it."""

from __future__ import annotations

import asyncio
import json
import re

import pytest
from dsc_charts import PROPERTY, plot
from fetching import FETCH, PLOTS, SCHEMA
from hypothesis import given
from hypothesis import strategies as st

from dsc import Library, Sequencer, load_library
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.testing import Answer, Coverage, DryRun, ends_with, rehearse, world
from knowledge_base import InputError, UnknownNameError

SLIPPED = Answer("slipped", {"item": "cup"})


def fetch(drives="arrived", grasps="grasped", library=PLOTS, **more):
    known = world(SCHEMA, "cup - item")
    skills = {"base.drive": drives, "arm.grasp": grasps}
    return rehearse(library, "fetch", {"item": "cup"}, skills=skills, knowledge=known, **more)


def missing(coverage, plot_name=None):
    return [item.text for item in coverage.missing(plot_name)]


def test_one_run_reaches_what_it_went_through():
    coverage = Coverage(PLOTS)
    coverage.add(*fetch().steps)
    assert coverage.count("pick", "state") == (2, 3)
    assert coverage.count("pick", "transition") == (1, 3)
    assert missing(coverage, "pick") == [
        "'grasp' never took felt (stays)",
        "'grasp' never took slipped -> dropped",
        "state 'dropped' was never entered",
    ]
    assert missing(coverage, "fetch") == [
        "'work' never took stop -> ended",
        "state 'without' was never entered",
        "rule 'no_path: wait, retry' never answered",
        "rule 'no_path: without' never answered",
        "rule 'slipped: retry' never answered",
        "rule 'slipped: wait, without' never answered",
    ]
    assert coverage.count("wait", "state") == (0, 2)


def test_runs_add_up():
    coverage = Coverage(PLOTS)
    for run in (
        fetch(["no_path", "arrived"], [SLIPPED, SLIPPED, SLIPPED]),
        fetch(["no_path"] * 3),
        fetch(events=[(1.5, "stop")]),
        fetch(Answer("arrived", after=40), Answer("grasped", reports=(Answer("felt"),))),
        fetch(grasps=Answer("grasped", reports=(Answer("felt"),))),
    ):
        coverage.add(*run.steps)
    assert coverage.missing() == ()
    assert coverage.ratio == 1
    coverage.assert_complete()


def test_coverage_does_not_require_states_added_by_rules():
    names = {item.key[1] for item in Coverage(PLOTS).missing("fetch") if item.kind == "state"}
    assert names == {name for name, _, _ in FETCH.walk()}


def test_every_missing_item_says_where_it_was_written(tmp_path):
    (tmp_path / "p.yaml").write_text("""plot: p
states:
  a:
    on:
      go: b
      stay: [{to: a, when: (open)}, b]
    after:
      - {seconds: 1, to: b}
      - {seconds: 2, to: c}
  b:
    states:
      inner: {on: {up: deep}, always: {to: deep, when: (open)}}
      deep: {final: true}
    on: {done: c}
  c: {final: true}
rules:
  - on: lost
    do: {then: a}
  - on: found
    do: {then: b}
""")
    library = load_library(tmp_path)
    places = {str(item).replace(str(tmp_path), "") for item in Coverage(library).missing()}
    found = {place.partition(": ")[2]: place.partition(":")[2].partition(":")[0] for place in places}
    assert found == {
        "state 'a' was never entered": "3", "'a' never took go -> b": "5", "'a' never took stay -> a": "6",
        "'a' never took stay -> b": "6", "'a' never took after -> b": "8", "'a' never took after -> c": "9",
        "state 'b' was never entered": "10", "state 'inner' was never entered": "12", "'inner' never took up -> deep": "12",
        "'inner' never took always -> deep": "12", "state 'deep' was never entered": "13", "'b' never took done -> c": "14",
        "state 'c' was never entered": "15", "rule 'lost: a' never answered": "17", "rule 'found: b' never answered": "19",
    }  # fmt: skip
    assert all(re.match(r"/p\.yaml:\d+:\d+: ", place) for place in places)


def test_a_plot_made_in_python_says_where_in_its_form():
    made = plot("{plot: p, states: {a: {on: {go: b}}, b: {final: true}}}").model_copy()
    form = type(made).model_validate(made.to_form())
    assert str(Coverage([form]).missing()[1]) == "states/a/on/go/0: 'a' never took go -> b"


def test_transitions_of_one_trigger_are_told_apart():
    choosing = plot("{plot: p, states: {a: {on: {go: [{to: b, when: (open)}, {to: b}]}}, b: {final: true}}}")
    coverage = Coverage([choosing])
    run = DryRun([choosing], "p", knowledge=world(SCHEMA))
    run.send("go")
    coverage.add(*run.steps)
    assert [item.key for item in coverage.missing()] == [("transition", "a", ("on", "go", 0))]


def test_states_of_one_name_in_different_plots_are_told_apart():
    inner = plot("{plot: q, states: {a: {on: {go: b}}, b: {final: true}}}")
    outer = plot("{plot: p, states: {a: {use: q, on: {done: b}}, b: {final: true}}}")
    coverage = Coverage([outer, inner])
    coverage.add(*DryRun([outer, inner], "p").steps)
    assert coverage.count("p", "state") == coverage.count("q", "state") == (1, 2)


def test_a_plot_that_stands_in_is_not_the_one_it_stands_in_for():
    coverage = Coverage(PLOTS)
    substituted = ends_with(PLOTS[2]).model_copy(
        update={"states": PLOTS[2].states, "about": "the same states, another plot"}
    )
    coverage.add(*fetch(library=Library(PLOTS).substitute("pick", substituted)).steps)
    assert coverage.count("pick", "state") == (0, 3)
    assert coverage.count("drive", "state") == (2, 3)


def test_only_some_plots():
    coverage = Coverage(PLOTS, only=["wait"])
    coverage.add(*fetch(["no_path", "arrived"]).steps)
    coverage.assert_complete()
    with pytest.raises(UnknownNameError, match="did you mean 'wait'"):
        Coverage(PLOTS, only=["wiat"])
    with pytest.raises(UnknownNameError, match="the plot 'fetch' is not covered"):
        coverage.count("fetch", "state")
    with pytest.raises(UnknownNameError, match="the plot 'fetch' is not covered"):
        coverage.missing("fetch")


GENERATED = """
    plot: plan_1
    generated: true
    states:
      step_1: {use: pick, with: {item: cup}, on: {done: replan}}
      replan: {final: true}
      gave_up: {final: true}
    variables: {reason: text}
    rules:
      - on: slipped
        do: {then: retry, limit: 1}
"""
HOLDER = """
    plot: holder
    parameters: {plan: plot}
    states:
      execute: {use: ?plan, on: {done: ended}}
      ended: {final: true}
    rules:
      - on: slipped
        do: {then: retry, limit: 1}
      - on: slipped
        do: {then: replan}
"""


def test_a_rule_counts_where_it_was_written_when_a_plan_inherited_it():
    plots = [plot(HOLDER), *PLOTS]
    coverage = Coverage(plots)
    run = DryRun(plots, "holder", {"plan": plot(GENERATED).to_form()}, world(SCHEMA, "cup - item"))
    run.answer("arm.grasp", "slipped", {"item": "cup"})
    coverage.add(*run.steps)
    assert missing(coverage, "holder") == [
        "'execute' never took done -> ended",
        "state 'ended' was never entered",
        "rule 'slipped: replan' never answered",
    ]
    assert "rule 'slipped: retry' never answered" in missing(coverage, "fetch")


def test_rules_with_equal_responses_are_told_apart():
    twice = plot(
        "{plot: p, states: {a: {final: true}}, rules: [{on: x, when: (open), do: {then: retry}}, {on: x, do: {then: retry}}]}"
    )
    assert [item.path for item in Coverage([twice]).missing() if item.kind == "rule"] == [
        ("rules", 0),
        ("rules", 1),
    ]


def test_history_is_never_entered_and_not_asked_for():
    remembering = plot("""
        plot: p
        dialect: scxml
        states:
          c: {states: {h: {history: deep, to: a}, a: {on: {go: b}}, b: }, on: {out: d}}
          d: {on: {back: h}}
    """)
    coverage = Coverage([remembering])
    run = DryRun([remembering], "p")
    for event in ("go", "out", "back"):
        run.send(event)
    coverage.add(*run.steps)
    coverage.assert_complete()


def test_steps_from_the_middle_of_a_run_are_refused():
    with pytest.raises(InputError, match="counted from its start"):
        Coverage(PLOTS).add(*fetch().steps[1:])


def test_a_sequencer_tells_it_while_it_runs():
    waiting = plot("{plot: p, states: {a: {after: {seconds: 3, to: b}}, b: {final: true}}}")
    coverage = Coverage([waiting])

    async def main():
        sequencer = Sequencer(Library([waiting]), world(), [], LoopClock())
        sequencer.listen(coverage.add)
        asyncio.get_running_loop().call_later(1, lambda: seen.append(coverage.ratio))
        await sequencer.run("p")

    seen: list[float] = []
    run_simulated(main())
    assert seen == [1 / 3]
    assert coverage.ratio == 1


# -- reports -----------------------------------------------------------------------------------------------


def test_the_report_is_a_table_with_what_is_missing_under_each_plot():
    coverage = Coverage(PLOTS, only=["drive", "wait"])
    coverage.add(*fetch().steps)
    assert (
        coverage.report()
        == """\
            states  transitions        rules
drive       2 of 3       1 of 3            -
  drive.yaml:9:26: 'driving' never took no_path -> blocked
  drive.yaml:10:5: 'driving' never took after -> blocked
  drive.yaml:12:3: state 'blocked' was never entered
wait        0 of 2       0 of 1            -
  wait.yaml:1:23: state 'pause' was never entered
  wait.yaml:1:31: 'pause' never took after -> over
  wait.yaml:1:64: state 'over' was never entered"""
    )


def test_plain_data_says_the_same():
    coverage = Coverage(PLOTS, only=["drive"])
    coverage.add(*fetch().steps)
    data = json.loads(json.dumps(coverage.to_json()))
    assert data["drive"]["states"] == {"reached": 2, "all": 3}
    assert data["drive"]["transitions"] == {"reached": 1, "all": 3}
    assert data["drive"]["rules"] == {"reached": 0, "all": 0}
    assert {
        "kind": "state",
        "text": "state 'blocked' was never entered",
        "path": ["states", "blocked"],
        "file": "drive.yaml",
        "line": 12,
    } in data["drive"]["missing"]


def test_too_little_is_an_assertion_that_says_how_much_and_what():
    coverage = Coverage(PLOTS, only=["pick"])
    coverage.add(*fetch().steps)
    coverage.assert_complete(at_least=0.5)
    with pytest.raises(AssertionError) as short:
        coverage.assert_complete(at_least=0.9)
    first, *rest = str(short.value).splitlines()
    assert first == "3 of 6 (50.0%) covered, at least 90.0% wanted"
    assert rest == coverage.report().splitlines()


def test_nothing_to_cover_is_complete():
    assert Coverage([]).ratio == 1
    Coverage([]).assert_complete()
    assert Coverage([]).report().split() == ["states", "transitions", "rules"]


@PROPERTY
@given(
    st.lists(st.sampled_from(["arrived", "no_path"]), max_size=3),
    st.lists(st.sampled_from(["grasped", "slipped"]), max_size=3),
)
def test_coverage_only_grows_and_forgets_nothing(drives, grasps):
    coverage, before = Coverage(PLOTS), None
    for run in (
        fetch([*drives, *["arrived"] * 4], [*(SLIPPED if g == "slipped" else g for g in grasps), *[SLIPPED] * 4]),
        fetch(),
    ):
        coverage.add(*run.steps)
        now = set(coverage.missing())
        assert before is None or now <= before
        before = now
