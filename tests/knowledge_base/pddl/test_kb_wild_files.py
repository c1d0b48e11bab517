"""PDDL as found in the wild: what is unusual but can be understood is understood, and noted where it may be a slip."""

from __future__ import annotations

import pytest

from knowledge_base import InputError, KnowledgeBase, Schema, fact
from knowledge_base.language.syntax.expression import TRUE
from knowledge_base.language.syntax.text import to_text
from knowledge_base.pddl import read_domain, read_problem

SMALL = Schema.parse(
    "(define (domain small) (:types cup can) (:predicates (full ?c - cup) (dry)) (:functions (f ?c) (g)))"
)


def domain(sections: str) -> Schema:
    return Schema.parse(f"(define (domain d) {sections})", "d")


def problem(sections: str, schema: Schema = SMALL, name: str = "small"):
    return read_problem(f"(define (problem p) {sections})", schema, "p", domain=name)


def test_a_type_glued_to_its_dash() -> None:
    schema = domain("(:types boat -object person -(either thing)) (:predicates (saved ?a ?b -person ?c -boat))")
    assert str(schema.predicates["saved"]) == "(saved ?a - person ?b - person ?c - boat)"


def test_a_mistake_in_a_glued_type_has_its_place() -> None:
    with pytest.raises(InputError, match=r"d:1:51: .*'bot'; did you mean 'boat'"):
        domain("(:types boat) (:predicates (at ?b -bot))")


def test_a_parent_that_nobody_declares_is_a_type() -> None:
    text = "(:types Port Plug - Enum Cable - Root)"
    assert domain(text).ancestors("plug") == ("plug", "enum", "object")
    remarks = list(read_domain(f"(define (domain d)\n {text})", "d").remarks())
    assert remarks == [
        "d:2:10: the type 'enum' is not declared and taken to be one of its own",
        "d:2:27: the type 'root' is not declared and taken to be one of its own",
    ]


def test_a_parent_whose_name_begins_like_another_is_no_typing_error() -> None:
    assert domain("(:types kiln8 - kiln cup - objects)").ancestors("kiln8") == ("kiln8", "kiln", "object")


def test_no_things_of_a_type() -> None:
    assert dict(problem("(:domain small) (:objects a - cup - can b - can)").objects) == {"a": "cup", "b": "can"}


def test_a_requirement_that_nobody_knows_is_a_note() -> None:
    read = read_domain("(define (domain d) (:requirements :typing :strip :fancy))", "d")
    assert read.requirements == (":typing", ":strip", ":fancy")
    assert read.notes == (
        "d:1:43: PDDL has no requirement ':strip'; did you mean ':strips'?",
        "d:1:50: PDDL has no requirement ':fancy'",
    )


TRUCKS = """(define (domain trucks) (:types truck van - car car)
  (:predicates (truck ?x) (red ?c - car)))"""


def test_a_predicate_with_the_name_of_a_type_is_a_predicate() -> None:
    """PDDL keeps types and predicates apart: being a truck by type does not make `(truck t1)` true."""
    schema = Schema.parse(TRUCKS)
    kb = KnowledgeBase(schema)
    kb.apply(read_problem(
        "(define (problem p) (:domain trucks) (:objects t1 t2 - truck v - van) (:init (truck t1) (truck v)))", schema
    ).delta(), author="test")  # fmt: skip
    assert kb.query("(truck ?x)") == [{"x": "t1"}, {"x": "v"}]
    assert kb.query("(and (object ?x) (exists (?t - truck) (= ?t ?x)))") == [{"x": "t1"}, {"x": "t2"}]
    assert kb.query("(van ?x)") == [{"x": "v"}]


def test_an_installed_condition_ranges_over_the_type_not_over_the_predicate_of_its_name() -> None:
    kb = KnowledgeBase(Schema.parse(TRUCKS))
    some = kb.install("(exists (?t - truck) (red ?t))")
    with kb.transaction(author="test") as world:
        world.add_node("v", "van")
        world.tell("truck", "v")
        world.tell("red", "v")
    assert not some.truth
    with kb.transaction(author="test") as world:
        world.add_node("t", "truck")
        world.tell("red", "t")
    assert some.truth


