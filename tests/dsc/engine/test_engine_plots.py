"""Plots inside plots: submachines with parameters and outcomes, and dynamic states that chose."""

from __future__ import annotations

import pytest
from dsc_charts import FakeSituation, Run, plot

from dsc.dynamic.library import Library
from dsc.engine.machine import start, step
from dsc.engine.situation import Decision
from dsc.events import Event
from knowledge_base.errors import InputError, UnknownNameError

# -- plots inside plots ------------------------------------------------------------------------------------

GRASP = """
    plot: grasp
    parameters: {item: item, speed: {type: number, default: 2}}
    variables: {tries: {type: number, initial: (+ ?speed 1)}}
    emits: {failed: {item: item}}
    states:
      try_it:
        on:
          ok: held
          bad: {to: ended, emit: failed, with: {item: ?item}}
      held: {final: true}
      ended: {final: true}
"""
HOST = """
    plot: p
    variables: {lost: item}
    states:
      h:
        use: grasp
        with: {item: cup1}
        on: {done: fine, failed: {to: sad, assign: {lost: ?event.item}}}
      fine:
      sad:
"""


def test_a_submachine_gets_arguments_defaults_and_initial_values():
    run = Run(plot(HOST), plot(GRASP))
    run.start()
    assert run.active == ["h", "h/try_it"]
    assert run.variables("h") == {"item": "cup1", "speed": 2, "tries": 3}


def test_a_submachine_that_ends_is_done():
    run = Run(plot(HOST), plot(GRASP))
    run.start()
    step_ = run.send("ok")
    assert run.active == ["fine"]
    assert [micro.event.name for micro in step_.microsteps] == ["ok", "done"]


def test_an_outcome_comes_before_done_and_takes_its_attributes_along():
    run = Run(plot(HOST), plot(GRASP))
    run.start()
    step_ = run.send("bad")
    assert run.active == ["sad"]
    assert run.variables()["lost"] == "cup1"
    # `done` is for an activation that was left, and is dropped.
    assert [micro.event.name for micro in step_.microsteps] == ["bad", "failed"]


def test_done_follows_an_outcome_that_did_not_leave_the_host():
    host = plot("""
        plot: p
        variables: {n: {type: number, initial: 0}}
        states: {h: {use: grasp, with: {item: cup1}, on: {failed: {assign: {n: 1}}, done: fine}}, fine: }
    """)
    run = Run(host, plot(GRASP))
    run.start()
    run.send("bad")
    assert run.active == ["fine"]
    assert run.variables()["n"] == 1


def test_a_composite_around_the_host_may_take_the_outcome():
    host = plot("""
        plot: p
        states: {c: {on: {failed: sad}, states: {h: {use: grasp, with: {item: cup1}}}}, sad: }
    """)
    run = Run(host, plot(GRASP))
    run.start()
    run.send("bad")
    assert run.active == ["sad"]


def test_variables_are_gone_when_the_plot_is_left():
    inner = plot("{plot: q, variables: {n: {type: number, initial: 0}}, states: {a: {on: {e: {assign: {n: 5}}}}}}")
    run = Run(plot("{plot: p, states: {h: {use: q, on: {again: h}}}}"), inner)
    run.start()
    run.send("e")
    assert run.variables("h") == {"n": 5}
    run.send("again")
    assert run.variables("h") == {"n": 0}


def test_a_plot_held_in_a_variable_is_bound_as_content():
    host = plot("{plot: p, parameters: {what: plot}, states: {h: {use: ?what, on: {done: e}}, e: }}")
    run = Run(host)
    run.start(what={"plot": "made", "states": {"a": {"on": {"go": "b"}}, "b": {"final": True}}})
    assert run.active == ["h", "h/a"]
    run.send("go")
    assert run.active == ["e"]


def test_the_order_of_a_bound_plots_states_counts():
    host = plot("{plot: p, parameters: {one: plot, two: plot}, states: {h: {use: ?one, on: {go: g}}, g: {use: ?two}}}")
    run = Run(host)
    run.start(one={"plot": "made", "states": {"a": {}, "b": {}}}, two={"plot": "made", "states": {"b": {}, "a": {}}})
    assert run.active == ["h", "h/a"]
    run.send("go")
    assert run.active == ["g", "g/b"]


@pytest.mark.parametrize(
    "value",
    [
        None,
        "text",
        5,
        {"plot": "made"},
        {"plot": "made", "states": {"a": {"on": {"e": "nowhere"}}}},
        {"plot": "made", "states": {"a": {}}, "initial": "nowhere"},
        {"plot": "made", "states": {"a": {"states": {"b": {}}, "initial": "a"}}},
    ],
)
def test_an_invalid_plot_value_cannot_be_bound_and_is_an_error_of_the_chart(value):
    host = plot(
        "{plot: p, variables: {what: any}, states: {a: {on: {go: {to: h, assign: {what: ?event.what}}}}, h: {use: ?what}}}"
    )
    run = Run(host)
    run.start()
    step_ = run.send("go", what=value)
    assert len(step_.errors) == 1
    assert run.active == ["h"]


