"""Quantifiers whose variables are texts and numbers in facts."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_base import Delta, InputError, KnowledgeBase, Schema, fact

SCHEMA = Schema.parse("""
(define (domain talks) (:types person) (:constants anna bert - person)
  (:predicates (said ?who - person ?words - text) (rated ?words - text ?stars - number)))
""")
WORDS = ["yes", "no", "anna"]
FACTS = st.lists(
    st.one_of(
        st.builds(
            lambda who, words: fact("said", who, words), st.sampled_from(["anna", "bert"]), st.sampled_from(WORDS)
        ),
        st.builds(lambda words, stars: fact("rated", words, stars), st.sampled_from(WORDS), st.integers(0, 5)),
    ),
    max_size=12,
    unique=True,
)


def world(*facts) -> KnowledgeBase:
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(added=facts), author="test")
    return kb


@pytest.mark.parametrize(
    ("quantified", "query", "negated"),
    [
        ("(exists (?w) (said ?p ?w))", "(said ?p ?w)", False),
        ("(exists (?w ?n) (and (said ?p ?w) (rated ?w ?n) (> ?n 3)))", "(and (said ?p ?w) (rated ?w ?n) (> ?n 3))", False),
        ("(forall (?w) (not (said ?p ?w)))", "(said ?p ?w)", True),
        ("(forall (?w ?n) (imply (and (said ?p ?w) (rated ?w ?n)) (> ?n 3)))", "(and (said ?p ?w) (rated ?w ?n) (<= ?n 3))", True),
        ("(not (exists (?q - person ?w) (and (said ?q ?w) (said ?p ?w) (!= ?p ?q))))", "(and (said ?q ?w) (said ?p ?w) (!= ?p ?q))", True),
    ],
)  # fmt: skip
@settings(max_examples=60)
@given(facts=FACTS, later=FACTS)
def test_a_quantifier_and_the_query_of_its_condition(quantified, query, negated, facts, later):
    kb = world(*facts)
    installed = kb.install(quantified, {"p": "anna"})
    for change in (Delta(), Delta(added=tuple(later)), Delta(removed=tuple(facts))):
        kb.apply(change, author="test")
        wanted = bool(kb.query(query, {"p": "anna"})) != negated
        assert kb.ask(quantified, {"p": "anna"}) == wanted
        assert kb.explain(quantified, {"p": "anna"}).truth == wanted
        assert installed.truth == wanted


@pytest.mark.parametrize(
    "text",
    [
        "(exists (?w) (not (said anna ?w)))",
        "(forall (?w) (said anna ?w))",
        "(exists (?w) (or (said anna ?w) (person bert)))",
        "(exists (?n) (> ?n 3))",
    ],
)
def test_values_that_no_fact_lists(text):
    with pytest.raises(InputError, match=r"'\?w' is of type object|'\?n' is none"):
        world().ask(text)


def test_the_explanation_of_a_value_that_no_fact_has():
    assert str(world().explain("(exists (?w) (said anna ?w))").deciding) == (
        "(exists (?w) (said anna ?w)) is false: no row fulfils it"
    )
