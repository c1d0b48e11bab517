"""Whole runs with scripted skills: what they answer, what they remember, and where a script is wrong."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import pytest
from dsc_charts import plot
from fetching import PLOTS, SCHEMA, Arm, Base

from dsc import Event, Library
from dsc.errors import SkillError
from dsc.model.plot import ActionPlot
from dsc.testing import Answer, Call, entered, exited, rehearsal, rehearse, started, took, trail, world
from knowledge_base import Delta, InputError, ParseError, UnknownNameError, fact

SLIPPED = Answer("slipped", {"item": "cup"}, after=2)


def fetch(skills, **more):
    known = world(SCHEMA, "cup - item", "(= (failures cup) 0)")
    return rehearse(PLOTS, "fetch", {"item": "cup"}, skills=skills, knowledge=known, **more)


def test_a_run_is_told_whole():
    run = fetch({"base.drive": Answer("arrived", after=5), "arm.grasp": [SLIPPED, "grasped"]}, like=[Arm(), Base()])
    assert (run.finished, run.problem, run.emitted) == (True, None, (Event("fetched", {"item": "cup"}),))
    assert run.calls == (
        Call("base.drive", {"to": "shelf"}, 0.0),
        Call("arm.grasp", {"item": "cup"}, 5.0),
        Call("arm.grasp", {"item": "cup"}, 7.0),
    )
    assert run.seconds == pytest.approx(8)
    assert run.knowledge.ask("(and (holding cup) (= (failures cup) 0))")
    assert took(run, "take", rule="slipped: retry")
    assert [record.type for record in run.records][-1] == "end"
    assert trail(run)[-1] == "ended"


def test_a_library_and_its_plots_are_the_same_to_a_rehearsal():
    skills = {"base.drive": "arrived", "arm.grasp": "grasped"}
    known = [world(SCHEMA, "cup - item") for _ in range(2)]
    both: list[Iterable[ActionPlot]] = [PLOTS, Library(PLOTS)]
    runs = [rehearse(plots, "fetch", {"item": "cup"}, skills=skills, knowledge=kb)
            for plots, kb in zip(both, known, strict=True)]  # fmt: skip
    assert runs[0].records == runs[1].records
    assert runs[0].finished


def test_one_answer_is_for_every_call_and_a_function_makes_its_own():
    def third_time_lucky(call):
        lucky.append(call)
        return "grasped" if len(lucky) == 3 else Answer("slipped", {"item": call.arguments["item"]})

    lucky: list[Any] = []
    run = fetch({"base.drive": "arrived", "arm.grasp": third_time_lucky})
    assert [call.at for call in lucky] == [1, 2, 3]
    assert run.calls[1:] == tuple(lucky)
    again = fetch({"base.drive": "arrived", "arm.grasp": SLIPPED})
    assert len(again.calls) == 4
    assert again.knowledge.ask("(lost cup)")


def test_an_observation_of_a_skill_is_a_change_or_an_effect_over_its_arguments():
    looking = plot("""
        plot: look
        parameters: {item: item}
        states:
          a: {entry: {trigger: eye.look, with: {item: ?item}}, on: {seen: b}}
          b: {entry: {trigger: eye.look, with: {item: ?item}}, on: {seen: c}}
          c: {always: {to: d, when: (and (holding ?item) (= (failures ?item) 4))}}
          d: {final: true}
    """)
    answers = [
        Answer("seen", observed="(and (increase (failures ?item) 4) (when (lost ?item) (holding ?item)))"),
        Answer("seen", observed=Delta(removed=(fact("lost", "cup"),))),
    ]
    known = world(SCHEMA, "cup - item", "(lost cup)")
    run = rehearse([looking], "look", {"item": "cup"}, skills={"eye.look": answers}, knowledge=known)
    assert run.finished
    assert not known.ask("(lost cup)")
    assert {record.data["author"] for record in run.records if record.type == "knowledge"} == {"eye"}


FEELING = plot("""
    plot: feel
    variables: {felt: {type: number, initial: 0}}
    emits: {end: {felt: number}}
    states:
      a:
        entry: {trigger: arm.grasp, with: {item: cup}}
        on: {felt: {assign: {felt: (+ ?felt ?event.force)}}, grasped: {to: e, emit: end, with: {felt: ?felt}}}
      e: {final: true}
