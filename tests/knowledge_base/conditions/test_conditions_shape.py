"""Shapes: conditions that differ only in values and in the names of variables share their work."""

from __future__ import annotations

import pytest
from kb_strategies import SCHEMA

from knowledge_base import Delta, KnowledgeBase, fact
from knowledge_base.conditions.shape import lifted
from knowledge_base.language.syntax.text import parse_condition


def shape(text: str):
    return lifted(parse_condition(text), {}, SCHEMA).shape


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("(on ?x table)", "(on ?y shelf)"),
        ("(exists (?c - cup) (on ?c table))", "(exists (?d - cup) (on ?d table))"),
        ("(not (exists (?c) (on ?c table)))", "(not (exists (?d) (on ?d table)))"),
        ("(forall (?a) (imply (cup ?a) (on ?a ?p)))", "(forall (?p) (imply (cup ?p) (on ?p ?a)))"),
        ("(not (exists (?a) (forall (?b) (on ?a ?b))))", "(not (exists (?b) (forall (?a) (on ?b ?a))))"),
        ("(> (weight ?x) 2)", "(> (weight ?y) 3.5)"),
    ],
)
def test_names_and_values_make_no_difference(one, other) -> None:
    assert shape(one) == shape(other)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("(on ?x ?y)", "(on ?x ?x)"),
        ("(on ?x ?y)", "(on ?x table)"),
        ("(and (on ?x a) (on ?x b))", "(and (on ?x a) (on ?y b))"),
        ("(on a a)", "(on a b)"),
        ("(not (exists (?a) (forall (?b) (on ?a ?b))))", "(not (exists (?a) (forall (?b) (on ?b ?a))))"),
        ("(not (exists (?a) (forall (?a) (on ?a ?a))))", "(not (exists (?a) (forall (?b) (on ?a ?b))))"),
    ],
)
def test_which_variables_are_the_same_does(one, other) -> None:
    assert shape(one) != shape(other)


def test_each_condition_keeps_its_own_names_for_the_witness() -> None:
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(nodes={"cup1": "cup", "table": "place"}, added=(fact("on", "cup1", "table"),)), author="test")
    assert kb.install("(on ?x ?place)").witness == {"x": "cup1", "place": "table"}
    assert kb.install("(on ?place ?x)").witness == {"place": "cup1", "x": "table"}
