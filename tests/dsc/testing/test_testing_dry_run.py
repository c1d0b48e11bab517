"""The machine alone: events by hand, time that passes when it is told to."""

from __future__ import annotations

import pytest
from dsc_charts import PROPERTY, plot
from fetching import PLOTS, SCHEMA
from hypothesis import given
from hypothesis import strategies as st

from dsc import Event
from dsc.testing import Answer, DryRun, consumed, emitted, entered, rehearse, switched, took, world
from knowledge_base import InputError, UnknownNameError


def fetch():
    return DryRun(PLOTS, "fetch", {"item": "cup"}, world(SCHEMA, "cup - item"))


def running(run):
    return [f"{start.component}.{start.skill}" for start in run.running]


def test_skills_are_answered_by_hand():
    run = fetch()
    assert run.active == ("work", "go", "go/driving")
    assert running(run) == ["base.drive"]
    run.answer("base.drive", "arrived")
    assert running(run) == ["arm.grasp"]
    run.answer("arm.grasp", "slipped", {"item": "cup"})
    assert run.knowledge.ask("(= (failures cup) 1)")
    step = run.answer("arm.grasp", "grasped", observed="(lost ?item)")
    assert step.emitted == (Event("fetched", {"item": "cup"}),)
    assert run.finished
    assert run.active == ()
    assert run.knowledge.ask("(and (holding cup) (not (lost cup)))")
    assert (run.emitted, running(run), run.now) == (step.emitted, [], 0)


def test_an_answer_is_for_the_state_that_asked_and_goes_by_the_charts_name():
    run = DryRun([plot("""
        plot: p
        states:
          o:
            regions:
              r1: {states: {x: {entry: {trigger: arm.grasp, with: {item: one}, as: {ok: got}}, on: {got: x2}}, x2: {final: true}}}
              r2: {states: {y: {entry: {trigger: arm.grasp, with: {item: two}, as: {ok: got}}, on: {got: y2}}, y2: {final: true}}}
    """)], "p")  # fmt: skip
    assert [start.arguments["item"] for start in run.running] == ["one", "two"]
    run.answer("arm.grasp", "ok")
    assert run.active == ("o", "x2", "y")
    run.answer("arm.grasp", "ok")
    assert run.active == ("o", "x2", "y2")


def test_a_skill_that_does_not_run_cannot_answer():
    run = fetch()
    with pytest.raises(UnknownNameError, match=r"no skill 'base.drvie' is running; did you mean 'base.drive'"):
        run.answer("base.drvie", "arrived")
    run.send("stop")
    with pytest.raises(UnknownNameError):
        run.answer("base.drive", "arrived")


def test_leaving_a_state_ends_its_skills_and_timers():
    run = fetch()
    assert run.send("stop").handled
    assert running(run) == []
    assert run.advance(1000) == ()


def test_a_run_that_is_ended_from_outside_leaves_everything_in_order():
    run = fetch()
    step = run.leave()
    assert switched(step, "base", "neutral")
    assert step.microsteps[0].exited == ("go/driving", "go", "work")
    assert (run.active, running(run), run.finished) == ((), [], False)


def test_timeouts_come_when_they_are_due_and_in_order():
    run = fetch()
    assert run.advance(29.9) == ()
    (blocked,) = run.advance(0.1)
    assert took(blocked, "driving", "after", "blocked")
    assert run.active[-1] == "go_no_path_0_wait/pause"
    later = run.advance(10 + 30 + 10 + 15)
    assert [took(step, trigger="after") for step in later] == [True, True, True]
    assert run.now == pytest.approx(95)
    assert run.active[-1] == "go/driving"
    run.advance(15)
    assert entered(run, "without")


