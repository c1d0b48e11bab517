"""The pure step: entering and leaving, completion, actions, timeouts, errors, and the state as a value."""

from __future__ import annotations

import json
from copy import deepcopy

import pytest
from charts import FakeSituation, Run, marked, modes, plot

from dsc.dynamic.library import Library
from dsc.engine.configuration import MachineState
from dsc.engine.machine import start, step
from dsc.engine.situation import Decision
from dsc.engine.steps import Cancel, SetParameter, Start, StartTimer, SwitchMode
from dsc.errors import RunawayError
from dsc.events import Event
from dsc.model.plot import ActionPlot
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import Delta, Fact, fact


def of(states, name="p", **keys):
    """A plot of states that show when they are entered and left, besides what is given."""
    return ActionPlot.model_validate({"plot": name, "states": states, **keys})


def shown(name, **keys):
    return {name: {**marked(name)[name], **keys}}


# -- entering and leaving ----------------------------------------------------------------------------------


def test_states_are_entered_from_outside_in_and_left_from_inside_out():
    inner = {**shown("c", states=shown("d")), **shown("e")}
    run = Run(of({**shown("a", on={"go": "b"}, states=inner), **shown("b")}))
    assert modes(run.start()) == ["+a", "+c", "+d"]
    assert modes(run.send("go")) == ["-d", "-c", "-a", "+b"]
    assert run.active == ["b"]


def test_regions_are_entered_in_document_order_and_left_in_reverse():
    regions = {"r1": {"states": shown("x")}, "r2": {"states": shown("y")}, "r3": {"states": shown("z")}}
    run = Run(of({**shown("o", on={"go": "e"}, regions=regions), **shown("e")}))
    assert modes(run.start()) == ["+o", "+x", "+y", "+z"]
    assert run.active == ["o", "x", "y", "z"]
    assert modes(run.send("go")) == ["-z", "-y", "-x", "-o", "+e"]


def test_plots_inside_regions_are_left_in_reverse_document_order_too():
    regions = {"r1": {"states": shown("x", use="q")}, "r2": {"states": shown("y")}}
    run = Run(of({**shown("o", on={"go": "e"}, regions=regions), **shown("e")}), of(shown("in_x"), "q"))
    assert modes(run.start()) == ["+o", "+x", "+in_x", "+y"]
    assert modes(run.send("go")) == ["-y", "-in_x", "-x", "-o", "+e"]


def test_a_plot_bound_anew_is_still_left_in_document_order():
    regions = {
        "r1": {"states": {**shown("x", use="q", on={"again": "x"})}},
        "r2": {"states": shown("y", use="q")},
    }
    run = Run(of({**shown("o", on={"go": "e"}, regions=regions), **shown("e")}), of(shown("in"), "q"))
    run.start()
    assert modes(run.send("again")) == ["-in", "-x", "+x", "+in"]
    assert modes(run.send("go")) == ["-in", "-y", "-in", "-x", "-o", "+e"]


def test_the_initial_state_is_the_first_unless_it_is_named():
    run = Run(of({**shown("a"), **shown("b", states={**shown("c"), **shown("d")}, initial="d")}, initial="b"))
    assert modes(run.start()) == ["+b", "+d"]


def test_a_transition_into_a_region_enters_the_others_in_document_order():
    regions = {
        "r1": {"states": shown("x")},
        "r2": {"states": {**shown("y"), **shown("y2")}},
        "r3": {"states": shown("z")},
    }
    run = Run(of({**shown("a", on={"go": "y2"}), **shown("o", regions=regions)}))
    run.start()
    assert modes(run.send("go")) == ["-a", "+o", "+x", "+y2", "+z"]


def test_a_transition_to_itself_leaves_and_enters_anew():
    run = Run(of(shown("a", on={"again": "a"})))
    run.start()
    before = run.serial("a")
    step_ = run.send("again")
    assert modes(step_) == ["-a", "+a"]
    assert step_.exited("a")
    assert step_.entered("a")
    assert run.serial("a") > before


def test_a_transition_without_target_leaves_nothing():
    run = Run(of(shown("a", on={"count": {"assign": {"n": "(+ ?n 1)"}}}), variables={"n": {"type": "number", "initial": 0}}))
    run.start()
    before = run.serial("a")
    assert modes(run.send("count")) == []
    run.send("count")
    assert run.variables()["n"] == 2
    assert run.serial("a") == before


