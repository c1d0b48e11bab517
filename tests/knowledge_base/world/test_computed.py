"""Predicates that Python computes: asked like any other, never told, judged anew when an input changes."""

from __future__ import annotations

import contextlib
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kb_random_schemas import brute_witnesses
from kb_strategies import brute
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
    computed,
    fact,
)
from knowledge_base.language.evaluation.evaluator import apply_effect
from knowledge_base.language.syntax.text import parse_condition, parse_effect

ROOM = Schema.parse(
    """(define (domain room)
      (:types thing - object robot cup - thing)
      (:constants robo - robot)
      (:predicates (clean ?t - thing) (on ?a ?b - thing) (near-by ?a ?b - thing))
      (:functions (x ?t - thing) (y ?t - thing) (weight ?t - thing)))"""
)


@computed("(near ?a ?b - thing)", reads=["(x ?a)", "(y ?a)", "(x ?b)", "(y ?b)"])
def near(ax: float, ay: float, bx: float, by: float) -> bool:
    return math.hypot(ax - bx, ay - by) < 1


@computed("(ready ?t - thing)", reads=["(clean ?t)", "(near ?t robo)"])
def ready(clean: bool, at_hand: bool) -> bool:
    return clean and at_hand


@computed("(steady ?t - thing)", reads=["(weight ?t)"])
def steady(weight: float) -> bool:
    return 1 / weight < 1


SCHEMA = ROOM.with_computed(near, ready, steady)


def room(schema: Schema = SCHEMA) -> KnowledgeBase:
    kb = KnowledgeBase(schema)
    with kb.transaction(author="test") as world:
        for name, x in (("cup1", 0.5), ("cup2", 3), ("cup3", 0)):
            world.add_node(name, "cup")
            world.set("x", name, x)
        world.tell("clean", "cup1")
        world.tell("clean", "cup2")
        world.tell("on", "cup1", "cup2")
    return kb


def move(kb: KnowledgeBase, name: str, x: float) -> None:
    with kb.transaction(author="test") as world:
        world.set("x", name, x)


def test_it_is_asked_like_any_other() -> None:
    kb = room()
    assert kb.ask("(near cup1 robo)")
    assert not kb.ask("(near ?c robo)", {"c": "cup2"})
    assert kb.query("(and (cup ?c) (near robo ?c))") == [{"c": "cup1"}, {"c": "cup3"}]
    assert kb.query("(and (cup ?c) (not (near robo ?c)))") == [{"c": "cup2"}]
    assert kb.query("(and (cup ?c) (ready ?c))") == [{"c": "cup1"}]
    assert kb.ask("(exists (?a ?b - cup) (and (!= ?a ?b) (near ?a ?b)))")
    assert not kb.ask("(forall (?c - cup) (near ?c robo))")
    assert kb.query("(and (cup ?c) (or (near ?c cup2) (ready ?c)))") == [{"c": "cup1"}, {"c": "cup2"}]


def test_pending_changes_count() -> None:
    kb = room()
    overlay = kb.overlay()
    overlay.apply(Delta(values={fact("x", "cup2"): 0.1}))
    assert overlay.holds("near", ("cup2", "robo")) is False  # the language's affair, like types
    with kb.transaction(author="test") as world:
        world.set("x", "cup2", 0.1)
        assert world.ask("(near cup2 robo)")
        assert world.query("(and (cup ?c) (ready ?c))") == [{"c": "cup1"}, {"c": "cup2"}]
    assert not kb.at(version=1).ask("(near cup2 robo)")


def test_it_stays_a_function() -> None:
    assert near(0, 0, 0, 0.5)
    assert not near(ax=0, ay=0, bx=2, by=0)


def test_an_explanation_shows_the_inputs() -> None:
    kb = room()
    why = kb.explain("(and (cup cup2) (ready cup2))")
    assert str(why.deciding) == "(ready cup2) is false: (clean cup2) is true, (near cup2 robo) is false"
    assert str(kb.explain("(near ?c cup2)", {"c": "cup1"})) == (
        "(near cup1 cup2) is false: (x cup1) = 0.5, (y cup1) = 0, (x cup2) = 3, (y cup2) = 0"
    )


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("(near ?a ?b)", r"e\.g\. \(thing \?a\)"),
        ("(and (cup ?a) (near ?a ?b))", r"e\.g\. \(thing \?b\)"),
        ("(not (clean ?t))", r"e\.g\. \(thing \?t\)"),
        ("(or (cup ?c) (on ?a ?b))", r"e\.g\. \(thing \?a\)"),
        ("(= ?u 3)", r"e\.g\. \(object \?u\)"),
    ],
)
def test_it_only_tests(text: str, hint: str) -> None:
    with pytest.raises(InputError, match=hint):
        room().query(text)
    with pytest.raises(InputError, match=hint):
        room().install(text)


