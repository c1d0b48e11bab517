"""What conditions, queries and effects mean on a world."""

from __future__ import annotations

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from kb_strategies import NAMES, SCHEMA, THINGS, brute, brute_choices, deltas, expressions

from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.facts import Delta, Fact, fact
from knowledge_base.language.checking.binding import only_tested
from knowledge_base.language.evaluation.evaluator import apply_effect, evaluate_term, holds, query
from knowledge_base.language.evaluation.explanation import explain
from knowledge_base.language.evaluation.world_protocol import WorldDefaults
from knowledge_base.language.syntax.expression import TypedVariable, free_variables
from knowledge_base.language.syntax.text import parse_condition, parse_effect, parse_term
from knowledge_base.world.overlay import Overlay
from knowledge_base.world.state import WorldState


def world_of(delta: Delta) -> Overlay:
    world = Overlay(WorldState(SCHEMA))
    world.apply(delta)
    return world


@pytest.fixture
def world() -> Overlay:
    facts = [("on", "cup1", "shelf"), ("on", "can1", "shelf"), ("on", "cup2", "home"), ("heavy", "can1")]
    return world_of(
        Delta(
            nodes=THINGS,
            added=tuple(fact(*f) for f in facts),
            values={fact("weight", "cup1"): 2, fact("weight", "can1"): 5},
        )
    )


bindings = st.fixed_dictionaries({name: st.sampled_from(sorted(THINGS)) for name in NAMES})


@settings(max_examples=300)
@given(expressions(), deltas(), bindings)
def test_truth_is_the_textbooks(e, delta, b) -> None:
    world = world_of(delta)
    assert holds(e, world, b) == brute(e, world, b)


@settings(max_examples=300)
@given(expressions(), deltas(), bindings, st.sets(st.sampled_from(NAMES)))
def test_answers_are_all_choices_that_make_it_true_each_once(e, delta, b, bound) -> None:
    world = world_of(delta)
    params = {name: b[name] for name in bound}
    assume(not only_tested(e, SCHEMA, frozenset(bound)))
    asked = sorted(free_variables(e) - bound)
    answers = query(e, world, params)
    choices = brute_choices([TypedVariable(name) for name in asked], world)
    expected = [c for c in choices if brute(e, world, {**params, **c})]
    assert len(answers) == len(expected)
    assert all(choice in answers for choice in expected)
    assert answers == query(e, world, params)


def test_free_variables_are_the_answers(world) -> None:
    e = parse_condition("(and (on ?thing ?place) (cup ?thing))")
    assert query(e, world) == [{"thing": "cup1", "place": "shelf"}, {"thing": "cup2", "place": "home"}]
    assert query(e, world, {"place": "home"}) == [{"thing": "cup2"}]


def test_a_closed_query_has_one_empty_answer_or_none(world) -> None:
    assert query(parse_condition("(on cup1 shelf)"), world) == [{}]
    assert query(parse_condition("(on cup1 home)"), world) == []


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("(and)", True),
        ("(or)", False),
        ("(cup cup1)", True),
        ("(item cup1)", True),
        ("(cup can1)", False),
        ("(place home)", True),
        ("(= cup1 cup1)", True),
        ("(!= cup1 cup2)", True),
        ("(= (weight cup1) 2)", True),
        ("(= (weight cup2) 0)", True),
        ("(= 1 1.0)", True),
        ("(= true 1)", False),
        ("(> (+ (weight cup1) 1) (/ (weight can1) 2))", True),
        ("(< (- (weight cup1)) 0)", True),
        ("(forall (?i - cup) (not (heavy ?i)))", True),
        ("(forall (?i - item) (imply (on ?i shelf) (> (weight ?i) 1)))", True),
        ("(exists (?i - (either cup can)) (> (weight ?i) 4))", True),
        ("(exists (?i ?j - cup) (and (!= ?i ?j) (on ?i shelf) (on ?j home)))", True),
        ("(exists () (on cup1 shelf))", True),
        ("(forall (?p - place) (exists (?i - item) (on ?i ?p)))", True),
    ],
)
def test_meaning(world, text: str, expected: bool) -> None:
    assert holds(parse_condition(text), world) is expected


def test_a_repeated_variable_must_agree(world) -> None:
    world.apply(Delta(added=(fact("near", "home", "shelf"), fact("near", "home", "home"))))
    assert query(parse_condition("(near ?x ?x)"), world) == [{"x": "home"}]


def test_numbers_as_arguments_are_answers_too(world) -> None:
    world.apply(Delta(added=(fact("level", "cup1", 3), fact("level", "cup2", 1))))
    assert query(parse_condition("(and (level ?i ?n) (> ?n 2))"), world) == [{"i": "cup1", "n": 3}]


def test_a_long_conjunction_does_not_recurse(world) -> None:
    parts = " ".join(f"(on ?x{i} shelf) (= ?x{i} cup1)" for i in range(300))
    assert len(query(parse_condition(f"(and {parts})"), world)) == 1


@pytest.mark.parametrize(
    "text",
    [
        "(not (on ?x home))",
        "(< (weight ?x) 3)",
        "(or (heavy ?x) (quiet))",
        "(forall (?p - place) (on ?x ?p))",
    ],
)
def test_a_variable_that_is_only_tested_is_an_error_that_names_it(world, text: str) -> None:
    with pytest.raises(InputError, match=r"'\?x'") as caught:
        query(parse_condition(text), world)
    assert caught.value.place is not None