def test_a_missing_or_unknown_parameter_is_an_error():
    with pytest.raises(InputError, match="needs its parameter 'item'"):
        Run(plot(GRASP)).start()
    with pytest.raises(UnknownNameError, match="did you mean 'item'"):
        Run(plot(GRASP)).start(itm="cup1")
    with pytest.raises(UnknownNameError, match="did you mean 'grasp'"):
        start(Library([plot(GRASP)]), "grap", {}, FakeSituation())


# -- dynamic states ----------------------------------------------------------------------------------------

DYNAMIC = """
    plot: p
    variables: {x: {type: item, initial: cup1}}
    states: {h: {dynamic: [grasp], with: {item: ?x}, on: {done: fine, no_candidate: sad, failed: sad}}, fine: , sad: }
"""


def test_a_dynamic_state_binds_what_was_chosen():
    run = Run(plot(DYNAMIC), plot(GRASP), choices={"grasp": Decision("grasp", {"item": "cup2"})})
    step_ = run.start()
    assert run.active == ["h", "h/try_it"]
    assert run.variables("h")["item"] == "cup2"
    assert [(made.state, made.decision.chosen) for made in step_.decisions] == [("h", "grasp")]


def test_a_dynamic_state_without_candidate_says_so():
    run = Run(plot(DYNAMIC), plot(GRASP))
    run.start()
    assert run.active == ["sad"]


def test_a_dynamic_state_whose_goal_holds_is_done():
    run = Run(plot(DYNAMIC), plot(GRASP), choices={"grasp": Decision(None, satisfied=True)})
    run.start()
    assert run.active == ["fine"]


def test_a_dynamic_state_chooses_anew_at_every_entry():
    choices = {"grasp": Decision("grasp", {"item": "cup2"})}
    host = plot("{plot: p, states: {h: {dynamic: [grasp], on: {again: h, no_candidate: sad}}, sad: }}")
    run = Run(host, plot(GRASP), choices=choices)
    run.start()
    assert len(run.send("again").decisions) == 1
    choices.clear()
    run.send("again")
    assert run.active == ["sad"]


def test_the_situation_is_asked_with_the_variables_and_the_event():
    host = plot("{plot: p, parameters: {x: item}, states: {a: {on: {go: h}}, h: {dynamic: [grasp]}}}")
    library, situation = Library([host, plot(GRASP)]), FakeSituation()
    state = start(library, "p", {"x": "cup1"}, FakeSituation()).state
    step(library, state, Event("go", {"n": 3}), situation)
    (asked,) = situation.asked
    assert asked[1:] == ("p", {"x": "cup1", "event.n": 3})


def test_an_outcome_for_a_state_that_is_left_in_the_same_microstep_reaches_nobody():
    run = Run(
        plot("{plot: p, states: {h: {use: q, on: {e: away, out: wrong}}, away: {on: {out: wrong}}, wrong: }}"),
        plot(
            "{plot: q, emits: {out: }, states: {o: {regions: {r: {states: {a: {on: {e: {emit: out}}}}}, s: {states: {b: }}}}}}"
        ),
    )
    run.start()
    assert len(run.send("e").microsteps) == 1
    assert run.active == ["away"]


def layers(on):
    """A plot in a plot in a plot, whose outermost state takes these events."""
    waiting = "{plot: r, states: {a: {after: {seconds: 5, to: b}}, b: {final: true}}}"
    middle = "{plot: q, states: {m: {use: r, on: {done: f}}, f: {final: true}}}"
    outer = f"{{plot: p, states: {{h: {{use: q, on: {{done: e, {on}}}}}, e: {{final: true}}, broken: }}}}"
    run = Run(*map(plot, (outer, middle, waiting)))
    run.start()
    return run


@pytest.mark.parametrize("failure", ["skill_error", "timed_out"])
def test_a_failure_that_nobody_inside_takes_is_offered_outwards_and_no_other_event(failure):
    run = layers(f"{failure}: broken, stop: broken")
    assert not run.send("stop", to="h/m/a").handled
    assert run.send(failure, to="h/m/a").handled
    assert run.machine.state.configuration() == ("broken",)


def test_a_failure_that_nobody_takes_is_not_handled():
    run = layers("stop: broken")
    assert not run.send("skill_error", to="h/m/a").handled
    assert run.machine.state.configuration() == ("h", "h/m", "h/m/a")


def test_an_initial_value_that_reads_an_unknown_variable_names_it_and_the_nearest():
    area = "{plot: p, parameters: {width: number}, variables: {area: {type: number, initial: ?widht}}, states: {s: }}"
    with pytest.raises(UnknownNameError, match="'\\?widht' has no value here; did you mean 'width'"):
        Run(plot(area)).start(width=2)


def test_a_plot_begins_directly_inside():
    with pytest.raises(UnknownNameError, match="no state 'b' to begin with"):
        Run(plot("{plot: p, initial: b, states: {a: {states: {b: }}}}")).start()