@pytest.mark.parametrize(
    "change",
    [
        Delta(added=(fact("near", "cup1", "cup2"),)),
        Delta(removed=(fact("near", "cup1", "cup2"),)),
    ],
)
def test_nobody_can_tell_or_retract_it(change: Delta) -> None:
    kb = room()
    with pytest.raises(
        SchemaError,
        match=r"'near' is computed and has no facts; tell and watch its inputs: \(x \?a\), \(y \?a\), \(x \?b\)",
    ):
        kb.apply(change, author="test")
    assert kb.version == 1


def test_no_effect_changes_it_and_nobody_watches_it() -> None:
    kb = room()
    for text in ("(near cup1 cup2)", "(not (near cup1 cup2))"):
        with pytest.raises(SchemaError, match="'near' is computed"):
            apply_effect(parse_effect(text), kb)
    with pytest.raises(SchemaError, match="'near' is computed"):
        kb.watch("(near ?a ?b)")


@pytest.mark.parametrize(
    ("text", "kind", "message"),
    [
        ("(nera cup1 cup2)", UnknownNameError, "did you mean 'near'"),
        ("(near cup1)", SchemaError, r"takes 2 arguments, as in \(near \?a - thing \?b - thing\)"),
        ("(near cup1 3)", SchemaError, "'3' is of type number"),
        ("(near cup1 cup9)", UnknownNameError, "no object 'cup9'"),
    ],
)
def test_its_use_is_checked(text: str, kind: type[InputError], message: str) -> None:
    with pytest.raises(kind, match=message):
        room().ask(text)


# --- declarations


def say(declaration: str, *reads: str):
    return computed(declaration, reads=reads)(lambda *_: True)


@pytest.mark.parametrize(
    ("declaration", "reads", "kind", "message"),
    [
        ("near ?a", (), ParseError, "one declaration is expected"),
        ("(near ?a) (far ?a)", (), ParseError, "one declaration is expected"),
        ("(near a)", (), ParseError, "begins with"),
        ("(near ?a - thing)", ("(x ?b)",), SchemaError, r"'\?b' in \(x \?b\) is not a parameter of 'near'"),
        ("(near ?a - thing)", ("(not (clean ?a))",), ParseError, "'not' is not a function"),
        ("(near ?a - thing)", ("(x ?a",), ParseError, "@computed:1:1: .* never closed"),
    ],
)
def test_declarations_that_cannot_be_read(declaration, reads, kind, message) -> None:
    with pytest.raises(kind, match=message):
        computed(declaration, reads=reads)


def test_the_function_takes_what_is_read() -> None:
    with pytest.raises(SchemaError, match="does not take 2 arguments"):

        @computed("(heavy ?a - thing)", reads=["(weight ?a)", "(x ?a)"])
        def heavy(weight: float) -> bool:
            return weight > 1


@pytest.mark.parametrize(
    ("declaration", "reads", "kind", "message"),
    [
        ("(clean ?t - thing)", (), SchemaError, "'clean' is in use"),
        ("(weight ?t - thing)", (), SchemaError, "'weight' is in use"),
        ("(cup ?t - thing)", (), SchemaError, "'cup' is in use"),
        ("(forall ?t - thing)", (), SchemaError, "'forall' is in use"),
        ("(far ?t - thin)", (), SchemaError, "unknown type 'thin'.*'thing'"),
        ("(far ?t - thing)", ("(z ?t)",), UnknownNameError, "no function 'z'"),
        ("(far ?t - thing)", ("(x ?t ?t)",), SchemaError, "takes 1 argument"),
        ("(far ?t - thing)", ("(on ?t)",), SchemaError, "takes 2 arguments"),
        ("(far ?n - number)", ("(x ?n)",), SchemaError, r"'\?n' is of type number"),
        ("(far ?n - number)", ("(clean ?n)",), SchemaError, r"'\?n' is of type number"),
        ("(far ?t - thing)", ("(far ?t)",), SchemaError, "in a cycle: far - far"),
    ],
)
def test_declarations_that_do_not_fit_the_schema(declaration, reads, kind, message) -> None:
    with pytest.raises(kind, match=message):
        ROOM.with_computed(say(declaration, *reads))