def test_a_transition_from_a_composite_to_a_state_inside_leaves_it():
    inner = {**shown("c"), **shown("d")}
    run = Run(of(shown("a", on={"go": "d"}, states=inner)))
    run.start()
    assert modes(run.send("go")) == ["-c", "-a", "+a", "+d"]


# -- completion --------------------------------------------------------------------------------------------


def test_a_state_without_content_is_done_at_once():
    run = Run(plot("{plot: p, states: {a: {on: {done: b}}, b: {on: {done: c}}, c: {final: true}}}"))
    assert run.start().state.finished


def test_a_composite_is_done_when_its_final_state_is_reached():
    run = Run(plot("{plot: p, states: {a: {on: {done: b}, states: {c: {on: {e: d}}, d: {final: true}}}, b: {}}}"))
    run.start()
    assert run.active == ["a", "c"]
    run.send("e")
    assert run.active == ["b"]


def test_completion_is_seen_by_the_completed_state_alone():
    run = Run(plot("""
        plot: p
        states:
          outer:
            on: {done: wrong}
            states: {a: {on: {done: b}, states: {c: {on: {e: d}}, d: {final: true}}}, b: {}}
          wrong:
    """))
    run.start()
    run.send("e")
    assert run.active == ["outer", "b"]


def test_regions_are_done_when_each_has_reached_its_final_state():
    run = Run(plot("""
        plot: p
        states:
          o:
            on: {done: b}
            regions:
              r1: {states: {x: {on: {e: x2}}, x2: {final: true}}}
              r2: {states: {y: {on: {f: y2}}, y2: {final: true}}}
          b:
    """))
    run.start()
    run.send("e")
    assert run.active == ["o", "x2", "y"]
    run.send("f")
    assert run.active == ["b"]


def test_regions_done_in_one_step_complete_once():
    run = Run(plot("""
        plot: p
        variables: {n: {type: number, initial: 0}}
        states:
          o:
            on: {done: {assign: {n: (+ ?n 1)}}}
            regions:
              r1: {states: {x: {on: {e: x2}}, x2: {final: true}}}
              r2: {states: {y: {on: {e: y2}}, y2: {final: true}}}
    """))
    run.start()
    run.send("e")
    assert run.variables()["n"] == 1


def test_regions_that_begin_in_their_final_states_are_done_once_all_are_entered():
    run = Run(plot("""
        plot: p
        states:
          o: {on: {done: b}, regions: {r1: {states: {x: {final: true}}}, r2: {states: {y: {final: true}}}}}
          b:
    """))
    step_ = run.start()
    assert run.active == ["b"]
    assert [micro.entered for micro in step_.microsteps] == [("o", "x", "y"), ("b",)]


def test_the_end_of_the_outermost_plot_leaves_everything():
    run = Run(of({**shown("a", on={"e": "b"}), "b": {"final": True}}))
    run.start()
    step_ = run.send("e")
    assert step_.state == MachineState(None, step_.state.serials, finished=True)
    assert step_.exited("a")
    assert step_.exited("b")
    assert run.send("e").moved is False


def test_the_outcome_of_the_outermost_plot_leaves_the_machine():
    run = Run(plot("{plot: p, emits: {r: {n: number}}, states: {a: {on: {e: b}}, b: {final: true, emit: r, with: {n: 3}}}}"))
    run.start()
    assert run.send("e").emitted == (Event("r", {"n": 3}),)


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
    run.start(
        one={"plot": "made", "states": {"a": {}, "b": {}}}, two={"plot": "made", "states": {"b": {}, "a": {}}}
    )
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
def test_what_is_no_plot_cannot_be_bound_and_is_an_error_of_the_chart(value):
    host = plot("{plot: p, variables: {what: plot}, states: {a: {on: {go: {to: h, assign: {what: ?event.what}}}}, h: {use: ?what}}}")
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


# -- actions -----------------------------------------------------------------------------------------------


def test_external_actions_become_output_in_order_with_arguments_worked_out():
    run = Run(plot("""
        plot: p
        parameters: {item: item}
        states:
          a:
            entry:
              - {set: arm.approach, to: ?item}
              - {switch: base, to: neutral}
              - {trigger: arm.pick, with: {item: ?item, n: (+ 1 2)}, as: {ok: picked}, within: 3}
            exit: {switch: arm, to: neutral}
            on: {e: b}
          b:
    """))
    output = run.start(item="cup1").output
    serial = run.serial("a")
    assert output == (
        SetParameter("arm", "approach", "cup1"),
        SwitchMode("base", "neutral"),
        Start(f"a{serial}.2", serial, "arm", "pick", {"item": "cup1", "n": 3}, {"ok": "picked"}, 3.0),
    )
    assert run.send("e").output == (Cancel(serial), SwitchMode("arm", "neutral"))


