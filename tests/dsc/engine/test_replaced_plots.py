"""A plot that is replaced while it runs: activated states that both plots have continue (`keep`)."""

from __future__ import annotations

import pytest
from dsc_charts import Run, plot

from dsc.engine.steps import Cancel, Start

HOST = """
    plot: host
    parameters: {first: plot}
    variables: {inner: plot}
    receives: {next: {plot: plot}}
    states:
      begin: {always: {to: work, assign: {inner: ?first}}}
      work:
        use: ?inner
        entry: {trigger: watch.over}
        on: {next: {to: work, assign: {inner: ?event.plot}, keep: true}, done: over}
      over: {final: true}
"""


def moving(name, to=None):
    """A state with a skill, and its end state."""
    return {
        name: {"entry": [{"trigger": f"arm.{name}"}], "on": {"moved": to or f"{name}_over"}},
        f"{name}_over": {"final": True},
    }


def lanes(*names):
    """A plot with a region for each skill."""
    regions = {f"r_{name}": {"states": moving(name)} for name in names}
    return {"plot": "inner", "states": {"all": {"regions": regions, "on": {"done": "end"}}, "end": {"final": True}}}


def single(name):
    return {"plot": "inner", "states": moving(name)}


def begun(first):
    run = Run(plot(HOST))
    run.start(first=first)
    return run


def said(step):
    starts = [f"{one.component}.{one.skill}" for one in step.output if isinstance(one, Start)]
    return starts, [one.activation for one in step.output if isinstance(one, Cancel)]


@pytest.mark.parametrize("first", [single("a"), lanes("a", "b")], ids=["alone", "in a region"])
@pytest.mark.parametrize("then", [single("a"), lanes("a", "c")], ids=["then alone", "then in a region"])
def test_an_active_state_that_both_plots_have_stays_active(first, then):
    run = begun(first)
    activation = run.machine.state.root.children["work"].activations["a"]
    step = run.send("next", plot=then)
    starts, cancelled = said(step)
    assert "arm.a" not in starts
    assert activation not in cancelled
    assert run.machine.state.root.children["work"].activations["a"] == activation
    assert "work/a" not in (*step.microsteps[0].entered, *step.microsteps[0].exited)
    assert run.send("moved", to="work/a").handled
    assert "work/a_over" in run.machine.state.configuration() or run.machine.state.finished


def test_other_states_are_left_and_new_ones_entered():
    run = begun(lanes("a", "b"))
    step = run.send("next", plot=lanes("a", "c"))
    starts, cancelled = said(step)
    assert starts == ["watch.over", "arm.c"]
    assert len(cancelled) == 2  # the host's own skill, and that of `b`
    assert "work/b" in step.microsteps[0].exited


def test_without_keep_the_plot_begins_anew():
    run = Run(plot(HOST.replace(", keep: true", "")))
    run.start(first=lanes("a", "b"))
    assert said(run.send("next", plot=lanes("a", "b")))[0] == ["watch.over", "arm.a", "arm.b"]


def test_two_states_that_exclude_each_other_do_not_both_continue():
    run = begun(lanes("a", "b"))
    states = {**moving("a", "b"), **moving("b")}
    del states["a_over"]
    chain = {"plot": "inner", "states": states}
    run.send("next", plot=chain)
    assert run.machine.state.configuration() == ("work", "work/a")


def test_the_content_of_a_state_and_the_variables_of_the_plot_continue():
    deep = plot("{plot: deep, states: {d: {entry: {trigger: arm.d}, on: {moved: e}}, e: {final: true}}}")

    def outer(*more):
        states = {"s": {"use": "deep", "on": {"done": "end"}}, "end": {"final": True}, **{name: {} for name in more}}
        first = {"always": {"to": "s", "assign": {"n": 3}}}
        variables = {"n": {"type": "number", "initial": 0}}
        return {"plot": "inner", "variables": variables, "initial": "first", "states": {"first": first, **states}}

    run = Run(plot(HOST), deep)
    run.start(first=outer())
    before = run.machine.state.root.children["work"]
    run.send("next", plot=outer("more"))
    now = run.machine.state.root.children["work"]
    assert now.children["s"] is before.children["s"]
    assert now.variables["n"] == 3
    assert run.machine.state.configuration() == ("work", "work/s", "work/s/d")


def test_a_least_time_that_has_passed_does_not_begin_anew():
    waits = {
        "plot": "inner",
        "states": {"a": {"at_least": 5, "entry": [{"trigger": "arm.a"}], "on": {"moved": "e"}}, "e": {"final": True}},
    }
    run = begun(waits)
    run.send("at_least", to="work/a", number=0, exact=True)
    run.send("next", plot=waits)
    run.send("moved", to="work/a")
    assert run.machine.state.finished
