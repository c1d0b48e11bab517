"""Time in charts: reactions that come again and again, and states that stay at least a while."""

from __future__ import annotations

import json

import pytest
from dsc_charts import Run, modes, plot
from dsc_runs import Ran

from dsc.engine.machine_forms import read_state
from dsc.engine.steps import Cancel, StartTimer
from knowledge_base.facts import Fact

P = Fact("p")
COUNTING = """
    plot: p
    variables: {n: {type: number, initial: 0}}
    states:
      a:
        every:
          - {seconds: 0.5, assign: {n: (+ ?n 1)}, when: (p)}
          - {seconds: 2, to: b}
        on: {go: b}
      b: {final: true}
"""


def tick(run, state, number=0):
    return run.send("every", to=state, exact=True, number=number)


def timers(step):
    return [(one.event, one.index, one.seconds) for one in step.output if isinstance(one, StartTimer)]


class Started(Run):
    def __init__(self, *plots, **keys):
        super().__init__(*plots, **keys)
        self.first_step = self.start()


def started(text, *inner, **keys):
    return Started(plot(text), *map(plot, inner), **keys)


# -- every -------------------------------------------------------------------------------------------------


def test_a_period_starts_with_its_state_and_again_whenever_it_has_passed():
    run = started(COUNTING)
    assert timers(run.first_step) == [("every", 0, 0.5), ("every", 1, 2.0)]
    assert timers(tick(run, "a")) == [("every", 0, 0.5)]


def test_a_reaction_is_taken_when_its_guard_holds_and_the_period_goes_on_either_way():
    run = started(COUNTING)
    assert not tick(run, "a").handled
    run.facts = {P}
    for _ in range(3):
        assert timers(tick(run, "a")) == [("every", 0, 0.5)]
    assert run.variables()["n"] == 3


def test_a_reaction_that_leaves_its_state_ends_the_period():
    run = started(COUNTING)
    step = tick(run, "a", 1)
    assert run.machine.state.finished
    assert timers(step) == []
    assert any(isinstance(output, Cancel) for output in step.output)


def test_a_reaction_that_enters_its_state_anew_starts_the_period_once():
    run = started("{plot: p, states: {a: {every: {seconds: 1, to: a}}}}")
    assert timers(tick(run, "a")) == [("every", 0, 1.0)]


def test_the_period_is_worked_out_anew_each_time():
    run = started("""
        plot: p
        variables: {t: {type: number, initial: 1}}
        states: {a: {every: {seconds: ?t, assign: {t: (+ ?t 1)}}}}
    """)
    assert timers(tick(run, "a")) == [("every", 0, 2.0)]
    assert timers(tick(run, "a")) == [("every", 0, 3.0)]


@pytest.mark.parametrize("nonsense", ["0", "-1", "soon", "true"])
def test_a_period_that_is_none_is_an_error_of_the_chart(nonsense):
    run = started(f"""
        plot: p
        parameters: {{t: {{type: any, default: {nonsense}}}}}
        states: {{a: {{every: {{seconds: ?t, to: b}}, on: {{error: {{to: b, assign: {{}}}}}}}}, b: }}
    """)
    assert run.active == ["b"]


def test_a_run_reacts_at_every_period_until_it_ends():
    ran = Ran("""
        plot: p
        variables: {n: {type: number, initial: 0}}
        states:
          a:
            every: {seconds: 0.5, assign: {n: (+ ?n 1)}}
            always: {to: b, when: (>= ?n 4)}
          b: {final: true}
    """)
    assert ran.end.finished
    assert ran.at == 2.0


def test_a_run_in_which_only_periods_pass_in_vain_ends_with_a_problem():
    ran = Ran(
        "{plot: p, states: {a: {every: [{seconds: 1, when: (p), to: b}, {seconds: 3, emit: x}]}, b: {final: true}}}"
    )
    assert not ran.end.finished
    assert "no skill, timer or event is pending" in (ran.end.problem or "")
    assert ran.at == 3.0


def test_a_period_may_see_what_a_skill_has_observed_meanwhile():
    ran = Ran("""
        plot: p
        states:
          work:
            regions:
              one: {states: {s: {entry: {trigger: arm.look, with: {glimpses: 2, seconds: 1.2}}, on: {found: s2, glimpse: {}}}, s2: {final: true}}}
              other: {states: {t: {every: {seconds: 1, when: (p), to: t2}}, t2: {final: true}}}
            on: {done: b}
          b: {final: true}
    """)
    assert ran.end.finished
    entered = [
        (r.t, state) for r in ran.records if r.type == "step" for m in r.data["microsteps"] for state in m["entered"]
    ]
    assert (2.0, "t2") in entered


# -- at least ----------------------------------------------------------------------------------------------

LINGERING = """
    plot: p
    states:
      a:
        at_least: 2
        on: {go: b, note: {emit: noted}}
        after: {seconds: 1, to: late}
        always: {to: c, when: (p)}
      b:
      c:
      late:
"""