def test_such_a_predicate_is_noted() -> None:
    (remark,) = read_domain(TRUCKS, "d").remarks()
    assert remark.startswith("d:2:16: the predicate 'truck' has the name of a type (at d:1:33)")


def test_a_variable_glued_to_its_predicate() -> None:
    (action,) = read_domain("(define (domain d) (:action a :parameters(?x?y) :precondition (on?x?y)))").actions
    assert [p.name for p in action.parameters] == ["x", "y"]
    assert to_text(action.precondition) == "(on ?x ?y)"


def test_a_declaration_whose_variables_have_one_name() -> None:
    assert domain("(:types cup) (:predicates (in ?x ?x - cup))").predicates["in"].arity == 2


def test_a_type_declared_as_any_object_and_more_closely() -> None:
    assert domain("(:types area - object crate - area area - surface surface)").ancestors("crate") == (
        *("crate", "area", "surface", "object"),
    )


def test_a_type_said_again_as_a_fact() -> None:
    read = problem("(:domain small) (:objects a - cup) (:init (cup a) (full a) (object a))")
    assert read.init == (fact("full", "a"),)


def test_init_in_one_conjunction() -> None:
    read = problem("(:domain small) (:objects a b - cup) (:init (and (dry) (and (full a)) (= (g) 3) (not (full b))))")
    assert read.init == (fact("dry"), fact("full", "a"))
    assert read.values == {fact("g"): 3}


def test_a_problem_in_an_unusual_order() -> None:
    read = problem("(:goal (full a)) (:length (:serial 4)) (:init) (:objects a - cup b) (:domain SMALL)")
    assert (read.domain, dict(read.objects), read.has_goal) == ("small", {"a": "cup", "b": "object"}, True)


def test_empty_sections_and_parts() -> None:
    text = """(define (domain d) (:requirements) (:types) (:constants) (:predicates) (:functions)
      (:action a :parameters () :precondition () :effect ()) (:action b))"""
    a, b = read_domain(text).actions
    assert (a.precondition, a.effect) == (b.precondition, b.effect) == (TRUE, b.effect)
    read = problem("(:domain small) (:requirements) (:objects) (:init) (:goal ())")
    assert (read.objects, read.init, read.goal) == ({}, (), TRUE)


def test_windows_files(tmp_path) -> None:
    path = tmp_path / "domain.pddl"
    text = "; note\r\n(define (domain d) ; name\r\n (:types cup)\r\n (:predicates (full ?c - cpu)))\r\n"
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    with pytest.raises(InputError, match=r"domain.pddl:4:21: .*'cpu'"):
        Schema.from_pddl(path)
    path.write_bytes(b"\xef\xbb\xbf" + text.replace("cpu", "cup").encode())
    assert str(Schema.from_pddl(path).predicates["full"]) == "(full ?c - cup)"


def test_an_authors_name_in_another_encoding(tmp_path) -> None:
    path = tmp_path / "domain.pddl"
    path.write_bytes("; by Håkan Größe\n(define (domain d) (:types cup))".encode("latin-1"))
    assert Schema.from_pddl(path).subtypes("cup") == ("cup",)
    path.write_bytes("(define (domain d) (:types Größe))".encode("latin-1"))
    with pytest.raises(InputError, match=r"domain.pddl:1:28: this is not UTF-8"):
        Schema.from_pddl(path)


def test_a_problem_for_a_domain_of_another_name_that_fits() -> None:
    read = problem("(:domain tiny) (:objects a - cup) (:goal (full a))")
    assert read.notes == ("p:1:30: the problem is for the domain 'tiny', not for 'small', but fits it",)


def test_a_problem_for_another_domain() -> None:
    with pytest.raises(InputError, match=r"p:1:30: .* 'tiny', not for 'small', .*no predicate 'stacked'"):
        problem("(:domain tiny) (:objects a - cup) (:goal (stacked a))")
