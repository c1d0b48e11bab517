"""What functions may be worth: numbers, text, truth values and geometries, set, asked, kept and written."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kb_strategies import SCHEMA, THINGS, deltas, removals
from kb_worlds import PROPERTY

from knowledge_base import (
    Delta,
    InputError,
    KnowledgeBase,
    ParseError,
    Schema,
    SchemaError,
    SchemaMismatchError,
    UnknownNameError,
    fact,
)
from knowledge_base.language.checking.check import check_effect
from knowledge_base.language.evaluation.evaluator import apply_effect
from knowledge_base.language.syntax.text import parse_effect
from knowledge_base.pddl import read_problem

KITCHEN = Schema.parse(
    """(define (domain kitchen)
      (:types thing - object cup device - thing)
      (:predicates (said ?t - text) (on ?a ?b - thing))
      (:functions (weight ?t - thing) (size ?t - thing) - number (label ?t - thing) (owner) - text
                  (pose ?t ?frame - thing) - geometry (powered ?d - device) - boolean (age ?t - thing)))""",
    "kitchen.pddl",
)
POSE = (0.4, 0.1, 0.8)


@pytest.fixture
def kb():
    kb = KnowledgeBase(KITCHEN)
    with kb.transaction(author="test") as tx:
        for name, type_name in {"cup1": "cup", "cup2": "cup", "lamp": "device", "map": "thing"}.items():
            tx.add_node(name, type_name)
        tx.set("label", "cup1", "red")
        tx.set("pose", "cup1", "map", POSE)
        tx.set("powered", "lamp", True)
        tx.set("weight", "cup1", 0.2)
    return kb


def test_a_declaration_says_what_those_before_it_are_worth():
    results = {name: function.result for name, function in KITCHEN.functions.items()}
    assert results == {
        "weight": "number", "size": "number", "label": "text", "owner": "text", "pose": "geometry",
        "powered": "boolean", "age": "number",
    }  # fmt: skip
    assert str(KITCHEN.functions["label"]) == "(label ?t - thing) - text"
    assert str(KITCHEN.functions["age"]) == "(age ?t - thing)"


def test_functions_are_worth_what_was_set_and_until_then_what_their_type_says(kb):
    said = [kb.value("label", ("cup1",)), kb.value("pose", ("cup1", "map")), kb.value("powered", ("lamp",))]
    assert said == ["red", POSE, True]
    unset = [
        kb.value(f, a) for f, a in {"label": ("cup2",), "pose": ("cup2", "map"), "owner": (), "age": ("cup1",)}.items()
    ]
    assert unset == ["", (), "", 0]
    assert KnowledgeBase(KITCHEN).value("powered", ("lamp",)) is False
    with pytest.raises(UnknownNameError, match="did you mean 'label'"):
        kb.value("labl", ("cup1",))


@pytest.mark.parametrize(
    ("question", "answers"),
    [
        ('(and (cup ?c) (= (label ?c) "red"))', ["cup1"]),
        ('(and (cup ?c) (!= (label ?c) "red"))', ["cup2"]),
        ('(and (cup ?c) (= (label ?c) ""))', ["cup2"]),
        ("(and (device ?c) (= (powered ?c) true))", ["lamp"]),
        ("(and (cup ?c) (= (pose ?c map) (geometry 0.4 0.1 0.8)))", ["cup1"]),
        ("(and (cup ?c) (= (pose ?c map) (geometry (/ 2 5) 0.1 (* 4 (weight ?c)))))", ["cup1"]),
        ("(and (cup ?c) (= (pose ?c map) (geometry)))", ["cup2"]),
        ("(and (cup ?c) (said (label ?c)))", ["cup1"]),
        ("(and (cup ?c) (exists (?o - cup) (and (!= ?o ?c) (= (pose ?o map) (pose ?c map)))))", []),
    ],
)
def test_content_is_compared_and_an_argument_where_its_type_fits(kb, question, answers):
    kb.apply(Delta(added=(fact("said", "red"),)), author="test")
    assert [found["c"] for found in kb.query(question)] == answers


def test_an_explanation_shows_content_as_it_is_written(kb):
    assert str(kb.explain("(= (pose cup1 map) (geometry 1 2))")) == (
        "(= (pose cup1 map) (geometry 1 2)) is false: (geometry 0.4 0.1 0.8) = (geometry 1 2)"
    )


def test_conditions_on_content_fire(kb):
    told = []
    kb.install('(= (label cup2) "blue")').subscribe(lambda f: told.append((f.version, f.truth)), falls=True)
    kb.install("(= (pose cup1 map) (pose cup2 map))").subscribe(lambda f: told.append((f.version, "there")))
    for delta in (
        Delta(values={fact("label", "cup2"): "blue"}),
        Delta(values={fact("pose", "cup2", "map"): POSE}),
        Delta(removed_nodes=("cup2",)),
    ):
        kb.apply(delta, author="test")
    assert told == [(2, True), (3, "there"), (4, False)]


def test_the_graph_has_content_on_its_arcs(kb):
    assert kb.graph.edges["cup1", "map", "pose"]["value"] == POSE
    assert kb.graph.edges["cup1", "cup1", "label"]["value"] == "red"
    assert "value" not in kb.graph.nodes["cup1"]


def test_a_geometry_is_forgotten_by_setting_nothing(kb):
    with kb.transaction(author="test") as tx:
        tx.set("pose", "cup1", "map", ())
        assert tx.ask("(= (pose cup1 map) (geometry))")
    assert kb.at(version=1).value("pose", ("cup1", "map")) == POSE


REFUSED = [
    # content, message
    (fact("label", "cup1"), 3, SchemaError, r"\(label cup1\) is text, not 3"),
    (fact("label", "cup1"), POSE, SchemaError, "is text, not"),
    (fact("powered", "lamp"), 1, SchemaError, "is true or false, not 1"),
    (fact("powered", "lamp"), "on", SchemaError, "is true or false, not 'on'"),
    (fact("weight", "cup1"), True, SchemaError, "is a number, not True"),
    (fact("weight", "cup1"), (1.0,), SchemaError, "is a number, not"),
    (fact("pose", "cup1", "map"), 1.0, SchemaError, "is a geometry, a tuple of at most 16 numbers, not 1.0"),
    (fact("pose", "cup1", "map"), [1.0], SchemaError, "is a geometry"),
    (fact("pose", "cup1", "map"), (1.0, "x"), SchemaError, "is a geometry"),
    (fact("pose", "cup1", "map"), (True,), SchemaError, "is a geometry"),
    (fact("pose", "cup1", "map"), (0.0,) * 17, SchemaError, "at most 16"),
    (fact("pose", "cup1", "map"), (1.0, float("nan")), InputError, "finite number, not nan"),
    (fact("pose", "cup1", "map"), (10**400,), InputError, "at most 1e308"),
    (fact("pose", "cup1"), POSE, SchemaError, "takes 2 arguments"),
    (fact("pose", "cup1", "mop"), POSE, UnknownNameError, "did you mean 'map'"),
    (fact("pose", "cup1", POSE), POSE, SchemaError, "is of type thing, not"),  # type: ignore[arg-type]
    (fact("poise", "cup1", "map"), POSE, UnknownNameError, "did you mean 'pose'"),
]


@pytest.mark.parametrize(("fluent", "content", "kind", "message"), REFUSED)
def test_an_invalid_function_value_is_refused_without_effect(kb, fluent, content, kind, message):
    before = kb.to_json()
    with pytest.raises(kind, match=message):
        kb.apply(Delta(values={fluent: content}), author="test")
    with pytest.raises(kind, match=message), kb.transaction(author="test") as tx:
        tx.set(fluent.predicate, *fluent.args, content)
    assert kb.to_json() == before


ILL_TYPED = [
    # question, place, message
    ("(< (label cup1) 3)", "1:4", "'<' works on numbers, and the argument is none"),
    ("(< 3 (pose cup1 map))", "1:6", "works on numbers"),
    ("(> (+ 1 (powered lamp)) 0)", "1:9", "works on numbers"),
    ("(= (geometry 1 (label cup1)) (pose cup1 map))", "1:16", "'geometry' works on numbers"),
    ("(on (label cup1) map)", "1:5", "the argument is of type text, but '\\?a' of 'on' is of type thing"),
    ("(said (pose cup1 map))", "1:7", "the argument is of type geometry, but '\\?t' of 'said' is of type text"),
    ("(said (weight cup1))", "1:7", "is of type number"),
    ("(powered lamp)", "1:1", r"'powered' is a function; compare its value: \(= \(powered ...\) VALUE\)"),
    ("(said (geometry 1 2))", "1:7", "is of type geometry"),
]


@pytest.mark.parametrize(("question", "place", "message"), ILL_TYPED)
def test_content_where_it_does_not_fit_is_a_static_error(kb, question, place, message):
    with pytest.raises(SchemaError, match=message) as caught:
        kb.query(question)
    assert str(caught.value.place) == f"<text>:{place}"


def test_a_geometry_is_no_parameter(kb):
    with pytest.raises(SchemaError, match=r"'\?p' cannot be a geometry; write it into the condition"):
        kb.ask("(= (pose cup1 map) ?p)", {"p": POSE})


def test_a_geometry_has_at_most_sixteen_numbers(kb):
    assert not kb.ask(f"(= (pose cup1 map) (geometry {'1 ' * 16}))")
    with pytest.raises(ParseError, match="at most 16 numbers; found 17"):
        kb.ask(f"(= (pose cup1 map) (geometry {'1 ' * 17}))")


@pytest.mark.parametrize(
    ("declarations", "message"),
    [
        ("(:types geometry)", "d:1:28: 'geometry' is a type of values, not of things"),
        ("(:predicates (at ?p - geometry))", r"'\?p' of 'at' cannot be a geometry; only the value of a function can"),
        ("(:functions (f) - pose)", "d:1:38: .*functions whose values are things.*Tamer"),
        ("(:functions (f) - numer)", "did you mean 'number'"),
        ("(:functions (f) -)", "'-' without a type after it"),
        ("(:functions - text)", "in parentheses"),
        ("(:functions (f) - text (f))", "the function 'f' is declared differently before"),
    ],
)
def test_bad_declarations(declarations, message):
    with pytest.raises(InputError, match=message):
        Schema.parse(f"(define (domain d) {declarations})", "d")


@pytest.mark.parametrize(
    ("effect", "fluent", "content"),
    [
        ('(assign (label ?t) "blue")', "label", "blue"),
        ("(assign (label ?t) (owner))", "label", ""),
        ("(assign (pose ?t map) (geometry 1 (weight ?t)))", "pose", (1, 0.2)),
        ("(assign (pose ?t map) (pose map map))", "pose", ()),
    ],
)
def test_effects_assign_content(kb, effect, fluent, content):
    parsed = parse_effect(effect)
    check_effect(parsed, KITCHEN, {"t": "cup"}, objects=kb.nodes())
    delta = apply_effect(parsed, kb, {"t": "cup1"})
    assert [(f.predicate, c) for f, c in delta.values.items()] == [(fluent, content)]


@pytest.mark.parametrize(
    ("effect", "message"),
    [
        ("(assign (label ?t) 3)", "'label' has values of type text, and '3' is of type number"),
        ("(assign (label ?t) ?t)", r"'label' has values of type text, and '\?t' is of type cup"),
        ('(assign (weight ?t) "heavy")', "'assign' works on numbers"),
        ("(increase (label ?t) 1)", "'increase' works on numbers"),
        ("(increase (weight ?t) (label ?t))", "'increase' works on numbers"),
        ("(assign (pose ?t map) 1)", "'pose' has values of type geometry"),
    ],
)
def test_effects_that_assign_something_else_are_refused(effect, message):
    with pytest.raises(SchemaError, match=message):
        check_effect(parse_effect(effect), KITCHEN, {"t": "cup"})


def test_an_assigned_parameter_is_judged_when_it_has_a_value(kb):
    with pytest.raises(SchemaError, match=r"\(label cup1\) is text, not 3"):
        apply_effect(parse_effect("(assign (label cup1) ?x)"), kb, {"x": 3})


def test_a_store_with_content_is_opened_again_with_the_types_it_was_written_with(kb, tmp_path):
    path = tmp_path / "world.kb"
    with KnowledgeBase.open(KITCHEN, path) as store:
        store.apply(Delta(kb.nodes(), (), (), kb.values()), author="test")
    with KnowledgeBase.open(None, path) as store:
        assert repr(store.values()) == repr(kb.values())
        assert store.schema.functions["pose"].result == "geometry"
    other = "(define (domain d) (:types thing - object cup device - thing) (:predicates (said ?t - text) (on ?a ?b - thing)) (:functions (label ?t - thing)))"
    with pytest.raises(
        SchemaMismatchError, match="the function 'label' was declared 'label thing - text', now it is 'label thing'"
    ):
        KnowledgeBase.open(Schema.parse(other), path)


# --- PDDL problems


def test_a_problem_says_what_functions_are_worth():
    problem = read_problem(
        """(define (problem p) (:domain kitchen) (:objects c - cup map - thing l - device)
        (:init (= (label c) "Red one") (= (pose c map) (geometry 0.4 -1 8e-1)) (= (powered l) true) (= (weight c) 2)))""",
        KITCHEN,
    )
    assert problem.values == {
        fact("label", "c"): "Red one", fact("pose", "c", "map"): (0.4, -1, 0.8), fact("powered", "l"): True,
        fact("weight", "c"): 2,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ("(= (label c) 3)", r"p:2:15: \(label c\) is text, not 3"),
        ("(= (weight c) true)", r"p:2:16: \(weight c\) is a number, not True"),
        ("(= (pose c c) (geometry 1 (weight c)))", "':init' has facts"),
        ("(= (pose c c) 1)", "is a geometry"),
        ("(= (label c) (owner))", "':init' has facts"),
    ],
)
def test_a_problem_that_says_something_else_is_refused(said, message):
    with pytest.raises(InputError, match=message):
        read_problem(f"(define (problem p) (:domain kitchen) (:objects c - cup) (:init\n {said}))", KITCHEN, "p")


@PROPERTY
@given(st.lists(deltas() | removals(), max_size=4))
def test_a_world_survives_being_written_as_a_problem(changes):
    kb = KnowledgeBase(SCHEMA)
    for change in changes:
        kb.apply(Delta(nodes=THINGS), author="test")
        kb.apply(change, author="test")
    again = KnowledgeBase(SCHEMA)
    again.apply(read_problem(kb.to_pddl("small"), SCHEMA, domain="small").delta(), author="test")
    said, read = ((view.nodes(), repr(view.facts()), view.values()) for view in (kb, again))
    assert read[:2] == said[:2]
    assert {f: v for f, v in said[2].items() if v != SCHEMA.unset(f.predicate)} == read[2]
    assert all(type(read[2][f]) is type(said[2][f]) for f in read[2])


def test_a_problem_has_the_goal_and_text_in_quotes(kb):
    kb.apply(Delta(added=(fact("said", "cup1"), fact("said", "hello"))), author="test")
    text = kb.to_pddl("kitchen", "breakfast", "(exists (?c - cup) (on ?c map))")
    problem = read_problem(text, KITCHEN)
    assert (problem.name, problem.domain, problem.has_goal) == ("breakfast", "kitchen", True)
    assert '(said "hello")' in text
    assert kb.ask(problem.goal) is False


@pytest.mark.parametrize(
    ("delta", "how", "message"),
    [
        (Delta(values={fact("age", "cup1"): 10**50}), {}, "at most 40 characters"),
        (Delta(), {"domain": "My kitchen"}, "'My kitchen' cannot be a name"),
        (Delta(), {"goal": "(on ?x map)"}, "not bound"),
    ],
)
def test_to_pddl_refuses_an_invalid_number_name_or_goal(kb, delta, how, message):
    kb.apply(delta, author="test")
    with pytest.raises(InputError, match=message):
        kb.to_pddl(**{"domain": "kitchen", **how})
