"""Other names for variables: what is meant stays the same, whatever the quantifiers around them are called."""

import pytest

from knowledge_base.language.syntax.expression import Variable, free_variables, fresh, substitute
from knowledge_base.language.syntax.text import parse_condition, to_text


@pytest.mark.parametrize(
    ("before", "names", "after"),
    [
        ("(and (on ?x ?y) (not (clean ?x)))", {"x": "z"}, "(and (on ?z ?y) (not (clean ?z)))"),
        ("(imply (on ?x ?y) (or (clean ?y)))", {"y": "x"}, "(imply (on ?x ?x) (or (clean ?x)))"),
        ("(< (+ (weight ?x) 1) (weight ?y))", {"x": "z"}, "(< (+ (weight ?z) 1) (weight ?y))"),
        ("(exists (?x) (on ?x ?y))", {"x": "z"}, "(exists (?x) (on ?x ?y))"),
        ("(exists (?x) (on ?x ?y))", {"y": "x"}, "(exists (?x_2) (on ?x_2 ?x))"),
        (
            "(forall (?x - cup) (or (on ?x ?y) (on ?x_2 ?x)))",
            {"y": "x"},
            "(forall (?x_3 - cup) (or (on ?x_3 ?x) (on ?x_2 ?x_3)))",
        ),
        ("(exists (?x) (forall (?y) (on ?x ?z)))", {"z": "y"}, "(exists (?x) (forall (?y_2) (on ?x ?y)))"),
        ("(exists (?x ?y) (on ?x ?z))", {"z": "x", "q": "y"}, "(exists (?x_2 ?y) (on ?x_2 ?x))"),
    ],
)
def test_free_variables_are_renamed_and_no_quantifier_catches_them(before, names, after):
    result = substitute(parse_condition(before), {old: Variable(new) for old, new in names.items()})
    assert to_text(result) == after
    assert free_variables(result) == {names.get(name, name) for name in free_variables(parse_condition(before))}


def test_a_fresh_name_is_none_of_those_taken():
    assert fresh("x", {"x", "x_2", "x_3"}) == "x_4"
