"""Derived predicates in the knowledge base: they are read by their definitions everywhere, and nobody asserts them."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_base import Delta, Fact, KnowledgeBase, Schema, SchemaError, fact
from knowledge_base.exchange import schema_form, schema_of

DOMAIN = """(define (domain lab)
  (:types tube place)
  (:predicates (at ?t - tube ?p - place) (door ?a ?b - place)
               (vacant ?p - place) (near ?a ?b - place) (stuck) (linked ?a ?b - place))
  (:derived (vacant ?p - place) (not (exists (?t - tube) (at ?t ?p))))
  (:derived (near ?a ?b - place) (door ?a ?b))
  (:derived (near ?a ?b - place) (door ?b ?a))
  (:derived (stuck) (forall (?p - place) (not (vacant ?p))))
  (:derived (linked ?a ?b - place) (or (near ?a ?b) (exists (?c - place) (and (near ?a ?c) (linked ?c ?b))))))
"""
SCHEMA = Schema.parse(DOMAIN, "lab.pddl")
PLACES, TUBES = ("rack", "spin", "camera"), ("t1", "t2")
FACTS = [fact("at", t, p) for t in TUBES for p in PLACES] + [fact("door", a, b) for a in PLACES for b in PLACES]
DEFINED = {
    "(vacant camera)": "(not (exists (?t - tube) (at ?t camera)))",
    "(near rack spin)": "(or (door rack spin) (door spin rack))",
    "(stuck)": "(forall (?p - place) (exists (?t - tube) (at ?t ?p)))",
    "(exists (?p - place) (and (vacant ?p) (near rack ?p)))":
        "(exists (?p - place) (and (not (exists (?t - tube) (at ?t ?p))) (or (door rack ?p) (door ?p rack))))",
    "(imply (stuck) (vacant rack))": "(or (not (exists (?t - tube) (at ?t rack)))"
        " (exists (?p - place) (not (exists (?t - tube) (at ?t ?p)))))",
}  # fmt: skip


def world(*facts, schema=SCHEMA):
    kb = KnowledgeBase(schema)
    kb.apply(Delta(nodes={**dict.fromkeys(PLACES, "place"), **dict.fromkeys(TUBES, "tube")}, added=facts), "test")
    return kb


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.lists(st.sets(st.sampled_from(FACTS)), min_size=1, max_size=4))
def test_a_derived_predicate_is_its_definition_at_every_version(versions) -> None:
    kb = world()
    installed = {text: kb.install(text) for text in DEFINED}
    known: set[Fact] = set()
    for facts in versions:
        kb.apply(Delta(removed=tuple(known - facts), added=tuple(facts - known)), "test")
        known = facts
        for text, definition in DEFINED.items():
            truth = kb.ask(definition)
            assert (kb.ask(text), kb.explain(text).truth, installed[text].truth) == (truth, truth, truth), text
        vacant = [place for place in PLACES if kb.ask("(vacant ?p)", {"p": place})]
        assert sorted(one["p"] for one in kb.query("(vacant ?p)")) == sorted(vacant)


def test_an_explanation_leads_through_the_definition_to_the_fact() -> None:
    why = world(fact("at", "t1", "rack")).explain("(vacant rack)")
    assert (why.text, str(why.deciding)) == ("(vacant rack)", "(at t1 rack) is true")


def test_nobody_asserts_or_watches_a_derived_predicate() -> None:
    kb = world()
    expected = r"'vacant' is derived \(at lab.pddl:5:\d+\); change the facts from which it follows"
    with pytest.raises(SchemaError, match=expected):
        kb.apply(Delta(added=(fact("vacant", "rack"),)), "test")
    with pytest.raises(SchemaError, match=expected):
        kb.watch("(vacant ?p)")


def test_a_recursive_predicate_is_refused_also_behind_a_definition() -> None:
    kb = world()
    for ask in (kb.ask, kb.query, kb.explain, kb.install):
        with pytest.raises(SchemaError, match="'linked' is a recursive derived predicate"):
            ask("(linked rack spin)")


def test_a_predicate_that_follows_from_its_own_negation_is_refused() -> None:
    with pytest.raises(SchemaError, match="'p' follows from its own negation, through 'q'"):
        Schema.parse("(define (domain d) (:predicates (p) (q)) (:derived (p) (not (q))) (:derived (q) (p)))")


def test_a_store_keeps_the_definitions(tmp_path) -> None:
    with KnowledgeBase.open(SCHEMA, tmp_path / "lab.kb") as kb:
        kb.apply(Delta(nodes={"rack": "place"}), "test")
    with KnowledgeBase.open(None, tmp_path / "lab.kb") as kb:
        assert kb.query("(vacant ?p)") == [{"p": "rack"}]
    assert schema_of(schema_form(SCHEMA)).axioms == SCHEMA.axioms
