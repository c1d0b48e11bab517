"""Domain and problem files as they are found."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_base import Fact, InputError, KnowledgeBase, Schema, SchemaError, fact
from knowledge_base.language.checking.check import check, check_effect, check_parameters
from knowledge_base.language.syntax.effect import AllOf, ForEach, NumericEffect, When
from knowledge_base.language.syntax.expression import And
from knowledge_base.language.syntax.text import parse_condition, parse_effect, to_text
from knowledge_base.pddl import read_domain, read_problem

CLEAN_UP = Path(__file__).parents[3] / "domains" / "clean_up_table" / "domain.pddl"

WILD = """
;; IPC style: upper case, missing sections, comments anywhere ;; (even (here
(DEFINE (DOMAIN Logistics-ADL) ; name
  (:REQUIREMENTS :ADL :Typing :action-costs)
  (:TYPES truck airplane - vehicle
          package vehicle - thing
          airport location - place
          city place thing - object)
  (:CONSTANTS Hub - airport)
  (:PREDICATES (AT ?x - (either thing package) ?l - place) (in-city ?l - place ?c - city)
               (in ?p - package ?v - vehicle)
               (= ?a ?b) (idle))
  (:FUNCTIONS (total-cost) - number
              (distance ?a ?b - place))
  (:action DRIVE
    :PARAMETERS (?t - truck ?from ?to - place ?c - city)
    :Precondition (and (at ?T ?from) (not (= ?from ?to)) (in-city ?from ?c) (in-city ?to ?c))
    :effect (and (at ?t ?to) (not (at ?t ?from)) (increase (total-cost) (distance ?from ?to))
                 (forall (?p - package) (when (in ?p ?t) (and (not (at ?p ?from)) (at ?p ?to))))))
  (:action noop :parameters () :precondition ())
)
"""
WILD_PROBLEM = """(define (problem Log-1) (:domain logistics-adl)
  (:requirements :adl)
  (:OBJECTS T1 - truck p1 P2 - PACKAGE depot - location ulm - city)
  (:INIT (AT t1 depot) (at P1 hub) (in-city depot ulm) (not (idle))
         (= (total-cost) 0) (= (distance depot hub) 12.5))
  (:goal (AND (forall (?p - package) (at ?p hub)) (< (total-cost) 100)))
  (:metric minimize (total-cost)))"""


def test_the_shipped_domain_is_read_and_consistent() -> None:
    domain = read_domain(CLEAN_UP)
    schema = Schema.from_pddl(CLEAN_UP)
    assert schema.is_a("crisp-can", "item")
    assert "lies-at" in schema.predicates
    assert [a.name for a in domain.actions][:2] == ["drive", "pick-up"]
    for action in domain.actions:
        variables = check_parameters(action.parameters, schema)
        check(action.precondition, schema, variables)
        check_effect(action.effect, schema, variables)
        assert parse_condition(to_text(action.precondition)) == action.precondition
        assert parse_effect(to_text(action.effect)) == action.effect


def test_a_domain_in_the_wild() -> None:
    domain = read_domain(WILD, "wild.pddl")
    assert (domain.name, domain.requirements) == ("logistics-adl", (":adl", ":typing", ":action-costs"))
    drive, noop = domain.actions
    assert (drive.name, [p.name for p in drive.parameters]) == ("drive", ["t", "from", "to", "c"])
    assert drive.place.line == 15
    assert isinstance(drive.effect, AllOf)
    *_, cost, everything = drive.effect.parts
    assert isinstance(cost, NumericEffect)
    assert isinstance(everything, ForEach)
    assert isinstance(everything.effect, When)
    assert (noop.parameters, noop.precondition, noop.effect) == ((), And(()), AllOf(()))


def test_a_function_without_arguments_may_change_without_parentheses() -> None:
    assert parse_effect("(increase Total-Cost 2)") == parse_effect("(increase (total-cost) 2)")


def test_a_schema_in_the_wild() -> None:
    schema = Schema.parse(WILD)
    assert schema.subtypes("thing") == ("truck", "airplane", "package", "vehicle", "thing")
    assert schema.ancestors("truck") == ("truck", "vehicle", "thing", "object")
    assert schema.constants == {"hub": "airport"}
    assert str(schema.predicates["at"]) == "(at ?x - thing or package ?l - place)"
    assert "=" not in schema.predicates
    assert schema.functions["total-cost"].arity == 0


def test_a_problem_in_the_wild() -> None:
    problem = read_problem(WILD_PROBLEM, Schema.parse(WILD))
    assert problem.domain == "logistics-adl"
    assert problem.objects["p2"] == "package"
    assert list(map(str, problem.init)) == ["(at t1 depot)", "(at p1 hub)", "(in-city depot ulm)"]
    assert problem.values == {Fact("total-cost"): 0, fact("distance", "depot", "hub"): 12.5}
    assert to_text(problem.goal).startswith("(and (forall (?p - package)")


def test_a_problem_fills_a_knowledge_base() -> None:
    schema = Schema.parse(WILD)
    kb = KnowledgeBase(schema)
    problem = read_problem(WILD_PROBLEM, schema)
    kb.apply(problem.delta(), author="problem")
    assert kb.query("(at ?x hub)") == [{"x": "p1"}]
    assert not kb.ask(problem.goal)


def test_the_smallest_files() -> None:
    schema = Schema.parse("(define (domain d))")
    assert dict(schema.types) == {"object": None}
    problem = read_problem("(define (problem p) (:domain d))", schema)
    assert (problem.objects, problem.init, problem.goal) == ({}, (), And(()))


def test_files_text_and_names_of_files_are_told_apart(tmp_path) -> None:
    path = tmp_path / "d (1).pddl"
    path.write_text(WILD, encoding="utf-8")
    assert read_domain(path).actions == read_domain(str(path)).actions == read_domain(WILD).actions
    with pytest.raises(InputError, match="no file"):
        read_domain("nowhere.pddl")


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_any_damage_to_a_file_is_read_or_refused_with_a_place(data) -> None:
    text = data.draw(st.sampled_from([WILD, WILD_PROBLEM]))
    start, length = data.draw(st.integers(0, len(text))), data.draw(st.integers(0, 12))
    instead = data.draw(st.sampled_from(["", "(", ")", " - ", "?x", ":init", '"', "()", "(either)", "and", "7"]))
    damaged = text[:start] + instead + text[start + length :]
    refusal = refusal_of(damaged if text is WILD else WILD, damaged if text is WILD_PROBLEM else WILD_PROBLEM)
    assert refusal is None or (refusal.place is not None and refusal.place.line is not None)


def refusal_of(domain: str, problem: str) -> InputError | None:
    try:
        read_problem("\n" + problem, Schema.parse(domain, "d"), "p")
    except InputError as error:
        return error
    return None


def test_merging_schemas() -> None:
    first = Schema.parse("(define (domain a) (:types cup - item item) (:predicates (on ?x - cup)))", "a")
    second = Schema.parse("(define (domain b) (:types item) (:predicates (on ?y - item)))", "b")
    third = Schema.parse("(define (domain c) (:types can - item item) (:functions (weight ?i - item)))", "c")
    both = first.merged(third)
    assert both.subtypes("item") == ("cup", "item", "can")
    assert set(both.functions) == {"weight"}
    with pytest.raises(SchemaError, match=r"b:1:\d+: the predicate 'on' .* \(at a:1:\d+\)"):
        first.merged(second)
    with pytest.raises(SchemaError, match="the type 'cup'"):
        first.merged(Schema(types={"cup": None}))


def test_types_of_values_are_no_types_of_things() -> None:
    schema = Schema.parse(WILD)
    assert schema.is_a("number", "number")
    assert not schema.is_a("number", "object")
    assert schema.fits("truck", ())
    assert not schema.fits("text", ())


CONTRADICTORY = Schema.parse("(define (domain d) (:types item) (:predicates (p ?i - item)) (:functions (f ?i - item)))")


@pytest.mark.parametrize(
    ("init", "said"),
    [
        ("(= (f x) 1)\n(= (f x) 3)", "2:1: ':init' contradicts itself: (f x) is 3 here, and 1 at"),
        ("(p x)\n(not (p x))", "2:1: ':init' contradicts itself: (p x) is false here, and true at"),
        ("(not (p x))\n(and (p x))", "(p x) is true here, and false at"),
    ],
)
def test_an_initial_state_that_contradicts_itself_is_refused(init: str, said: str) -> None:
    with pytest.raises(SchemaError) as refused:
        read_problem(
            f"(define (problem q) (:domain d) (:objects x - item) (:goal (p x)) (:init {init}))", CONTRADICTORY
        )
    assert said in str(refused.value)
    assert ":1:" in str(refused.value)


def test_an_initial_state_may_repeat_itself() -> None:
    text = (
        "(define (problem q) (:domain d) (:objects x - item) (:goal (p x)) (:init (p x) (p x) (= (f x) 1) (= (f x) 1)))"
    )
    assert read_problem(text, CONTRADICTORY).init == (fact("p", "x"),)
