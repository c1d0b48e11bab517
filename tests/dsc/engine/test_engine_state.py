"""The machine's state as a value: stored, copied, compared, never changed by a step."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import pytest
from dsc_charts import FakeSituation, Run, plot

from dsc.dynamic.library import Library
from dsc.engine.machine import step
from dsc.engine.machine_forms import read_state
from dsc.engine.machine_state import MachineState
from dsc.engine.situation import Decision
from dsc.events import Event
from knowledge_base.errors import InputError, UnknownNameError

RICH = """
    plot: p
    variables: {n: {type: number, initial: 0}}
    states:
      o:
        on: {done: e}
        regions:
          r1: {states: {x: {use: q, on: {done: x2}}, x2: {final: true}}}
          r2: {states: {y: {dynamic: [q], after: {seconds: 5, to: y}, on: {done: y2}}, y2: {final: true}}}
      e: {final: true}
"""
INNER = """
    plot: q
    variables: {k: {type: number, initial: 1}}
    states: {a: {on: {tick: {to: a, assign: {k: (- ?k 1)}}}, always: {to: b, when: (<= ?k 0)}}, b: {final: true}}
"""


def rich():
    return Run(plot(RICH), plot(INNER), choices={"q": Decision("q")})


def test_the_state_goes_to_json_and_back_exactly_in_the_middle_of_a_run():
    run, other = rich(), rich()
    assert run.start() == other.start()
    for name in ("nothing", "tick", "tick"):
        stored = json.dumps(other.machine.state.to_json())
        other.machine.state = read_state(json.loads(stored), other.library)
        assert other.machine.state == run.machine.state
        assert run.send(name) == other.send(name)
    assert run.machine.state.finished


def test_a_bound_plot_goes_to_json_with_the_state():
    host = plot("{plot: p, parameters: {what: plot}, states: {h: {use: ?what, on: {done: e}}, e: }}")
    run = Run(host)
    run.start(what={"plot": "made", "states": {"a": {"on": {"go": "b"}}, "b": {"final": True}}})
    state = read_state(json.loads(json.dumps(run.machine.state.to_json())), run.library)
    assert state == run.machine.state
    fresh = Library([host])
    state = read_state(state.to_json(), fresh)  # as after a restart
    assert step(fresh, state, Event("go"), FakeSituation()).state.configuration() == ("e",)


def test_a_state_of_another_library_is_refused():
    run = rich()
    run.start()
    stored = run.machine.state.to_json()
    with pytest.raises(UnknownNameError, match="there is no plot 'p'"):
        read_state(stored, Library([]))
    changed = Library([plot(RICH.replace("x: {use", "x_: {use")), plot(INNER)])
    with pytest.raises(UnknownNameError, match="plot 'p' no longer has the state 'x'"):
        read_state(stored, changed)


def test_a_step_changes_nothing_it_was_given():
    run = rich()
    run.start()
    before, kept = run.machine.state, json.dumps(run.machine.state.to_json())
    first = step(run.library, before, Event("tick"), run.situation())
    assert json.dumps(before.to_json()) == kept
    assert step(run.library, before, Event("tick"), run.situation()) == first
    assert run.machine.state is before
    assert run.send("tick") == first
    assert run.machine.state == first.state


def test_the_configuration_names_states_by_their_paths_and_regions_not_at_all():
    run = rich()
    run.start()
    state = run.machine.state
    assert state.configuration() == ("o", "x", "x/a", "y", "y/a")
    assert state.is_active("x/a")
    assert state.is_active("a")
    assert not state.is_active("x2")
    assert state.state_of(run.serial("y"))
    assert not state.state_of(10_000)


def test_a_machine_that_was_not_started_or_has_ended_does_nothing():
    run = Run(plot("{plot: p, states: {a: {final: true}}}"))
    assert run.send("e").moved is False
    assert run.start().state.finished
    assert run.send("e").handled is False


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ((), [], "not a state of a machine: the whole: "),
        (("root",), 3, "not a state of a machine: root: "),
        (("serials",), "many", "not a state of a machine: serials: "),
        (("root", "plot"), [], "not a state of a machine: root.plot: "),
        (("root", "active"), {"a": 1}, "not a state of a machine: root.active: "),
        (("root", "kept"), [["a"]], "not a state of a machine: root.kept.0.1: "),
        (("root", "kept"), [["a", {"name": "e", "sent": 1}]], "not a state of a machine: root.kept.0.1."),
        (("root", "history"), [1], "not a state of a machine: root.history: "),
        (("root", "surplus"), 1, "not a state of a machine: root.surplus: "),
        (("root", "form"), {"plot": 3}, "plot"),
    ],
)
def test_an_invalid_state_is_refused_with_the_path_of_its_error(path, value, said):
    run = rich()
    run.start()
    form = json.loads(json.dumps(run.machine.state.to_json()))
    holder = form
    for key in path[:-1]:
        holder = holder[key]
    if path:
        holder[path[-1]] = value
    with pytest.raises(InputError, match=re.escape(said)):
        read_state(form if path else value, run.library)


def test_a_state_nested_too_deeply_is_refused():
    run = rich()
    run.start()
    form = json.loads(json.dumps(run.machine.state.to_json()))
    for _ in range(2000):
        form["root"] = {**form["root"], "children": {"a": form["root"]}}
    with pytest.raises(InputError, match="not a state of a machine"):
        read_state(form, run.library)


def test_activations_inside_a_state_are_its_own_and_those_of_its_content():
    waiting = "{plot: q, states: {a: {after: {seconds: 5, to: b}}, b: {final: true}}}"
    run = Run(plot("{plot: p, states: {h: {use: q, on: {done: e}}, e: {final: true}}}"), plot(waiting))
    run.start()
    state = run.machine.state
    own, inner = state.root.activations["h"], state.root.children["h"].activations["a"]
    assert state.activations_inside(own) == {own, inner}
    assert state.activations_inside(inner) == {inner}
    assert state.activations_inside(0) == MachineState().activations_inside(own) == frozenset()
    assert state.state_of(inner)
    assert not state.state_of(0)
    assert not MachineState().state_of(inner)


def test_a_frame_goes_to_json_and_back():
    run = rich()
    run.start()
    state = run.machine.state
    form = state.to_json()
    assert form["root"] == state.root.to_json()
    assert read_state(json.loads(json.dumps(form)), run.library).root == state.root
    with pytest.raises(InputError):
        read_state({**form, "root": {"plot": "p"}}, run.library)


def test_a_plot_that_moves_on_has_not_ended_also_with_variables():
    run = Run(
        plot(
            "{plot: p, variables: {n: {type: number, initial: 0}}, states: {a: {on: {go: b}}, b: {on: {go: a, up: {to: b, assign: {n: 1}}}}}}"
        )
    )
    run.start()
    for event in ("go", "up", "go", "go", "go"):
        run.send(event)
        assert not run.machine.state.finished
    assert run.machine.state.configuration() == ("a",)


def test_a_plot_bound_as_a_value_is_another_than_the_same_plot_by_name():
    library = Library([plot(INNER)])
    named = library.compiled("q")
    bound = library.bind({"plot": "q", "states": {"a": {"on": {"go": "b"}}, "b": {"final": True}}})
    assert named != bound
    assert named != replace(named, form={})
    assert named == replace(named)
    assert bound != replace(bound, plot=named.plot)


def test_content_is_looked_through_in_document_order_whatever_was_entered_last():
    inner = plot("{plot: q, states: {a: {on: {go: b}}, b: }}")
    regions = "{r1: {states: {x: {use: q, on: {again: x}}}}, r2: {states: {y: {use: q}}}}"
    run = Run(plot(f"{{plot: p, states: {{o: {{regions: {regions}}}}}}}"), inner)
    run.start()
    run.send("again")
    (micro,) = run.send("go").microsteps
    assert (micro.exited, micro.entered) == (("y/a", "x/a"), ("x/b", "y/b"))
    assert run.machine.state.configuration() == ("o", "x", "x/b", "y", "y/b")


def test_a_configuration_drops_its_questions_above_their_number(monkeypatch):
    monkeypatch.setattr("dsc.engine.automaton.MOST_QUESTIONS", 2)
    events = "".join(f"e{number}: {{to: b, when: (p)}}, " for number in range(5))
    run = Run(plot(f"{{plot: p, states: {{a: {{on: {{{events}}}}}, b: }}}}"))
    run.start()
    configuration = run.machine.state.root.configuration
    for number in range(5):
        run.send(f"e{number}")
        assert len(configuration.reactions.choices) <= 3
