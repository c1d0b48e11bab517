"""What certainly cannot hold together: never said of anything that does in some world."""

from __future__ import annotations

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from kb_strategies import NAMES, SCHEMA, THINGS, deltas, expressions
from kb_worlds import PROPERTY

from knowledge_base.errors import InputError
from knowledge_base.language.checking.contradiction import complete, contradictory, implied, subjects
from knowledge_base.language.evaluation.evaluator import holds
from knowledge_base.language.syntax import expression as ex
from knowledge_base.language.syntax.text import parse_condition as condition
from knowledge_base.world.overlay import Overlay
from knowledge_base.world.state import WorldState


@pytest.mark.parametrize(
    "together",
    [
        ["(p)", "(not (p))"],
        ["(on ?x a)", "(not (on ?x a))"],
        ["(< (f ?x) 4)", "(>= (f ?x) 4)"],
        ["(< (f ?x) 4)", "(< 5 (f ?x))"],
        ["(< (f ?x) 4)", "(= (f ?x) 4)"],
        ["(<= (f ?x) 4)", "(>= (f ?x) 4)", "(!= (f ?x) 4)"],
        ["(= ?x cup)", "(= ?x can)"],
        ["(= ?x true)", "(= ?x 1)"],
        ["(= ?x ?y)", "(!= ?y ?x)"],
        ["(< ?x ?y)", "(<= ?y ?x)"],
        ["(imply (p) (q))", "(p)", "(not (q))"],
        ["(or (and (p) (< ?n 2)) (q))", "(not (q))", "(> ?n 3)"],
        ["(forall (?i - item) (imply (seen ?i) (clean ?i)))", "(exists (?i - item) (and (seen ?i) (not (clean ?i))))"],
        ["(not (and))"],
    ],
)
def test_conditions_that_exclude_each_other_are_contradictory(together):
    assert contradictory(*map(condition, together))


@pytest.mark.parametrize(
    "together",
    [
        ["(p)", "(q)"],
        ["(on ?x a)", "(not (on ?x b))"],
        ["(< (f ?x) 4)", "(> (f ?x) 3)"],
        ["(<= (f ?x) 4)", "(>= (f ?x) 4)"],
        ["(< (f ?x) 4)", "(> (f ?y) 5)"],
        ["(!= ?x cup)", "(!= ?x can)"],
        ["(exists (?i - item) (seen ?i))", "(exists (?i - item) (not (seen ?i)))"],
        ["(and)"],
    ],
)
def test_compatible_conditions_are_not_contradictory(together):
    assert not contradictory(*map(condition, together))


@pytest.mark.parametrize(
    ("narrow", "wide"),
    [
        ("(and (p) (q))", "(p)"),
        ("(p)", "(or (q) (p))"),
        ("(= (f ?x) 0)", "(< (f ?x) 4)"),
        ("(> (f ?x) 4)", "(>= (f ?x) 4)"),
        ("(p)", "(and)"),
    ],
)
def test_a_narrow_condition_implies_a_wide_one_and_not_the_reverse(narrow, wide):
    assert implied(condition(wide), by=condition(narrow))
    assert not implied(condition(narrow), by=condition(wide))


def test_conditions_are_complete_only_if_one_of_them_always_holds():
    assert complete([condition("(< (f ?x) 4)"), condition("(>= (f ?x) 4)")])
    assert complete([condition("(p)"), condition("(not (p))")])
    assert complete([condition("(and (p) (q))"), condition("(not (p))"), condition("(not (q))")])
    assert not complete([condition("(< (f ?x) 4)"), condition("(> (f ?x) 4)")])
    assert not complete([])


def test_the_subjects_of_a_condition_are_its_atoms_and_compared_terms():
    about = subjects(condition("(or (< 3 (f ?x)) (not (and (p) (= ?y cup))))"))
    assert about == {"(f ?x)", "(p)", "?y"}


def test_with_too_many_cases_nothing_is_said():
    many = [ex.Or((ex.Atom(f"p{n}"), ex.Atom(f"q{n}"))) for n in range(30)]
    assert not contradictory(*many, condition("(r)"), condition("(not (r))"))


BINDINGS = st.fixed_dictionaries({name: st.sampled_from(sorted(THINGS)) for name in NAMES})


@PROPERTY
@given(expressions(), expressions(), deltas(), BINDINGS)
def test_contradictory_implied_and_complete_agree_with_evaluation(one, other, delta, bindings):
    world = Overlay(WorldState(SCHEMA))
    try:
        world.apply(delta)
        truths = [holds(each, world, bindings) for each in (one, other)]
    except InputError:
        assume(False)
    if all(truths):
        assert not contradictory(one, other)
    if truths == [True, False]:
        assert not implied(other, by=one)
    if not any(truths):
        assert not complete([one, other])
    assert contradictory(one, ex.Not(one))