""")


def test_a_skill_may_report_on_its_way():
    reports = (Answer("felt", {"force": 2}, after=1), Answer("felt", {"force": 3}, after=4))
    run = rehearse([FEELING], "feel", skills={"arm.grasp": Answer("grasped", after=0.5, reports=reports)}, like=[Arm()])
    assert run.emitted == (Event("end", {"felt": 5}),)
    assert run.seconds == pytest.approx(5.5)


def test_a_free_skill_may_say_one_thing_with_other_attributes_each_time():
    reports = (
        Answer("felt", {"force": 2}),
        Answer("felt", {"force": 3, "where": "thumb"}),
        Answer("felt", {"force": 4}),
    )
    run = rehearse([FEELING], "feel", skills={"arm.grasp": Answer("grasped", reports=reports)})
    assert run.emitted == (Event("end", {"felt": 9}),)


def test_a_skill_may_break_or_never_answer():
    text = """
        plot: p
        emits: {why: {reason: text}, late: }
        states:
          a: {entry: {trigger: arm.grasp, with: {item: cup}, within: 40},
              on: {skill_error: {to: e, emit: why, with: {reason: ?event.reason}}, timed_out: {to: e, emit: late}, grasped: e}}
          e: {final: true}
    """
    broken = rehearse([plot(text)], "p", skills={"arm.grasp": SkillError("the gripper is stuck")})
    assert broken.emitted == (Event("why", {"reason": "arm.grasp: SkillError: the gripper is stuck"}),)
    late = rehearse([plot(text)], "p", skills={"arm.grasp": Answer("grasped", after=math.inf)})
    assert late.emitted == (Event("late"),)
    assert late.seconds == pytest.approx(40)


def test_components_of_ones_own_stand_beside_scripted_ones():
    class Real(Base):
        async def switch(self, mode):
            await super().switch(mode)
            modes.append(mode)

    modes: list[str] = []
    run = fetch({"arm.grasp": "grasped"}, components=[Real()])
    assert run.finished
    assert modes == ["neutral"]
    assert [call.skill for call in run.calls] == ["arm.grasp"]
    assert started(run, "base.drive", to="shelf")


ROUND = "{plot: p, states: {a: {entry: {trigger: arm.turn}, on: {turned: a}}, e: {final: true}}, emits: {turn: }}"


def test_no_rehearsal_goes_on_for_ever(monkeypatch):
    turning = plot(ROUND.replace("turned: a", "turned: {to: a, emit: turn}"))
    run = rehearse([turning], "p", skills={"arm.turn": Answer("turned", after=10)}, until=35)
    assert (run.finished, run.problem, run.seconds) == (False, "it still runs after 35 s", 35)
    assert [event.name for event in run.emitted] == ["turn"] * 3
    assert exited(run.steps[-1], "a")  # and what it had started was ended
    day = rehearse([turning], "p", skills={"arm.turn": Answer("turned", after=200)})
    assert day.problem == "it still runs after 86400 s"
    monkeypatch.setattr(rehearsal, "MOST_STEPS", 50)
    assert (
        rehearse([turning], "p", skills={"arm.turn": Answer("turned", after=0)}).problem
        == "it still runs after 50 steps"
    )


# -- what comes from outside -------------------------------------------------------------------------------


def test_events_come_at_their_time():
    run = fetch({"base.drive": Answer("arrived", after=20)}, events=[(7, "stop")])
    assert run.emitted == (Event("stopped"),)
    assert run.seconds == pytest.approx(7)


def test_a_run_waits_for_events_that_are_still_to_come():
    waiting = plot(
        "{plot: p, receives: {go: {n: number}}, states: {a: {on: {go: {to: e, when: (= ?event.n 2)}}}, e: {final: true}}}"
    )
    run = rehearse([waiting], "p", events=[(100, Event("go", {"n": 2})), (5, Event("go", {"n": 1}))])
    assert run.finished
    assert run.seconds == pytest.approx(100)
    too_few = rehearse([waiting], "p", events=[(5, Event("go", {"n": 1}))])
    assert too_few.problem == "deadlock: no skill, timer or event is pending"
    assert too_few.seconds == pytest.approx(5)


def test_an_event_still_pending_at_the_end_of_the_run_is_ignored():
    run = fetch({"base.drive": "arrived", "arm.grasp": "grasped"}, events=[(1000, "stop")])
    assert run.emitted == (Event("fetched", {"item": "cup"}),)
    assert run.seconds == pytest.approx(2)


def test_others_change_the_knowledge():
    waiting = plot("{plot: p, states: {a: {always: {to: e, when: (and (open) (not (near shelf)))}}, e: {final: true}}}")
    changes: list[tuple[float, Delta | str]] = [(3, "(open)"), (8, Delta(removed=(fact("near", "shelf"),)))]
    run = rehearse([waiting], "p", knowledge=world(SCHEMA, facts="(near shelf)"), changes=changes)
    assert run.finished
    assert run.seconds == pytest.approx(8)
    assert [step.moved for step in run.steps] == [True, False, True]


@pytest.mark.parametrize(
    ("coming", "said"),
    [
        ({"events": [(1, "done")]}, "the event 'done' is fired by the executive itself"),
        ({"changes": [(1, "(opne)")]}, "did you mean 'open'"),
        ({"changes": [(1, Delta(added=(fact("opne"),)))]}, "did you mean 'open'"),
    ],
)
def test_an_invalid_event_or_change_is_refused_before_the_run(coming, said):
    with pytest.raises(InputError, match=said):
        fetch({}, **coming)


# -- scripts that are wrong --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("skills", "said"),
    [
        ({"base.drive": "arrived", "arm.grap": "grasped"}, "component 'arm' has no skill 'grap'; did you mean 'grasp'"),
        ({"arm.grasp": ["grasped", "graspd"]}, "skill 'arm.grasp' has no outcome 'graspd'; did you mean 'grasped'"),
        ({"arm.grasp": "slipped"}, "the outcome 'slipped' of 'arm.grasp' needs its attribute 'item'"),
        (
            {"arm.grasp": Answer("grasped", {"item": "cup"})},
            "the outcome 'grasped' of 'arm.grasp' has no attribute 'item'",
        ),
        ({"arm.grasp": Answer("grasped", reports=(Answer("flet"),))}, "no outcome 'flet'; did you mean 'felt'"),
    ],
)
def test_a_script_that_is_not_like_the_skills_is_refused(skills, said):
    with pytest.raises(InputError, match=said):
        fetch(skills, like=[Arm(), Base()])


@pytest.mark.parametrize("name", ["grasp", ".grasp", "arm."])
def test_a_script_names_components_and_skills(name):
    with pytest.raises(ParseError, match=r"COMPONENT\.SKILL"):
        fetch({name: "grasped"})


@pytest.mark.parametrize(
    ("skills", "said"),
    [
        (
            {"base.drive": "arrived", "arm.grap": "grasped"},
            "the script has no skill 'arm.grasp'; did you mean 'arm.grap'",
        ),
        ({"base.drive": "arrived", "arm.grasp": [SLIPPED]}, "the script of 'arm.grasp' has no answer to call 2"),
        (
            {"base.drive": "arrived", "arm.grasp": Answer("grasped", observed="(holdign ?item)")},
            "did you mean 'holding'",
        ),
    ],
)
def test_a_script_that_does_not_fit_the_run_raises_an_error(skills, said):
    with pytest.raises(InputError, match=said):
        fetch(skills)


def test_an_answer_made_on_the_spot_is_held_against_the_skill_too():
    with pytest.raises(UnknownNameError, match=r"skill 'arm.grasp' has no outcome 'grabbed'"):
        fetch({"base.drive": "arrived", "arm.grasp": lambda _call: "grabbed"}, like=[Arm(), Base()])


def test_a_failed_assertion_about_a_call_fails_the_test_whatever_the_plot_makes_of_it():
    coping = plot(
        "{plot: p, states: {a: {entry: {trigger: arm.grasp, with: {item: cup}}, on: {grasped: e, skill_error: e}}, e: {final: true}}}"
    )

    def reply(call):
        assert call.arguments == {"item": "can"}, "the wrong item"
        return "grasped"

    with pytest.raises(AssertionError, match="the wrong item"):
        rehearse([coping], "p", skills={"arm.grasp": reply})
    broken = rehearse([coping], "p", skills={"arm.grasp": InputError("broken on purpose")})
    assert broken.problem == "arm.grasp: broken on purpose"


@pytest.mark.parametrize("replies", [[None], lambda _call: None, ["grasped", 3]])
def test_a_reply_that_is_not_an_outcome_is_refused(replies):
    with pytest.raises(InputError, match=r"the script of 'arm.grasp' answers (None|3), which is not an outcome's name"):
        fetch({"base.drive": "arrived", "arm.grasp": replies})


def test_a_call_that_the_real_skill_would_refuse_is_refused():
    wrong = plot(
        "{plot: p, states: {a: {entry: {trigger: arm.grasp, with: {itm: cup}}, on: {grasped: e, skill_error: e}}, e: {final: true}}}"
    )
    with pytest.raises(UnknownNameError, match="has no parameter 'itm'; did you mean 'item'"):
        rehearse([wrong], "p", skills={"arm.grasp": "grasped"}, like=[Arm()])


def test_a_wrong_start_is_refused():
    with pytest.raises(UnknownNameError, match="did you mean 'fetch'"):
        rehearse(PLOTS, "fecth")
    with pytest.raises(UnknownNameError, match="has no parameter 'itm'"):
        rehearse(PLOTS, "fetch", {"itm": "cup"})


@pytest.mark.parametrize(
    ("said", "objects", "facts"),
    [("no type 'itme'", "cup - itme", ""), ("'opne'", "", "(opne)"), ("'cup'", "", "(holding cup)")],
)
def test_a_world_with_a_mistake_is_refused(said, objects, facts):
    with pytest.raises(InputError, match=said):
        world(SCHEMA, objects, facts)


def test_the_real_skills_of_these_tests_do_what_the_scripts_imitate():
    known = world(SCHEMA, "cup - item")
    run = rehearse(PLOTS, "fetch", {"item": "cup"}, components=[Arm(), Base()], knowledge=known)
    assert run.finished
    assert run.calls == ()
    assert entered(run, "held")