def test_every_execution_has_an_id_of_its_own():
    run = Run(plot("{plot: p, states: {a: {entry: [{trigger: c.s}, {trigger: c.s}], on: {e: a}}}}"))
    ids = [o.action_id for s in (run.start(), run.send("e"), run.send("e")) for o in s.output if isinstance(o, Start)]
    assert len(ids) == len(set(ids)) == 6


def test_actions_of_a_transition_are_done_between_leaving_and_entering_in_order():
    run = Run(plot("""
        plot: p
        variables: {n: {type: number, initial: 1}}
        states:
          a: {exit: {set: c.x, to: ?n}, on: {e: {to: b, assign: {n: (+ ?n 1)}, tell: (seen ?n), emit: local, with: {n: ?n}}}}
          b: {entry: {set: c.x, to: ?n}, on: {local: {assign: {n: (+ ?n ?event.n)}}}}
    """))
    run.start()
    step_ = run.send("e")
    assert [o.value for o in step_.output] == [1, 2]
    assert step_.knowledge == Delta(added=(fact("seen", 2),))
    assert run.variables()["n"] == 4


def test_what_is_told_is_seen_by_later_guards_of_the_same_macrostep():
    run = Run(plot("""
        plot: p
        states:
          a: {on: {e: {to: b, tell: (and (p) (not (q)))}}}
          b: {always: [{to: wrong, when: (q)}, {to: right, when: (p)}]}
          right:
          wrong:
    """), facts=[Fact("q")])  # fmt: skip
    run.start()
    step_ = run.send("e")
    assert run.active == ["right"]
    assert step_.knowledge == Delta(removed=(Fact("q"),), added=(Fact("p"),))


def test_what_is_told_and_taken_back_in_one_macrostep_is_one_change():
    run = Run(plot("{plot: p, states: {a: {on: {e: {to: b, tell: (p)}}}, b: {always: {to: c, tell: (not (p))}}, c: }}"))
    run.start()
    assert run.send("e").knowledge == Delta(removed=(Fact("p"),))


def test_assignments_of_one_action_do_not_see_each_other():
    run = Run(plot("""
        plot: p
        variables: {x: {type: number, initial: 1}, y: {type: number, initial: 2}}
        states: {a: {on: {swap: {assign: {x: ?y, y: ?x}}}}}
    """))
    run.start()
    run.send("swap")
    assert run.variables() == {"x": 2, "y": 1}


def test_local_events_come_before_the_next_and_in_order():
    run = Run(plot("""
        plot: p
        variables: {log: {type: number, initial: 0}}
        states:
          a:
            on:
              e: {do: [{emit: one}, {emit: two}]}
              one: {assign: {log: (+ (* ?log 10) 1)}, emit: three}
              two: {assign: {log: (+ (* ?log 10) 2)}}
              three: {assign: {log: (+ (* ?log 10) 3)}}
    """.replace("(* ?log 10)", "?log")))
    run.start()
    assert [m.event.name for m in run.send("e").microsteps] == ["e", "one", "two", "three"]


def test_always_is_looked_at_before_local_events():
    run = Run(plot("""
        plot: p
        states: {a: {on: {e: {to: b, emit: x}}}, b: {on: {x: wrong}, always: c}, c: {on: {x: d}}, d: , wrong: }
    """))
    run.start()
    run.send("e")
    assert run.active == ["d"]


def test_always_follows_a_change_of_the_world():
    run = Run(plot("{plot: p, states: {a: {always: {to: b, when: (p)}}, b: }}"))
    run.start()
    assert run.look().moved is False
    run.facts.add(Fact("p"))
    assert run.look().moved
    assert run.active == ["b"]


# -- timeouts ----------------------------------------------------------------------------------------------


