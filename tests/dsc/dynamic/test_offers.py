"""Candidates that declare themselves by `offers`, and listed candidates that are not installed (S0.4)."""

from __future__ import annotations

import pytest
from dsc_charts import plot

from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.text.plot_files import plot_to_yaml
from dsc.validation.library import validate_plot
from dsc.validation.review import review_plot
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema

SCHEMA = Schema.parse("(define (domain flat) (:types place) (:predicates (near ?p - place)))")
HOLDER = """
plot: visit
parameters: {place: {type: place}}
states:
  go: {dynamic: %s, with: {place: ?place}, on: {done: ended, no_candidate: ended}}
  ended: {final: true}
"""
DRIVE = "{plot: drive, offers: approach, parameters: {place: place}, states: {s: {final: true}}}"
WALK = "{plot: walk, offers: [approach, move], when: (near ?place), parameters: {place: place}, states: {s: {final: true}}}"


def decide(dynamic: str, *plots: str):
    library = Library([plot(HOLDER % dynamic), *map(plot, plots)])
    situation = KnowledgeSituation(KnowledgeBase(SCHEMA), library)
    made = Machine(library).start("visit", {"place": "sink"}, situation).decisions[0].decision
    return made.chosen, {one.plot: one.reason for one in made.verdicts}


def findings(dynamic: str, *plots: str, level: str = "error") -> list[str]:
    library = Library([plot(HOLDER % dynamic), *map(plot, plots)])
    found = [one for each in library for one in validate_plot(each, library, SCHEMA)]
    return [str(one) for one in found if one.level == level]


def test_every_plot_that_offers_the_name_takes_part():
    assert decide("{offers: approach}", WALK, DRIVE)[0] == "drive"
    assert decide("{offers: move}", WALK, DRIVE) == (None, {"walk": "(near sink) is false"})
    assert decide("{offers: fly}", WALK, DRIVE) == (None, {})


def test_a_plot_that_arrives_later_takes_part():
    library = Library([plot(HOLDER % "{offers: approach}"), plot(WALK)])
    knowledge = KnowledgeBase(SCHEMA)

    def chosen():
        machine = Machine(library)
        return machine.start("visit", {"place": "sink"}, KnowledgeSituation(knowledge, library)).decisions[0].decision

    assert chosen().chosen is None
    library.add(plot(DRIVE))
    assert chosen().chosen == "drive"


@pytest.mark.parametrize(
    ("candidate", "said"),
    [
        ("{plot: jump, offers: approach, parameters: {how: {type: text}}, states: {s: }}", "needs its parameter 'how'"),
        (
            "{plot: jump, offers: approach, emits: {fell: }, states: {s: {final: true, emit: fell}}}",
            "does not handle its outcome 'fell' of plot 'jump'",
        ),
        (
            "{plot: jump, offers: approach, parameters: {place: {type: number}}, states: {s: {final: true}}}",
            "'place' is of type number",
        ),
    ],
)
def test_a_plot_that_does_not_conform_is_refused(candidate, said):
    found = findings("{offers: approach}", DRIVE, candidate)
    assert any(said in one for one in found), found


def test_offering_plots_are_checked_like_listed_ones():
    assert not findings("{offers: approach}", DRIVE, WALK)
    assert not findings("{offers: approach}")  # they may arrive later


def test_a_state_may_handle_outcomes_of_plots_that_arrive_later():
    holder = plot((HOLDER % "{offers: approach}").replace("on: {", "on: {lost: ended, "))
    assert not validate_plot(holder, Library([holder]), SCHEMA)


def test_a_missing_candidate_beside_an_installed_one_is_a_warning():
    assert decide("[fly, drive]", DRIVE) == ("drive", {"drive": "no condition", "fly": "not installed"})
    assert not findings("[fly, drive]", DRIVE)
    (warning,) = findings("[driv, drive]", DRIVE, level="warning")
    assert "there is no plot 'driv'; did you mean 'drive'?" in warning


def test_a_state_whose_candidates_are_all_missing_is_refused():
    assert any("there is no plot 'fly'" in one for one in findings("[fly]", DRIVE))


def test_the_written_form_is_read_again():
    holder = plot(HOLDER % "{offers: approach}")
    assert "dynamic: {offers: approach}" in plot_to_yaml(holder)
    assert plot(plot_to_yaml(holder)) == holder
    assert "offers: approach" in plot_to_yaml(plot(DRIVE))


def test_the_review_compares_offering_plots():
    walk = WALK.replace("(near ?place)", "(and (near ?place) (not (near ?place)))")
    library = Library([plot(HOLDER % "{offers: approach}"), plot(walk), plot(DRIVE)])
    assert any("walk" in str(one) for one in review_plot(library.plot("visit"), library))
