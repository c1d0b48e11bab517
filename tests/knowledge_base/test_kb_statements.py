"""What people say of a world: told and taken back, all of it or nothing."""

from __future__ import annotations

import pytest

from knowledge_base import Bounds, Delta, InputError, KnowledgeBase, OutOfBoundsError, Schema, UnknownNameError, fact
from knowledge_base.statements import retracted, told

SCHEMA = Schema.parse(
    """(define (domain kitchen) (:types cup surface - object) (:constants table - surface)
  (:predicates (on ?c - cup ?s - surface) (clean ?c - cup)) (:functions (weight ?c - cup) (breaks)))"""
)


@pytest.fixture
def kb() -> KnowledgeBase:
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(nodes={"mug": "cup"}, added=(fact("on", "mug", "table"),), values={fact("weight", "mug"): 2}), "me")
    return kb


def test_facts_numbers_and_things_are_told_in_any_order(kb) -> None:
    delta = told(["(on red table)", "(= (weight red) 0.5)", "(cup red)", "(increase (weight mug) 1)"], kb)
    assert delta == Delta(
        nodes={"red": "cup"},
        added=(fact("on", "red", "table"),),
        values={fact("weight", "red"): 0.5, fact("weight", "mug"): 3},
    )


def test_an_effect_for_all_things_counts_those_just_told(kb) -> None:
    delta = told(["(cup red)", "(forall (?c - cup) (clean ?c))"], kb)
    assert delta.added == (fact("clean", "mug"), fact("clean", "red"))


def test_an_effect_with_endless_instances_is_refused(kb) -> None:
    endless = "(forall (?a) " * 60 + "(increase (breaks) 1)" + ")" * 60
    with pytest.raises(OutOfBoundsError, match="visits more than 10000 facts and objects: FACT"):
        told(["(clean mug)", endless], kb, "FACT", Bounds(work=10_000))


def test_later_statements_build_on_earlier_ones(kb) -> None:
    assert told(["(increase (breaks) 1)", "(increase (breaks) 1)"], kb).values == {fact("breaks"): 2}
    assert told(["(forall (?c - cup) (not (on ?c table)))", "(on mug table)"], kb) == Delta()


def test_a_statement_and_its_negation_are_refused_with_both_places(kb) -> None:
    said = r"FACT 3:1:18: the change contradicts itself: \(clean mug\) is false here, and true at FACT 1:1:1"
    with pytest.raises(InputError, match=said):
        told(["(clean mug)", "(cup red)", "(and (clean red) (not (clean mug)))"], kb, "FACT")


def test_a_statement_that_holds_already_is_no_change(kb) -> None:
    assert not told(["(on mug table)", "(cup mug)", "(= (weight mug) 2)"], kb)


def test_a_fact_is_taken_back_and_a_thing_with_all_about_it(kb) -> None:
    assert retracted(["(on mug table)"], kb) == Delta(removed=(fact("on", "mug", "table"),))
    kb.apply(retracted(["(cup mug)"], kb), "me")
    assert (kb.objects("cup"), kb.facts(), kb.values()) == ([], [], {})


def test_a_thing_is_taken_back_by_any_of_its_types(kb) -> None:
    assert retracted(["(object mug)"], kb).removed_nodes == ("mug",)


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("(onn mug table)", "SAID 1:1:1: there is no predicate 'onn'; did you mean 'on'?"),
        ("(on mog table)", "SAID 1:1:5: there is no object 'mog' (text is written in quotes); did you mean 'mug'?"),
        ("(cupp red)", "SAID 1:1:1: there is no predicate 'cupp'; did you mean 'cup'?"),
        ("(surface mug)", "'mug' is of type 'cup' and cannot become 'surface'"),
        ("(cup 3)", "SAID 1:1:1: a type takes the name of a thing: (cup NAME)"),
        ("(= 3 4)", "SAID 1:1:1: '=' sets a number of a function: (= (FUNCTION ...) NUMBER)"),
        ("(= (wait mug) 4)", "SAID 1:1:4: there is no function 'wait'; did you mean 'weight'?"),
        ("(on mug)", "SAID 1:1:1: 'on' takes 2 arguments, as in (on ?c - cup ?s - surface); found 1"),
        ("(on ?x table)", "SAID 1:1:5: the variable '?x' is not bound"),
        ("(or (clean mug))", "SAID 1:1:1: 'or' is not an effect"),
        ("clean mug", "SAID 1:1:7: an effect is expected, and here a second begins"),
        ("", "SAID 1:1:1: the text is empty where an effect is expected"),
    ],
)
def test_an_invalid_statement_is_refused_with_a_reason(kb, statement: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        told([statement], kb, "SAID")
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("(clean mug)", "SAID 1:1:1: (clean mug) does not hold"),
        ("(on mug tabel)", "there is no object 'tabel' (text is written in quotes); did you mean 'table'?"),
        ("(surface mug)", "SAID 1:1:1: there is no surface 'mug'; valid: table"),
        ("(not (clean mug))", "SAID 1:1:1: a retraction names a fact or a thing"),
        ("(surface table)", "'table' is a constant of the domain and cannot be removed"),
        ("(clean ?x)", "the variable '?x' is not bound"),
    ],
)
def test_an_invalid_retraction_is_refused_with_a_reason(kb, statement: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        retracted([statement], kb, "SAID")
    assert message in str(caught.value)


def test_names_of_unknown_things_are_errors_even_where_another_is_told(kb) -> None:
    with pytest.raises(UnknownNameError, match=r"SAID 2:1:5: there is no object 'rad'.*did you mean 'red'"):
        told(["(cup red)", "(on rad table)"], kb, "SAID")
