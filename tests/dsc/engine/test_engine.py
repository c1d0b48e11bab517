"""The pure step: entering and leaving in order, and completion."""

from __future__ import annotations

from dsc_charts import Run, marked, modes, plot

from dsc.engine.machine_state import MachineState
from dsc.events import Event
from dsc.model.plot import ActionPlot


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
    run = Run(of(shown("a", on={"again": "a"}, after={"seconds": 5, "to": "a"})))
    run.start()
    before = run.serial("a")
    step_ = run.send("again")
    assert modes(step_) == ["-a", "+a"]
    assert step_.exited("a")
    assert step_.entered("a")
    assert run.serial("a") > before


def test_a_transition_without_target_leaves_nothing():
    run = Run(
        of(shown("a", on={"count": {"assign": {"n": "(+ ?n 1)"}}}), variables={"n": {"type": "number", "initial": 0}})
    )
    run.start()
    for _ in range(2):
        step_ = run.send("count")
        assert step_.handled
        assert modes(step_) == []
        assert not step_.entered("a")
    assert run.variables()["n"] == 2


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
    run = Run(
        plot("""
        plot: p
        states:
          outer:
            on: {done: wrong}
            states: {a: {on: {done: b}, states: {c: {on: {e: d}}, d: {final: true}}}, b: {}}
          wrong:
    """)
    )
    run.start()
    run.send("e")
    assert run.active == ["outer", "b"]


def test_regions_are_done_when_each_has_reached_its_final_state():
    run = Run(
        plot("""
        plot: p
        states:
          o:
            on: {done: b}
            regions:
              r1: {states: {x: {on: {e: x2}}, x2: {final: true}}}
              r2: {states: {y: {on: {f: y2}}, y2: {final: true}}}
          b:
    """)
    )
    run.start()
    run.send("e")
    assert run.active == ["o", "x2", "y"]
    run.send("f")
    assert run.active == ["b"]


def test_regions_done_in_one_step_complete_once():
    run = Run(
        plot("""
        plot: p
        variables: {n: {type: number, initial: 0}}
        states:
          o:
            on: {done: {assign: {n: (+ ?n 1)}}}
            regions:
              r1: {states: {x: {on: {e: x2}}, x2: {final: true}}}
              r2: {states: {y: {on: {e: y2}}, y2: {final: true}}}
    """)
    )
    run.start()
    run.send("e")
    assert run.variables()["n"] == 1


def test_regions_that_begin_in_their_final_states_are_done_once_all_are_entered():
    run = Run(
        plot("""
        plot: p
        states:
          o: {on: {done: b}, regions: {r1: {states: {x: {final: true}}}, r2: {states: {y: {final: true}}}}}
          b:
    """)
    )
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
    run = Run(
        plot("{plot: p, emits: {r: {n: number}}, states: {a: {on: {e: b}}, b: {final: true, emit: r, with: {n: 3}}}}")
    )
    run.start()
    assert run.send("e").emitted == (Event("r", {"n": 3}),)
