from __future__ import annotations

import pytest

from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import fact
from knowledge_base.language.syntax.text import to_text
from planning.model.domain import PlanningDomain
from planning.model.plan import PlanStep

ACTION = """(define (domain d)
  (:types item place - object  cup - item) (:constants home - place)
  (:predicates (at ?i - item ?p - place) (held ?i - item))
  (:functions (weight ?i - item))
  (:action take
    :parameters (PARAMETERS)
    :precondition PRECONDITION
    :effect EFFECT))
"""


def parsed(parameters="?i - item ?p - place", precondition="(at ?i ?p)", effect="(held ?i)"):
    text = ACTION.replace("PARAMETERS", parameters).replace("PRECONDITION", precondition)
    return PlanningDomain.parse(text.replace("EFFECT", effect), "d.pddl")


def test_the_domain_has_its_actions_in_order(clean_up):
    assert list(clean_up.actions)[:3] == ["drive", "pick-up", "put-down"]
    assert [p.types for p in clean_up.actions["pick-up"].parameters] == [("item",), ("surface",)]


@pytest.mark.parametrize(
    ("wrong", "line", "found"),
    [
        ({"precondition": "(att ?i ?p)"}, 7, "at"),
        ({"precondition": "(at ?i)"}, 7, "takes 2 arguments"),
        ({"precondition": "(at ?p ?i)"}, 7, "is of type place"),
        ({"precondition": "(at ?j ?p)"}, 7, "?i"),
        ({"precondition": "(at ?i ?p"}, None, ""),
        ({"precondition": "(< (wait ?i) 3)"}, 7, "weight"),
        ({"parameters": "?i - itme ?p - place"}, 6, "item"),
        ({"parameters": "?i ?i - item ?p - place"}, 6, "twice"),
        ({"parameters": "?i - item ?p - number"}, 6, "number"),
        ({"precondition": "(at ?i hoem)"}, 7, "'home'"),
        ({"effect": "(at ?i hoem)"}, 8, "'home'"),
        ({"effect": "(hold ?i)"}, 8, "held"),
        ({"effect": "(cup ?i)"}, 8, "type"),
        ({"effect": "(or (held ?i))"}, 8, "or"),
        ({"effect": "(increase (weigth ?i) 1)"}, 8, "weight"),
        ({"effect": "(when (helt ?i) (held ?i))"}, 8, "held"),
        ({"effect": "(forall (?c - cop) (held ?c))"}, 8, "cup"),
    ],
)
def test_a_mistake_in_an_action_is_named_with_its_line(wrong, line, found):
    with pytest.raises(InputError) as caught:
        parsed(**wrong)
    assert found in str(caught.value)
    assert caught.value.place.source == "d.pddl"
    assert line is None or caught.value.place.line == line


def test_a_missing_file_is_an_input_error(domain_file):
    with pytest.raises(InputError, match=r"domain\.pddl"):
        PlanningDomain.from_pddl(domain_file.with_name("domian.pddl"))


def test_a_step_is_applicable_when_its_precondition_holds(clean_up, table):
    world = table(cups=1, robot_at="table")
    assert clean_up.applicable(PlanStep("pick-up", ("cup1", "table")), world)
    assert not clean_up.applicable(PlanStep("pick-up", ("cup1", "shelf")), world)
    assert not clean_up.applicable(PlanStep("throw-away", ("cup1", "sink")), world)


def test_arguments_of_a_wrong_type_are_not_applicable(clean_up, table):
    world = table(cups=1, robot_at="sink")
    step = PlanStep("pick-up", ("cup1", "sink"))
    assert not clean_up.applicable(step, world)
    assert clean_up.why_not(step, world).deciding.text == "(surface sink)"


def test_effects_are_those_of_the_file(clean_up, table):
    delta = clean_up.effects(PlanStep("pick-up", ("cup1", "table")), table(cups=1))
    assert set(delta.removed) == {fact("hand-free"), fact("lies-at", "cup1", "table")}
    assert delta.added == (fact("holding", "cup1"),)


def test_the_grounded_precondition_says_what_is_missing(clean_up, table):
    step = PlanStep("pick-up", ("cup1", "table"))
    assert "(lies-at cup1 table)" in to_text(clean_up.precondition(step))
    why_not = clean_up.why_not(step, table(cups=1))
    assert not why_not.truth
    assert why_not.deciding.text == "(robot-at table)"


def test_an_unknown_action_names_the_nearest(clean_up, table):
    with pytest.raises(UnknownNameError, match="'pick-up'"):
        clean_up.applicable(PlanStep("pickup", ("cup1", "table")), table(cups=1))


def test_a_wrong_number_of_arguments_is_told(clean_up, table):
    with pytest.raises(InputError, match="takes 2 arguments"):
        clean_up.effects(PlanStep("pick-up", ("cup1",)), table(cups=1))


def test_a_type_whose_name_a_predicate_has_is_still_asked_of_arguments(world_of):
    domain = PlanningDomain.parse("""(define (domain d) (:types truck van) (:predicates (truck ?x) (red ?x))
      (:action paint :parameters (?t - truck) :effect (red ?t)))""")
    world = world_of(domain.schema, {"t": "truck", "v": "van"}, [fact("truck", "v")])
    paint_t, paint_v = PlanStep("paint", ("t",)), PlanStep("paint", ("v",))
    assert (domain.applicable(paint_t, world), domain.applicable(paint_v, world)) == (True, False)
    assert (domain.why_not(paint_t, world).truth, domain.why_not(paint_v, world).truth) == (True, False)
