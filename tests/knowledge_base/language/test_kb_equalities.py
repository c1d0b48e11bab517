"""Neighbouring equalities of one variable: one test with the verdict of the separate ones."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from knowledge_base import Schema
from knowledge_base.facts import Value
from knowledge_base.language.evaluation.compiler import compile_test
from knowledge_base.language.evaluation.terms import same
from knowledge_base.language.syntax.expression import And, Comparison, Constant, Not, Or, Variable
from knowledge_base.world.overlay import Overlay
from knowledge_base.world.state import WorldState

SCHEMA = Schema.parse("(define (domain d) (:predicates (p)))")
WORLD = Overlay(WorldState(SCHEMA))
GIVEN: tuple[Value, ...] = ("a", "b", 0, 1, 1.0, True, False, "1")
VALUES = st.sampled_from(GIVEN)
SIDES = st.sampled_from([*map(Variable, "xyz"), *map(Constant, GIVEN)])
EQUALITIES = st.builds(Comparison, st.sampled_from(["=", "!="]), SIDES, SIDES)


def verdict(e, bindings):
    left, right = (bindings[one.name] if isinstance(one, Variable) else one.value for one in (e.left, e.right))
    return same(left, right) is (e.operator == "=")


@given(st.lists(EQUALITIES, min_size=1, max_size=6), st.fixed_dictionaries(dict.fromkeys("xyz", VALUES)))
def test_a_disjunction_of_equalities_is_true_as_one_of_them(parts, bindings):
    alone = [verdict(one, bindings) for one in parts]
    assert compile_test(Or(tuple(parts)), SCHEMA)(WORLD, bindings) == any(alone)


@given(st.lists(EQUALITIES, min_size=1, max_size=6), st.fixed_dictionaries(dict.fromkeys("xyz", VALUES)))
def test_a_conjunction_of_differences_is_true_as_all_of_them(parts, bindings):
    alone = [not verdict(one, bindings) for one in parts]
    assert compile_test(And(tuple(map(Not, parts))), SCHEMA)(WORLD, bindings) == all(alone)
