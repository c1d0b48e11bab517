"""What programs hand to a knowledge base and should not: one line of error, and nothing changed."""

from __future__ import annotations

import pytest
from kb_strategies import SCHEMA, THINGS
from kb_worlds import Ticks, everything

from knowledge_base import Delta, InputError, KnowledgeBase, SchemaError, UnknownNameError, fact

QUESTIONS = ["ask", "query", "explain", "explain_query", "install", "watch"]


@pytest.fixture
def kb() -> KnowledgeBase:
    kb = KnowledgeBase(SCHEMA, Ticks())
    kb.apply(Delta(nodes=THINGS, added=(fact("heavy", "cup1"),)), author="test")
    return kb


def one_line(error: pytest.ExceptionInfo) -> str:
    said = str(error.value)
    assert said.isprintable()
    return said


# --- parameters


@pytest.mark.parametrize("question", QUESTIONS)
def test_a_parameter_that_the_question_does_not_have_is_named_with_the_nearest(kb, question):
    with pytest.raises(UnknownNameError, match="did you mean '[?]item'"):
        getattr(kb, question)("(heavy ?item)", {"item": "cup1", "itm": "cup1"})
    with kb.transaction(author="test") as tx, pytest.raises(UnknownNameError, match="did you mean '[?]item'"):
        tx.query("(heavy ?item)", {"itm": "cup1"})


@pytest.mark.parametrize("text", ["(heavy ?Item)", "(heavy ?item)"])
@pytest.mark.parametrize("name", ["Item", "item", "ITEM"])
def test_parameters_are_found_however_they_are_written(kb, text, name):
    for _ in range(2):
        assert [kb.ask(text, {name: one}) for one in ("cup1", "cup2")] == [True, False]
        assert kb.query(text, {name: "cup1"}) == [{}]
        assert str(kb.explain(text, {name: "cup2"})) == "(heavy cup2) is false"
        assert "heavy" in str(kb.explain_query(text, {name: "cup2"}))
        assert kb.install(text, {name: "cup1"}).truth
    with kb.transaction(author="test") as tx:
        assert tx.ask(text, {name: "cup1"}) and not tx.ask(text, {name: "cup2"})


def test_a_variable_of_a_quantifier_is_no_parameter(kb):
    with pytest.raises(UnknownNameError, match="no free variable '[?]i'"):
        kb.ask("(exists (?i - item) (heavy ?i))", {"i": "cup2"})


def test_a_variable_is_given_one_value(kb):
    with pytest.raises(InputError, match="'[?]item' is given two values"):
        kb.ask("(heavy ?item)", {"item": "cup1", "Item": "cup2"})


@pytest.mark.parametrize("question", QUESTIONS)
@pytest.mark.parametrize("params", [5, "item", ["item"], {"item": None}, {"item": ["cup1"]}, {5: "cup1"}])
def test_parameters_are_a_mapping_of_names_to_values(kb, question, params):
    before = everything(kb)
    with pytest.raises(InputError) as error:
        getattr(kb, question)("(heavy ?item)", params)
    assert "mapping" in one_line(error) or "name" in one_line(error)
    assert everything(kb) == before


@pytest.mark.parametrize("question", QUESTIONS)
def test_a_geometry_is_no_parameter(kb, question):
    with pytest.raises(SchemaError, match="'[?]item' cannot be a geometry"):
        getattr(kb, question)("(heavy ?item)", {"item": (1.0, 2.0)})


# --- conditions


@pytest.mark.parametrize("question", QUESTIONS)
@pytest.mark.parametrize("text", [5, True, b"(heavy cup1)", ["(heavy cup1)"], object, fact("heavy", "cup1")])
@pytest.mark.parametrize("params", [None, {"item": "cup1"}])
def test_a_condition_is_text(kb, question, text, params):
    with pytest.raises(InputError, match="a condition is text such as") as error:
        getattr(kb, question)(text, params)
    one_line(error)


def test_who_asks_a_fact_is_told_to_write_it_as_text(kb):
    with pytest.raises(InputError, match=r"write it as text: \(heavy cup1\)"):
        kb.ask(fact("heavy", "cup1"))
