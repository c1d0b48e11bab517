"""What a step does besides moving: actions, timeouts, and errors of the chart."""

from __future__ import annotations

import pytest
from dsc_charts import Run, plot

from dsc.engine.machine import step
from dsc.engine.steps import Cancel, SetParameter, Start, StartTimer, SwitchMode
from dsc.errors import RunawayError
from dsc.events import Event
from dsc.rank import Rank
from knowledge_base.facts import Delta, Fact, fact

# -- actions -----------------------------------------------------------------------------------------------


def test_external_actions_become_output_in_order_with_arguments_worked_out():
    run = Run(
        plot("""
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
    """)
    )
    output = run.start(item="cup1").output
    serial = run.serial("a")
    assert output == (
        SetParameter("arm", "approach", "cup1"),
        SwitchMode("base", "neutral"),
        Start(f"a{serial}.2", serial, "arm", "pick", {"item": "cup1", "n": 3}, {"ok": "picked"}, 3.0, Rank(depth=1)),
    )
    assert run.send("e").output == (Cancel(serial), SwitchMode("arm", "neutral"))


def test_every_execution_has_an_id_of_its_own():
    run = Run(plot("{plot: p, states: {a: {entry: [{trigger: c.s}, {trigger: c.s}], on: {e: a}}}}"))
    ids = [o.action_id for s in (run.start(), run.send("e"), run.send("e")) for o in s.output if isinstance(o, Start)]
    assert len(ids) == len(set(ids)) == 6


def test_actions_of_a_transition_are_done_between_leaving_and_entering_in_order():
    run = Run(
        plot("""
        plot: p
        variables: {n: {type: number, initial: 1}}
        states:
          a: {exit: {set: c.x, to: ?n}, on: {e: {to: b, assign: {n: (+ ?n 1)}, tell: (seen ?n), emit: local, with: {n: ?n}}}}
          b: {entry: {set: c.x, to: ?n}, on: {local: {assign: {n: (+ ?n ?event.n)}}}}
    """)
    )
    run.start()
    step_ = run.send("e")
    assert [o.value for o in step_.output] == [1, 2]
    assert step_.knowledge == Delta(added=(fact("seen", 2),))
    assert run.variables()["n"] == 4


def test_changed_facts_are_seen_by_later_guards_of_the_same_macrostep():
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


def test_a_fact_added_and_removed_in_one_macrostep_is_one_change():
    run = Run(plot("{plot: p, states: {a: {on: {e: {to: b, tell: (p)}}}, b: {always: {to: c, tell: (not (p))}}, c: }}"))
    run.start()
    assert run.send("e").knowledge == Delta(removed=(Fact("p"),))


def test_assignments_of_one_action_do_not_see_each_other():
    run = Run(
        plot("""
        plot: p
        variables: {x: {type: number, initial: 1}, y: {type: number, initial: 2}}
        states: {a: {on: {swap: {assign: {x: ?y, y: ?x}}}}}
    """)
    )
    run.start()
    run.send("swap")
    assert run.variables() == {"x": 2, "y": 1}


def test_local_events_come_before_the_next_and_in_order():
    run = Run(
        plot(
            """
        plot: p
        variables: {log: {type: number, initial: 0}}
        states:
          a:
            on:
              e: {do: [{emit: one}, {emit: two}]}
              one: {assign: {log: (+ (* ?log 10) 1)}, emit: three}
              two: {assign: {log: (+ (* ?log 10) 2)}}
              three: {assign: {log: (+ (* ?log 10) 3)}}
    """.replace("(* ?log 10)", "?log")
        )
    )
    run.start()
    assert [m.event.name for m in run.send("e").microsteps] == ["e", "one", "two", "three"]


def test_always_is_looked_at_before_local_events():
    run = Run(
        plot("""
        plot: p
        states: {a: {on: {e: {to: b, emit: x}}}, b: {on: {x: wrong}, always: c}, c: {on: {x: d}}, d: , wrong: }
    """)
    )
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
    run = Run(
        plot("""
        plot: p
        parameters: {t: number}
        states: {a: {after: [{seconds: 5, to: b}, {seconds: (+ ?t 1), to: c}], on: {e: a}}, b: , c: }
    """)
    )
    first = run.start(t=1)
    old = run.serial("a")
    assert first.output == (StartTimer(old, 0, 5.0), StartTimer(old, 1, 2.0))
    new = run.send("e")
    assert new.output == (Cancel(old), StartTimer(run.serial("a"), 0, 5.0), StartTimer(run.serial("a"), 1, 2.0))
    late = step(run.library, run.machine.state, Event("after", to=old, exact=True, number=0), run.situation())
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
    run = Run(
        plot("""
        plot: p
        variables: {t: any}
        states: {a: {on: {go: {to: b, assign: {t: ?event.t}}}}, b: {after: {seconds: ?t, to: c}}, c: }
    """)
    )
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
    run = Run(
        plot("""
        plot: p
        states:
          a:
            always: {to: b, when: (p ?nope)}
            states: {x: {on: {e: y}}, y: {always: z}, z: }
          b:
    """)
    )
    assert len(run.start().errors) == 1
    step_ = run.send("e")
    assert run.active == ["a", "z"]
    assert len(step_.errors) == 1


def test_an_error_can_be_handled_in_the_plot_it_happened_in():
    run = Run(
        plot("""
        plot: p
        variables: {why: text}
        states: {a: {on: {e: {to: b, tell: (p ?nope)}}}, b: {on: {error: {to: c, assign: {why: ?event.reason}}}}, c: }
    """)
    )
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
