"""Text to values and back."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kb_strategies import any_effects, any_expressions, any_terms

from knowledge_base.errors import InputError, ParseError, Place
from knowledge_base.language.syntax.expression import (
    And,
    Atom,
    Comparison,
    Constant,
    Exists,
    TypedVariable,
    Variable,
    free_variables,
    substitute,
)
from knowledge_base.language.syntax.sexpr import MAX_DEPTH, Group, Word, read
from knowledge_base.language.syntax.text import parse_condition, parse_effect, parse_term, to_text


@given(any_expressions())
def test_conditions_survive_printing_and_reading(e) -> None:
    assert parse_condition(to_text(e)) == e


@given(any_effects())
def test_effects_survive_printing_and_reading(effect) -> None:
    assert parse_effect(to_text(effect)) == effect


@given(any_terms())
def test_terms_survive_printing_and_reading(term) -> None:
    assert parse_term(to_text(term)) == term


@given(st.text(max_size=40) | st.text(alphabet='()?;"\\ \nandorx-:1', max_size=40))
def test_any_text_is_read_or_refused_with_a_place(text: str) -> None:
    for parse in (parse_condition, parse_effect, parse_term):
        refusal = refusal_of(parse, text)
        assert refusal is None or refusal.place.line is not None


def refusal_of(parse, text: str) -> InputError | None:
    try:
        parse(text)
    except InputError as error:
        return error
    return None


def test_names_are_folded_and_quoted_text_is_kept() -> None:
    assert parse_condition('(ON ?Cup Table "Red Cup")') == Atom(
        "on", (Variable("cup"), Constant("table"), Constant("Red Cup", quoted=True))
    )


def test_a_name_that_cannot_stand_without_quotes_is_printed_with_them() -> None:
    e = substitute(parse_condition("(on ?x ?y)"), {"x": "Red Cup", "y": "1"})
    assert to_text(e) == '(on "Red Cup" "1")'
    assert parse_condition(to_text(e)) == e


def test_an_untyped_variable_does_not_take_the_type_of_the_next() -> None:
    e = Exists((TypedVariable("a"), TypedVariable("b", ("cup",))), And(()))
    assert to_text(e) == "(exists (?a - object ?b - cup) (and))"
    assert parse_condition(to_text(e)) == e


def test_places_are_lines_and_columns_from_one() -> None:
    e = parse_condition('; why\n (and (on ?x\n   "two\nlines") (p 1))', "file.pddl")
    assert isinstance(e, And)
    first, second = e.parts
    assert first.place == Place("file.pddl", 2, 7)
    assert second.place == Place("file.pddl", 4, 9)


def test_equality_ignores_places() -> None:
    assert parse_condition("(p ?x)") == parse_condition("\n  (p   ?x) ; the same")


def test_an_empty_group_is_true() -> None:
    assert parse_condition("()") == And(())


def test_numbers_and_truth_values() -> None:
    found = [parse_term(text) for text in ("3", "-0.5", "1e3", "true", "TRUE", "-", "a1")[:5]]
    assert found == [Constant(3), Constant(-0.5), Constant(1000.0), Constant(True), Constant(True)]


def test_deep_nesting_is_refused_not_overflowed() -> None:
    for depth in (MAX_DEPTH + 1, 100_000):
        with pytest.raises(ParseError, match="nested more than"):
            read("(" * depth + ")" * depth)


def test_the_deepest_nesting_is_read_printed_and_hashed() -> None:
    text = "(not " * (MAX_DEPTH - 1) + "(p)" + ")" * (MAX_DEPTH - 1)
    e = parse_condition(text)
    assert to_text(e) == text
    assert hash(e) == hash(parse_condition(text))
    assert free_variables(e) == frozenset()


def test_reading_gives_groups_and_words() -> None:
    assert read("(a b) c") == [
        Group((Word("a", Place(None, 1, 2)), Word("b", Place(None, 1, 4))), Place(None, 1, 1)),
        Word("c", Place(None, 1, 7)),
    ]


def test_quantified_variables_shadow_in_free_variables_and_substitution() -> None:
    e = parse_condition("(and (p ?x) (exists (?x - cup) (on ?x ?y)))")
    assert free_variables(e) == {"x", "y"}
    assert to_text(substitute(e, {"x": "cup1", "y": "table"})) == ("(and (p cup1) (exists (?x - cup) (on ?x table)))")


def test_event_attributes_are_variables() -> None:
    e = parse_condition("(= ?event.item cup1)")
    assert e == Comparison("=", Variable("event.item"), Constant("cup1"))