class Counting:
    """A world that counts the facts it is asked for."""

    def __init__(self, world: WorldState) -> None:
        self.world = world
        self.looked_at = 0

    def __getattr__(self, name: str):
        return getattr(self.world, name)

    def match(self, predicate, pattern):
        for args in self.world.match(predicate, pattern):
            self.looked_at += 1
            yield args


class Uncounted(Counting):
    def estimate(self, predicate: str, pattern: object) -> int:
        return WorldDefaults().estimate(predicate, ())


def test_a_conjunction_begins_with_the_rarest_and_does_without_counts_too() -> None:
    state = WorldState(SCHEMA)
    cups = [f"cup{i}" for i in range(500)]
    told = (*(fact("on", cup, "home") for cup in cups), fact("heavy", "cup7"))
    state.commit(Delta(nodes=dict.fromkeys(cups, "cup"), added=told))
    e = parse_condition("(and (on ?i home) (heavy ?i))")
    world = Counting(state)
    assert query(e, world) == query(e, Uncounted(state)) == [{"i": "cup7"}]
    assert world.looked_at == 1


def test_a_free_variable_of_a_condition_is_an_error_that_says_what_to_do(world) -> None:
    with pytest.raises(UnknownNameError, match=r"'\?tabel'.*exists.*did you mean '\?table'") as caught:
        holds(parse_condition("(on cup1 ?tabel)"), world, {"table": "shelf"})
    assert caught.value.place.column == 10


@pytest.mark.parametrize("text", ["(/ 1 (weight cup2))", "(/ 1 0)"])
def test_a_division_by_zero_is_an_input_error(world, text: str) -> None:
    with pytest.raises(InputError, match="division by zero"):
        evaluate_term(parse_term(text), world)


def test_ordering_names_is_an_error(world) -> None:
    with pytest.raises(SchemaError, match="numbers, not on 'cup1'"):
        holds(parse_condition("(< ?x 3)"), world, {"x": "cup1"})


def test_an_effect_sees_the_world_before(world) -> None:
    effect = parse_effect(
        """(and (not (on cup1 shelf)) (on cup1 home)
                (when (on cup1 shelf) (increase (weight cup1) (weight can1)))
                (when (on cup1 home) (quiet))
                (forall (?i - cup) (heavy ?i)))"""
    )
    assert apply_effect(effect, world) == Delta(
        removed=(fact("on", "cup1", "shelf"),),
        added=(fact("on", "cup1", "home"), fact("heavy", "cup1"), fact("heavy", "cup2")),
        values={fact("weight", "cup1"): 7},
    )
    assert world.holds("on", ("cup1", "shelf"))


def test_a_fact_deleted_and_added_is_added(world) -> None:
    delta = apply_effect(parse_effect("(and (quiet) (not (quiet)))"), world)
    assert delta == Delta(added=(Fact("quiet"),))


def test_variables_that_an_effect_does_not_mention_make_no_further_instances(world) -> None:
    nested = "(forall (?x) " * 60 + "(heavy cup1)" + ")" * 60
    assert apply_effect(parse_effect(nested), world) == Delta(added=(fact("heavy", "cup1"),))
    many = " ".join(f"?x{number}" for number in range(60))
    assert apply_effect(parse_effect(f"(forall ({many} ?i - can) (heavy ?i))"), world).added == (fact("heavy", "can1"),)


def test_a_variable_without_an_object_leaves_an_effect_without_instances() -> None:
    nothing = world_of(Delta(nodes={"shelf": "place"}))
    assert apply_effect(parse_effect("(forall (?i - item) (quiet))"), nothing) == Delta()
    assert apply_effect(parse_effect("(forall (?p - place) (quiet))"), nothing).added == (Fact("quiet"),)


def test_a_number_grows_by_each_object_that_its_effect_does_not_mention(world) -> None:
    counted = parse_effect("(forall (?i - item ?p - place) (and (quiet) (increase (time) 1)))")
    world.apply(Delta(values={fact("time"): 0}))
    assert apply_effect(counted, world).values == {fact("time"): 6}


def test_several_changes_of_a_number_add_up_and_assignments_contradict(world) -> None:
    twice = "(and (increase (weight ?i) 1) (scale-up (weight ?i) 10))"
    assert apply_effect(parse_effect(twice), world, {"i": "cup1"}).values == {fact("weight", "cup1"): 30}
    for text in ("(and (assign (time) 1) (assign (time) 2))", "(and (assign (time) 1) (increase (time) 1))"):
        with pytest.raises(SchemaError, match="contradict"):
            apply_effect(parse_effect(text), world)


def test_the_deciding_leaf_is_the_first_false_part(world) -> None:
    e = parse_condition("(and (on ?i shelf) (or (heavy ?i) (< (weight ?i) 2)) (quiet))")
    explanation = explain(e, world, {"i": "cup1"})
    assert str(explanation.deciding) == "(heavy cup1) is false"
    assert explanation.to_json()["children"][1]["children"][1] == {
        "text": "(< (weight cup1) 2)",
        "truth": False,
        "detail": "2 < 2",
    }


def test_an_argument_computed_from_a_variable_of_the_same_atom() -> None:
    world = world_of(
        Delta(
            nodes=THINGS,
            added=(fact("level", "cup1", 2), fact("level", "cup2", 3)),
            values={fact("weight", "cup1"): 1, fact("weight", "cup2"): 1},
        )
    )
    assert query(parse_condition("(level ?i (+ (weight ?i) 1))"), world) == [{"i": "cup1"}]