def test_no_circles_and_no_towers() -> None:
    with pytest.raises(SchemaError, match="in a cycle"):
        ROOM.with_computed(say("(p ?t - thing)", "(q ?t)"), say("(q ?t - thing)", "(p ?t)"))
    tower = [say("(p0 ?t - thing)", "(x ?t)"), *(say(f"(p{i} ?t - thing)", f"(p{i - 1} ?t)") for i in range(1, 9))]
    assert KnowledgeBase(ROOM.with_computed(*tower[:8])).ask("(p7 robo)")
    with pytest.raises(SchemaError, match="more than 8 deep"):
        ROOM.with_computed(*tower)


def test_one_name_has_one_function() -> None:
    assert SCHEMA.with_computed(near).computed["near"].function is near.function
    assert SCHEMA.merged(ROOM).computed.keys() == ROOM.merged(SCHEMA).computed.keys() == SCHEMA.computed.keys()
    with pytest.raises(SchemaError, match="'near' is declared differently before"):
        SCHEMA.with_computed(say("(near ?a - thing)"))


def test_inputs_may_be_any_terms() -> None:
    @computed("(light ?t - thing ?most - number)", reads=["?t", "(+ (weight ?t) 1)", "?most", "(cup ?t)"])
    def light(name: str, weight: float, most: float, is_cup: bool) -> bool:
        return name == "cup1" and weight < most and is_cup

    kb = room(ROOM.with_computed(light))
    assert kb.ask("(light cup1 2)")
    assert not kb.ask("(light cup1 1)")
    assert not kb.ask("(light robo 2)")


# --- functions that fail


def test_a_failure_names_the_predicate_its_arguments_and_the_cause() -> None:
    kb = room()
    with pytest.raises(InputError, match=r"<text>:1:6: \(steady cup1\) cannot be computed: ZeroDivisionError: div"):
        kb.ask("(and (steady ?c))", {"c": "cup1"})

    @computed("(odd ?t - thing)", reads=["(x ?t)"])
    def odd(x: float) -> bool:
        return x  # type: ignore[return-value]  # that is the mistake

    with pytest.raises(InputError, match=r"\(odd cup1\) cannot be computed: true or false is expected.* gave 0.5"):
        room(ROOM.with_computed(odd)).ask("(odd cup1)")


def test_an_installed_condition_that_fails_counts_as_false_and_says_why() -> None:
    kb = room()
    condition = kb.install("(steady cup1)")
    assert not condition.truth
    assert "ZeroDivisionError" in str(condition.error)
    with kb.transaction(author="test") as world:
        world.set("weight", "cup1", 2)
    assert condition.truth
    assert condition.error is None


# --- installed


def test_only_a_change_of_an_input_calls_the_function() -> None:
    calls = []

    @computed("(close ?a ?b - thing)", reads=["(x ?a)", "(x ?b)"])
    def close(a: float, b: float) -> bool:
        calls.append((a, b))
        return abs(a - b) < 1

    kb = room(ROOM.with_computed(close))
    condition = kb.install("(close cup1 robo)")
    fired = []
    condition.subscribe(lambda firing: fired.append(firing.truth), falls=True)
    calls.clear()
    with kb.transaction(author="test") as world:
        world.set("weight", "cup1", 1)
        world.set("x", "cup2", 7)
        world.retract("clean", "cup1")
    assert calls == []
    move(kb, "cup1", 9)
    move(kb, "robo", 9.5)
    assert fired == [False, True]
    assert set(calls) == {(9, 0), (9, 9.5)}


def test_an_input_that_is_itself_computed_is_followed() -> None:
    kb = room()
    condition = kb.install("(exists (?c - cup) (ready ?c))")
    assert condition.witness == {"c": "cup1"}
    move(kb, "cup1", 5)
    assert not condition.truth
    move(kb, "cup2", 0)
    assert condition.witness == {"c": "cup2"}
    with kb.transaction(author="test") as world:
        world.retract("clean", "cup2")
    assert not condition.truth