def passes(run, state):
    return run.send("at_least", to=state, exact=True, number=0)


def test_a_least_time_is_a_timer():
    assert timers(started(LINGERING).first_step) == [("at_least", 0, 2.0), ("after", 0, 1.0)]


def test_an_event_that_would_leave_too_early_waits():
    run = started(LINGERING)
    step = run.send("go")
    assert step.handled
    assert not step.moved
    assert run.active == ["a"]
    step = passes(run, "a")
    assert run.active == ["b"]
    assert step.microsteps[0].event.name == "go"


def test_the_first_event_that_waited_comes_first_and_the_others_are_gone_with_the_state():
    run = started(LINGERING)
    run.time_out("a")
    run.send("go")
    passes(run, "a")
    assert run.active == ["late"]


def test_an_event_that_leaves_no_state_does_not_wait():
    run = started(LINGERING)
    assert run.send("note").moved


def test_a_transition_without_trigger_waits_too():
    run = started(LINGERING, facts=[P])
    assert run.active == ["a"]
    passes(run, "a")
    assert run.active == ["c"]


def test_after_the_time_events_are_taken_at_once():
    run = started(LINGERING)
    passes(run, "a")
    assert run.active == ["a"]
    run.send("go")
    assert run.active == ["b"]


def test_states_around_and_inside_do_not_wait():
    text = """
        plot: p
        states:
          o:
            on: {stop: out}
            states:
              a: {at_least: 5, on: {go: b}, states: {x: {on: {go: y, far: z}}, y: , z: }}
              b:
          out:
    """
    run = started(text)
    run.send("go")
    assert run.active == ["o", "a", "y"]
    run.send("go")
    assert run.active == ["o", "a", "y"]
    run.send("stop")
    assert run.active == ["out"]


def test_completion_waits_too_and_a_guard_is_asked_again():
    run = started("{plot: p, states: {a: {at_least: 1, on: {done: {to: b, when: (p)}}}, b: }}", facts=[P])
    assert run.active == ["a"]
    run.facts = set()
    passes(run, "a")
    assert run.active == ["a"]


def test_a_waiting_event_is_stored_with_the_state():
    run, other = started(LINGERING), started(LINGERING)
    run.send("go", x=1)
    stored = json.loads(json.dumps(run.machine.state.to_json()))
    other.machine.state = read_state(stored, other.library)
    assert other.machine.state == run.machine.state
    passes(other, "a")
    assert other.active == ["b"]


def test_a_period_does_not_pile_up_while_its_state_waits():
    run = started("{plot: p, states: {a: {at_least: 3, every: {seconds: 1, to: b}}, b: }}")
    for _ in range(2):
        assert not tick(run, "a").handled
    passes(run, "a")
    assert run.active == ["a"]
    tick(run, "a")
    assert run.active == ["b"]


def test_one_state_may_be_left_while_another_still_waits():
    run = started("""
        plot: p
        states:
          o:
            regions:
              r1: {states: {a: {at_least: 1, on: {go: a2}}, a2: }}
              r2: {states: {b: {at_least: 5, on: {go: b2}}, b2: }}
    """)
    run.send("at_least", to="a", exact=True, number=0)
    run.send("go")
    assert run.machine.state.configuration() == ("o", "a2", "b")
    run.send("at_least", to="b", exact=True, number=0)
    assert run.machine.state.configuration() == ("o", "a2", "b2")


def test_a_run_stays_at_least_as_long():
    ran = Ran("{plot: p, states: {a: {at_least: 2, after: {seconds: 0.5, to: b}}, b: {final: true}}}")
    assert ran.end.finished
    assert ran.at == 2.0


def test_a_skills_answer_waits_too():
    ran = Ran("""
        plot: p
        states:
          a: {at_least: 5, entry: {trigger: arm.grasp, with: {seconds: 1}}, on: {grasped: b}}
          b: {final: true}
    """)
    assert ran.end.finished
    assert ran.at == 5.0


def test_entering_anew_starts_the_least_time_anew():
    run = started("{plot: p, states: {o: {on: {again: o}, states: {a: {at_least: 1, on: {go: b}}, b: }}}}")
    run.send("go")
    run.send("again")
    passes(run, "a")
    assert run.active == ["o", "a"]
    assert modes(run.send("go")) == []
    assert run.active == ["o", "b"]


OUT = "{plot: p, states: {o: {on: {out: z}, states: {a: {at_least: 1, on: {go: b}}, b: }}, z: {on: {back: o}}}}"


def test_a_state_that_is_left_before_its_least_time_leaves_no_trace_in_the_configuration():
    early, late = started(OUT), started(OUT)
    passes(late, "a")
    for run in (early, late):
        run.send("out")
    assert early.machine.state.root.configuration == late.machine.state.root.configuration


def test_an_event_that_waited_for_the_least_time_is_dropped_when_its_state_is_left():
    run = started(OUT)
    for event in ("go", "out", "back"):
        run.send(event)
    passes(run, "a")
    assert run.active == ["o", "a"]
