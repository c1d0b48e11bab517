"""Questions about steps: each says yes to what happened and no to what is only nearly so."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from dsc_charts import plot
from fetching import PLOTS, SCHEMA

from dsc import testing
from dsc.testing import (
    Answer,
    DryRun,
    chose,
    configured,
    consumed,
    emitted,
    entered,
    exited,
    ignored,
    rehearse,
    started,
    switched,
    told,
    took,
    trail,
    world,
)
from knowledge_base import InputError, UnknownNameError

SLIPPED = Answer("slipped", {"item": "cup"})


@pytest.fixture(scope="module")
def run():
    known = world(SCHEMA, "cup - item", "(= (failures cup) 1)")
    skills: dict[str, Sequence[str | Answer]] = {
        "base.drive": ["no_path", "arrived"],
        "arm.grasp": [SLIPPED, "grasped"],
    }
    return rehearse(PLOTS, "fetch", {"item": "cup"}, skills=skills, knowledge=known, events=[(4, "hello")])


def test_states(run):
    assert entered(run, "go/driving")
    assert entered(run, "driving")
    assert not entered(run, "take/driving")
    assert exited(run, "take/grasp")
    assert not exited(run, "without")
    assert trail(run)[:3] == ("work", "go", "go/driving")
    assert trail(run)[-2:] == ("held", "ended")


def test_transitions(run):
    assert took(run, "grasp", "slipped", "dropped")
    assert took(run, "take/grasp", target="take/taken")
    assert took(run, trigger="after")
    assert not took(run, "grasp", "slipped", "taken")
    assert not took(run, "go", target="go/blocked")
    assert not took(run.steps, "rasp")  # part of a name is no name
    assert took(run, rule="no_path: wait, retry")
    assert took(run, "go", rule="no_path: wait, retry")
    assert not took(run, "take", rule="no_path: wait, retry")
    assert not took(run, rule="no_path: without")
    stays = plot("{plot: p, states: {a: {on: {n: {}, go: e}}, e: {final: true}}}")
    staying = DryRun([stays], "p")
    staying.send("n")
    assert took(staying, "a", "n")
    assert not took(staying, "a", "n", "a")


def test_events(run):
    assert consumed(run, "slipped", item="cup")
    assert not consumed(run, "slipped", item="can")
    assert not consumed(run, "slipped", itme="cup")
    assert ignored(run, "hello")
    assert not ignored(run, "slipped")
    assert not consumed(run.steps, "hello")
    assert emitted(run, "fetched", item="cup")
    assert not emitted(run, "fetched", item="can")
    assert not emitted(run, "slipped")  # an outcome of a plot further in


def test_actions(run):
    assert started(run, "arm.grasp", item="cup")
    assert not started(run, "arm.grasp", item="can")
    assert configured(run, "base.speed", 2)
    assert not configured(run, "base.speed", 3)
    assert switched(run, "base", "neutral")
    assert not switched(run, "base", "busy")


def test_knowledge(run):
    assert told(run, "(holding cup)")
    assert told(run, "(and (holding cup) (not (lost cup)) (assign (failures cup) 0))")
    assert told(run, "(assign (failures cup) 2)")
    assert not told(run, "(assign (failures cup) 1)")
    assert not told(run, "(lost cup)")
    assert not told(run, "(and (holding cup) (assign (failures cup) 2))")  # both, but not in one step


@pytest.mark.parametrize(
    "what", ["(holding ?i)", "(increase (failures cup) 1)", "(forall (?i - item) (lost ?i))", "(holding"]
)
def test_a_statement_that_is_not_a_fact_is_an_error_of_told(run, what):
    with pytest.raises(InputError):
        told(run, what)


@pytest.mark.parametrize(
    ("question", "said"),
    [
        (lambda run: entered(run, "drivng"), "no plot of this run has a state 'drivng'; did you mean 'driving'"),
        (lambda run: exited(run, "tak/grasp"), "no plot of this run has a state 'tak'; did you mean 'take'"),
        (lambda run: took(run, "takee"), "a state 'takee'; did you mean 'take'"),
        (lambda run: took(run, target="takn"), "a state 'takn'; did you mean 'taken'"),
        (lambda run: took(run, trigger="slip"), "a transition on 'slip'; did you mean 'slipped'"),
        (lambda run: took(run, rule="no_path: retry"), "a rule 'no_path: retry'; did you mean 'no_path: wait, retry'"),
        (lambda run: consumed(run, "arived"), "a transition on 'arived'; did you mean 'arrived'"),
        (lambda run: started(run, "arm.grap"), "a skill 'arm.grap'; did you mean 'arm.grasp'"),
        (lambda run: chose(run, "goo", None), "a state 'goo'; did you mean 'go'"),
    ],
)
def test_a_question_about_what_cannot_happen_is_an_error_and_not_a_no(run, question, said):
    with pytest.raises(UnknownNameError, match=said):
        question(run)
    assert not question(run.steps)  # bare steps do not know what else could have happened


def test_states_and_transitions_added_by_rules_can_be_queried(run):
    assert entered(run, "go_no_path_0_wait/pause")
    assert not took(run, "go_no_path_0_wait", target="without")


def test_events_that_match_by_prefix_are_not_known_beforehand():
    charted = plot("{plot: p, dialect: scxml, states: {a: {on: {go.*: e}}, e: {final: true}}}")
    going = DryRun([charted], "p")
    going.send("go.left")
    assert consumed(going, "go.left")
    assert not consumed(going, "go.right")


def test_one_step_several_and_a_run_can_be_asked(run):
    (first, *rest) = run.steps
    assert entered(first, "go")
    assert entered(iter(run.steps), "go")
    assert not entered(rest, "work")


CHOOSING = plot("""
    plot: choosing
    states:
      one: {dynamic: [never, always], on: {done: two, no_candidate: e}}
      two: {dynamic: [never], on: {done: three, no_candidate: three}}
      three: {goal: (near shelf), on: {done: e, no_plan: e, gave_up: e}}
      e: {final: true}
""")
NEVER = plot("{plot: never, when: (open), states: {e: {final: true}}}")
ALWAYS = plot("{plot: always, states: {e: {final: true}}}")


def test_choices():
    run = DryRun([CHOOSING, NEVER, ALWAYS], "choosing", knowledge=world(SCHEMA, facts="(near shelf)"))
    assert run.finished
    assert chose(run, "one", "always")
    assert not chose(run, "one", "never")
    assert chose(run, "two", None)
    assert not chose(run, "one", None)
    assert not chose(run, "three", None)  # its goal held already; it had nothing to choose


def test_every_public_name_is_there():
    assert all(callable(getattr(testing, name)) for name in vars(testing)["__all__"])