THINGS = ("robo", "cup1", "cup2", "cup3")
QUESTIONS = (
    "(near ?a robo)",
    "(and (on ?p ?q) (near ?p ?q))",
    "(and (on ?p ?q) (not (near ?q ?a)))",
    "(exists (?c - cup) (and (ready ?c) (not (on ?c ?a))))",
    "(forall (?c - cup) (imply (near ?c ?a) (ready ?c)))",
    "(or (ready ?a) (not (near cup1 ?a)))",
    "(and (cup ?p) (near ?p ?p) (> (x ?p) 1))",
)


def spelt_out(text: str) -> str:
    """The question without computed predicates: what they mean, in the language itself."""
    for name in ("?a", "?p", "?q", "?c", "cup1"):
        text = text.replace(f"(ready {name})", f"(and (clean {name}) (near {name} robo))")
    pairs = [(a, b) for a in ("?a", "?p", "?q", "?c", "cup1", "robo") for b in ("?a", "?p", "?q", "?c", "robo")]
    for a, b in pairs:
        text = text.replace(f"(near {a} {b})", f"(and (< (- (x {a}) (x {b})) 1) (< (- (x {b}) (x {a})) 1))")
    return text


changes = st.builds(
    Delta,
    values=st.dictionaries(st.sampled_from(THINGS).map(lambda n: fact("x", n)), st.integers(0, 3), max_size=2),
    added=st.lists(st.tuples(*[st.sampled_from(THINGS)] * 2).map(lambda p: fact("on", *p)), max_size=2).map(tuple),
    removed=st.lists(st.sampled_from(THINGS).map(lambda n: fact("clean", n)), max_size=1).map(tuple),
)


@PROPERTY
@given(st.data())
def test_answers_and_firings_are_those_of_the_same_question_spelt_out(data) -> None:
    kb = room()
    text, param = data.draw(st.sampled_from(QUESTIONS)), data.draw(st.sampled_from(THINGS))
    params = {"a": param} if "?a" in text else {}
    plain = parse_condition(spelt_out(text))
    condition = kb.install(text, params)
    heard, expected = [], []
    condition.subscribe(lambda firing: heard.append((firing.version, firing.truth)), falls=True)
    was = bool(brute_witnesses(plain, params, kb))
    for delta in data.draw(st.lists(changes, min_size=1, max_size=4)):
        with contextlib.suppress(InputError):
            kb.apply(delta, author="test")
        answers = kb.query(text, params)
        witnesses = brute_witnesses(plain, params, kb)
        assert sorted(map(str, answers)) == sorted(map(str, ({n: w[n] for n in a} for a in answers for w in witnesses
                                                             if w.items() >= a.items())))  # fmt: skip
        assert len(answers) == len(witnesses)
        if was != bool(witnesses):
            expected.append((kb.version, bool(witnesses)))
        was = bool(witnesses)
        assert condition.truth == was
        if was:
            known = {n: v for n, v in condition.witness.items() if n != "c"}
            assert brute(plain, kb, {**params, **known})
    assert heard == expected


# --- stores


def test_a_store_does_not_keep_it_and_goes_on_with_it(tmp_path) -> None:
    path = tmp_path / "room.kb"
    with KnowledgeBase.open(SCHEMA, path) as kb, kb.transaction(author="test") as world:
        world.add_node("cup1", "cup")
    with KnowledgeBase.open(None, path) as kb:
        with pytest.raises(UnknownNameError, match="there is no predicate 'near'"):
            kb.ask("(near cup1 robo)")
        with pytest.raises(SchemaMismatchError, match="predicate 'clean' is missing"):
            KnowledgeBase.from_json(kb.to_json(), Schema.parse("""(define (domain room)
                (:types thing - object robot cup - thing) (:constants robo - robot))""").with_computed(
                say("(clean ?t - thing)")))  # fmt: skip
    with KnowledgeBase.open(SCHEMA, path) as kb:
        assert kb.ask("(near cup1 robo)")
        assert KnowledgeBase.from_json(kb.to_json(), SCHEMA).ask("(near cup1 robo)")
        with pytest.raises(UnknownNameError, match="no predicate 'near'"):
            KnowledgeBase.from_json(kb.to_json()).ask("(near cup1 robo)")