def test_timeouts_start_on_entry_and_are_cancelled_on_exit():
    run = Run(plot("""
        plot: p
        parameters: {t: number}
        states: {a: {after: [{seconds: 5, to: b}, {seconds: (+ ?t 1), to: c}], on: {e: a}}, b: , c: }
    """))
    first = run.start(t=1)
    old = run.serial("a")
    assert first.output == (StartTimer(old, 0, 5.0), StartTimer(old, 1, 2.0))
    new = run.send("e")
    assert new.output == (Cancel(old), StartTimer(run.serial("a"), 0, 5.0), StartTimer(run.serial("a"), 1, 2.0))
    late = step(run.library, run.machine.state, Event("after", to=old, exact=True, index=0), run.situation())
    assert not late.moved
    assert run.time_out("a", 1).handled
    assert run.active == ["c"]


def test_a_timeout_may_have_a_guard_and_stay():
    run = Run(plot("{plot: p, states: {a: {after: [{seconds: 5, to: b, when: (p)}]}, b: }}"))
    run.start()
    assert not run.time_out("a").handled
    run.facts.add(Fact("p"))
    assert run.time_out("a").handled


@pytest.mark.parametrize("seconds", ["soon", -1, None, True, float("nan")])
def test_a_delay_that_is_none_is_an_error_not_a_timeout_that_never_comes(seconds):
    run = Run(plot("""
        plot: p
        variables: {t: number}
        states: {a: {on: {go: {to: b, assign: {t: ?event.t}}}}, b: {after: {seconds: ?t, to: c}}, c: }
    """))
    run.start()
    step_ = run.send("go", t=seconds)
    assert step_.output == ()
    assert len(step_.errors) == 1
    assert "seconds" in step_.errors[0]


# -- errors ------------------------------------------------------------------------------------------------


def test_a_broken_guard_does_not_hold_and_is_reported_once():
    run = Run(plot("{plot: p, states: {a: {on: {e: [{to: b, when: (p ?nope)}, c]}}, b: , c: }}"))
    run.start()
    step_ = run.send("e")
    assert run.active == ["c"]
    (error,) = step_.errors
    assert "guard of 'e' in a" in error
    assert "?nope" in error


def test_a_broken_guard_without_trigger_is_reported_once_in_a_macrostep():
    run = Run(plot("""
        plot: p
        states:
          a:
            always: {to: b, when: (p ?nope)}
            states: {x: {on: {e: y}}, y: {always: z}, z: }
          b:
    """))
    assert len(run.start().errors) == 1
    step_ = run.send("e")
    assert run.active == ["a", "z"]
    assert len(step_.errors) == 1


def test_an_error_can_be_handled_in_the_plot_it_happened_in():
    run = Run(plot("""
        plot: p
        variables: {why: text}
        states: {a: {on: {e: {to: b, tell: (p ?nope)}}}, b: {on: {error: {to: c, assign: {why: ?event.reason}}}}, c: }
    """))
    run.start()
    step_ = run.send("e")
    assert step_.errors == ()
    assert run.active == ["c"]
    assert "?nope" in run.variables()["why"]


@pytest.mark.parametrize(
    "states",
    [
        "{a: {on: {go: b}, exit: {set: c.x, to: ?nope}}, b: }",
        "{a: {on: {go: b}}, b: {entry: {trigger: c.s, with: {x: ?nope}}}}",
        "{a: {on: {go: b}}, b: {use: q, with: {x: ?nope}}}",
        "{a: {on: {go: b}}, b: {use: q}}",
        "{a: {on: {go: b}}, b: {use: nowhere}}",
        "{a: {on: {go: {assign: {n: ?nope}}}}}",
        "{a: {on: {go: {emit: x, with: {n: ?nope}}}}}",
        "{a: {on: {go: b}}, b: {final: true, emit: x, with: {n: ?nope}}}",
        "{a: {on: {go: {to: b, tell: (p ?nope)}}}, b: {final: true}}",
        "{a: {on: {go: b}}, b: {after: {seconds: ?nope, to: a}}}",
    ],
)
def test_every_action_that_cannot_be_worked_out_is_reported(states):
    host = plot("{plot: p, variables: {n: number}, emits: {x: {n: number}}, states: " + states + "}")
    run = Run(host, plot("{plot: q, parameters: {x: item}, states: {s: }}"))
    run.start()
    assert len(run.send("go").errors) == 1


def test_an_error_event_that_a_chart_fires_itself_needs_no_reason():
    run = Run(plot("{plot: p, states: {a: {on: {e: {emit: error}}}}}"))
    run.start()
    assert len(run.send("e").errors) == 1


