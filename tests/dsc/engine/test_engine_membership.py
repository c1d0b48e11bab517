"""`(in-state NAME)` in every form of condition."""

import pytest

from dsc.engine.membership import FALSE, asked_states, settle
from knowledge_base.language.syntax.expression import TRUE
from knowledge_base.language.syntax.text import parse_condition

OPEN = parse_condition("(open door)")


@pytest.mark.parametrize(
    ("text", "settled"),
    [
        ("(in-state a)", "T"), ("(in-state b)", "F"), ("(open door)", "(open door)"),
        ("(not (in-state b))", "(not F)"), ("(and (in-state a) (open door))", "(and T (open door))"),
        ("(or (in-state b) (open door))", "(or F (open door))"), ("(imply (in-state a) (open door))", "(imply T (open door))"),
        ("(imply (open door) (in-state b))", "(imply (open door) F)"),
        ("(exists (?x) (and (in-state a) (open ?x)))", "(exists (?x) (and T (open ?x)))"),
        ("(forall (?x) (imply (open ?x) (in-state b)))", "(forall (?x) (imply (open ?x) F))"),
    ],
)  # fmt: skip
def test_conditions_on_active_states_are_settled_and_the_rest_is_kept(text, settled):
    expected = parse_condition(settled.replace("T", "(and)").replace("F", "(or)"))
    assert settle(parse_condition(text), {"a"}.__contains__) == expected


def test_the_truth_of_a_state_is_a_condition_of_its_own():
    assert settle(parse_condition("(in-state a)"), {"a"}.__contains__) == TRUE
    assert settle(parse_condition("(in-state a)"), set().__contains__) == FALSE
    assert settle(OPEN, {"a"}.__contains__) is OPEN


def test_the_states_that_are_asked_for():
    assert asked_states(parse_condition("(imply (in-state a) (or (open door) (not (in-state b))))")) == ["a", "b"]
    assert asked_states(parse_condition("(in-state a b)")) == []
