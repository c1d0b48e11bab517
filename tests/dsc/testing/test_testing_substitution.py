"""A plot in another's place: whole branches replaced, and refused where a holder would notice."""

from __future__ import annotations

import pytest
from dsc_charts import plot
from fetching import FETCH, PICK, PLOTS, SCHEMA, Arm, Base

from dsc import Library, validate_library
from dsc.testing import ends_with, entered, rehearse, told, world
from knowledge_base import InputError, SchemaError, UnknownNameError

LIBRARY = Library(PLOTS)


def test_the_whole_branch_is_replaced_and_the_old_library_stays_as_it_is():
    stub = plot(
        "{plot: nothing, parameters: {item: item, force: {type: number, default: 1}}, states: {nap: {after: {seconds: 7, to: e}}, e: {final: true}}}"
    )
    made = LIBRARY.substitute("pick", stub)
    run = rehearse(
        made, "fetch", {"item": "cup"}, skills={"base.drive": "arrived"}, knowledge=world(SCHEMA, "cup - item")
    )
    assert run.finished
    assert entered(run, "take/nap")
    assert run.seconds == pytest.approx(8)
    assert [one.name for one in made] == [one.name for one in LIBRARY]
    assert made.plot("pick").states == stub.states
    assert LIBRARY.plot("pick") is PICK


def test_a_plot_that_is_not_there_cannot_be_replaced():
    with pytest.raises(UnknownNameError, match="no plot 'pikc'; did you mean 'pick'"):
        LIBRARY.substitute("pikc", PICK)


@pytest.mark.parametrize(
    ("interface", "said"),
    [
        ("", "lacks its parameter 'item'"),
        ("parameters: {itme: item},", "lacks its parameter 'item'; did you mean 'itme'?"),
        ("parameters: {item: place},", "takes 'item' as 'place', not as 'item'"),
        ("parameters: {item: item, force: {type: number, default: 1}, hand: symbol},", "needs the parameter 'hand', which holders need not give"),
        ("parameters: {item: item, force: number},", "needs the parameter 'force', which holders need not give"),
        ("parameters: {item: item, force: {type: number, default: 2}}, emits: {sliped: },", "emits 'sliped', which no holder has wired; did you mean 'slipped'?"),
        ("parameters: {item: item, force: {type: number, default: 2}}, emits: {slipped: },", "emits 'slipped' without its attribute 'item'"),
    ],
)  # fmt: skip
def test_a_stub_with_an_incompatible_interface_is_refused_with_its_place(interface, said):
    stub = plot("{plot: stub, " + interface + " states: {e: {final: true}}}", "stub.yaml")
    with pytest.raises(SchemaError) as refused:
        LIBRARY.substitute("pick", stub)
    assert "'stub' cannot replace 'pick': it " in str(refused.value)
    assert said in str(refused.value)
    assert str(refused.value).startswith("stub.yaml:1")


def test_a_parameter_of_its_own_with_a_default_and_fewer_outcomes_are_fine():
    stub = plot(
        "{plot: stub, parameters: {item: item, force: number, mood: {type: symbol, default: good}}, states: {e: {final: true}}}"
    )
    with pytest.raises(SchemaError, match="'force'"):
        LIBRARY.substitute("pick", stub)
    fine = stub.model_copy(update={"parameters": {**stub.parameters, "force": PICK.parameters["force"]}})
    assert (
        validate_library(
            LIBRARY.substitute("pick", fine), SCHEMA, [*Arm().skills().values(), *Base().skills().values()]
        )
        == []
    )


CANDIDATE = plot("{plot: a, implements: act, when: (open), effects: assumed, confirm: 9, states: {e: {final: true}}}")


def test_a_substitute_plays_the_part_of_the_original_unless_it_names_its_own():
    silent = plot("{plot: b, states: {f: {final: true}}}")
    made = Library([CANDIDATE]).substitute("a", silent).plot("a")
    assert (made.implements, made.effects, made.confirm, made.when) == ("act", "assumed", 9, CANDIDATE.when)
    outspoken = plot("{plot: b, effects: observed, states: {f: {final: true}}}")
    made = Library([CANDIDATE]).substitute("a", outspoken).plot("a")
    assert (made.implements, made.effects) == ("act", "observed")


# -- plots that just end -----------------------------------------------------------------------------------


def rehearsed(stub):
    facts = world(SCHEMA, "cup - item")
    return rehearse(
        LIBRARY.substitute("pick", stub), "fetch", {"item": "cup"}, skills={"base.drive": "arrived"}, knowledge=facts
    )


def test_a_plot_can_be_made_to_be_done_with_its_effects():
    run = rehearsed(ends_with(PICK, tell="(holding ?item)", after=3))
    assert [event.name for event in run.emitted] == ["fetched"]
    assert told(run, "(holding cup)")
    assert run.seconds == pytest.approx(4)


def test_a_plot_can_be_made_to_end_with_an_outcome():
    run = rehearsed(ends_with(PICK, "slipped", {"item": "?item"}))
    assert run.knowledge.ask("(and (lost cup) (= (failures cup) 2))")
    assert entered(run, "without")


def test_a_stand_in_keeps_what_the_library_knows_the_plot_for():
    made = ends_with(CANDIDATE)
    assert (made.implements, made.effects, made.confirm, made.when) == ("act", "assumed", 9, CANDIDATE.when)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("sliped",), "plot 'pick' does not end with 'sliped'; did you mean 'slipped'"),
        (("slipped", {"itm": "cup"}), "the outcome 'slipped' of 'pick' has no attribute 'itm'; did you mean 'item'"),
        (("slipped",), "the outcome 'slipped' of 'pick' needs its attribute 'item'"),
        (("done", {"item": "cup"}), "the outcome 'done' of 'pick' has no attribute 'item'"),
    ],
)
def test_an_end_that_the_original_does_not_have_is_refused(arguments, said):
    with pytest.raises(InputError, match=said):
        ends_with(PICK, *arguments)


def test_the_plots_of_these_tests_are_valid():
    signatures = [*Arm().skills().values(), *Base().skills().values()]
    assert [str(one) for one in validate_library(LIBRARY, SCHEMA, signatures, {"arm", "base"})] == []
    assert FETCH.rules