def test_a_skill_that_does_not_answer_in_time_has_timed_out():
    text = "{plot: p, emits: {late: {s: number}}, states: {a: {entry: {trigger: arm.grasp, within: 7}, on: {timed_out: {to: e, emit: late, with: {s: ?event.seconds}}, ok: b}}, b: {entry: {trigger: arm.grasp}, on: {timed_out: a}}, e: {final: true}}}"
    run = DryRun([plot(text)], "p")
    run.advance(6)
    run.answer("arm.grasp", "ok")
    assert run.advance(299) == ()  # the first one has answered; the second one has the time that skills have
    run.advance(1)
    run.advance(7)
    assert emitted(run, "late", s=7)
    assert running(run) == []


def test_a_skill_ends_once_also_where_its_state_goes_on():
    text = "{plot: p, states: {a: {entry: {trigger: arm.grasp, within: 7}, on: {ok: {}, timed_out: {}}}}}"
    answered = DryRun([plot(text)], "p")
    assert answered.answer("arm.grasp", "ok").handled
    assert running(answered) == []
    assert answered.advance(10) == ()
    late = DryRun([plot(text)], "p")
    assert len(late.advance(10)) == 1
    assert running(late) == []


def test_seconds_add_up_whatever_floating_point_makes_of_them():
    run = DryRun([plot("{plot: p, states: {a: {after: {seconds: 0.8, to: e}}, e: {final: true}}}")], "p")
    assert 0.7 + 0.1 < 0.8
    run.advance(0.7)
    run.advance(0.1)
    assert run.finished


def test_time_does_not_go_backwards():
    with pytest.raises(InputError, match="time does not go backwards: -1 s"):
        fetch().advance(-1)


def test_an_event_from_outside_that_nobody_takes_is_seen_to_be_unhandled():
    step = fetch().send("stpo", why="typing")
    assert not step.handled
    assert step.event == Event("stpo", {"why": "typing"})


def test_a_change_of_the_world_is_looked_at():
    waiting = plot("{plot: p, states: {a: {always: {to: e, when: (and (open) (lost cup))}}, e: {final: true}}}")
    run = DryRun([waiting], "p", knowledge=world(SCHEMA, "cup - item", "(holding cup)"))
    assert not run.change("(open)").moved
    assert run.change("(forall (?i - item) (when (holding ?i) (lost ?i)))").moved
    assert run.finished


def test_delayed_events_come_later():
    text = "{plot: p, dialect: scxml, states: {a: {entry: {emit: go, delay: 4}, on: {go: e}}, e: {final: true}}}"
    run = DryRun([plot(text)], "p")
    assert run.advance(3.9) == ()
    run.advance(0.1)
    assert run.finished


@PROPERTY
@given(st.lists(st.sampled_from(["grasped", "slipped"]), max_size=4), st.integers(0, 3))
def test_by_hand_and_rehearsed_a_plot_does_the_same(grasps, blocked):
    """The two ways of running differ in who gives the answers, and in nothing that a plot can tell."""
    answers = [Answer("slipped", {"item": "cup"}) if name == "slipped" else Answer("grasped") for name in grasps]
    answers += [Answer("slipped", {"item": "cup"})] * 4
    drives = ["no_path"] * blocked + ["arrived"] * 5
    whole = rehearse(PLOTS, "fetch", {"item": "cup"}, knowledge=world(SCHEMA, "cup - item"),
                     skills={"base.drive": drives, "arm.grasp": answers})  # fmt: skip
    run, to_drive, to_grasp = fetch(), iter(drives), iter(answers)
    while not run.finished:
        if "base.drive" in running(run):
            run.answer("base.drive", next(to_drive))
        elif "arm.grasp" in running(run):
            answer = next(to_grasp)
            run.answer("arm.grasp", answer.event, answer.attributes)
        else:
            run.advance(10)
    assert [step.microsteps for step in run.steps] == [step.microsteps for step in whole.steps]
    assert run.emitted == whole.emitted
    assert run.knowledge.facts() == whole.knowledge.facts()
    assert consumed(run, "no_path") == bool(blocked)