def test_a_chart_that_does_not_come_to_rest_is_stopped_and_says_where_it_goes_round():
    run = Run(plot("{plot: p, states: {idle: {on: {go: a}}, a: {always: b}, b: {always: a}}}"))
    run.start()
    before = run.machine.state
    with pytest.raises(RunawayError) as caught:
        run.send("go")
    assert set(caught.value.trail) == {"a", "b"}
    assert "a -> b" in str(caught.value)
    assert run.machine.state == before


def test_a_chart_that_sends_itself_events_for_ever_is_stopped():
    run = Run(plot("{plot: p, states: {a: {on: {e: {emit: e}}}}}"))
    run.start()
    with pytest.raises(RunawayError, match="no rest after"):
        run.send("e")


def test_a_plot_that_contains_itself_is_stopped():
    with pytest.raises(RunawayError, match="h/h/h"):
        Run(plot("{plot: p, states: {h: {use: p}}}")).start()


def test_a_plot_may_contain_itself_if_it_comes_to_an_end():
    countdown = plot("""
        plot: p
        parameters: {n: number}
        states:
          a: {always: [{to: deeper, when: (> ?n 0)}, end]}
          deeper: {use: p, with: {n: (- ?n 1)}, on: {done: end}}
          end: {final: true}
    """)
    assert Run(countdown).start(n=20).state.finished


# -- the state as a value ----------------------------------------------------------------------------------

RICH = """
    plot: p
    variables: {n: {type: number, initial: 0}}
    states:
      o:
        on: {done: e}
        regions:
          r1: {states: {x: {use: q, with: {k: 3}, on: {done: x2}}, x2: {final: true}}}
          r2: {states: {y: {dynamic: [q], after: {seconds: 5, to: y}, on: {done: y2}}, y2: {final: true}}}
      e: {final: true}
"""
INNER = """
    plot: q
    parameters: {k: {type: number, default: 1}}
    states: {a: {on: {tick: {to: a, assign: {k: (- ?k 1)}}}, always: {to: b, when: (<= ?k 0)}}, b: {final: true}}
"""


def rich():
    inner = plot(INNER.replace("parameters", "variables").replace("default", "initial"))
    outer = plot(RICH.replace(", with: {k: 3}", ""))
    return Run(outer, inner, choices={"q": Decision("q")})


def test_the_state_goes_to_json_and_back_exactly_in_the_middle_of_a_run():
    run, other = rich(), rich()
    assert run.start() == other.start()
    for name in ("nothing", "tick", "tick"):
        stored = json.dumps(other.machine.state.to_json())
        other.machine.state = MachineState.from_json(json.loads(stored))
        assert other.machine.state == run.machine.state
        assert run.send(name) == other.send(name)
    assert run.machine.state.finished


def test_a_bound_plot_goes_to_json_with_the_state():
    host = plot("{plot: p, parameters: {what: plot}, states: {h: {use: ?what, on: {done: e}}, e: }}")
    run = Run(host)
    run.start(what={"plot": "made", "states": {"a": {"on": {"go": "b"}}, "b": {"final": True}}})
    state = MachineState.from_json(json.loads(json.dumps(run.machine.state.to_json())))
    assert state == run.machine.state
    fresh = Library([host])  # as after a restart
    assert step(fresh, state, Event("go"), FakeSituation()).state.configuration() == ("e",)


def test_a_state_of_another_library_is_refused():
    run = rich()
    run.start()
    with pytest.raises(UnknownNameError, match="there is no plot 'p'"):
        step(Library([]), run.machine.state, Event("tick"), FakeSituation())
    changed = Library([plot(RICH.replace("x: {use", "x_: {use")), plot(INNER)])
    with pytest.raises(UnknownNameError, match="plot 'p' no longer has the state 'x'"):
        step(changed, run.machine.state, Event("tick"), FakeSituation())


def test_a_step_changes_nothing_it_was_given():
    run = rich()
    run.start()
    before, kept = run.machine.state, deepcopy(run.machine.state)
    first = step(run.library, before, Event("tick"), run.situation())
    assert before == kept
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
    assert state.has_activation(run.serial("y"))
    assert not state.has_activation(10_000)


def test_a_machine_that_was_not_started_or_has_ended_does_nothing():
    run = Run(plot("{plot: p, states: {a: {final: true}}}"))
    assert run.send("e").moved is False
    assert run.start().state.finished
    assert run.send("e").handled is False
