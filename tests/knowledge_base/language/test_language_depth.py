"""How deep and how long conditions may be: what can be read can be asked, and nothing overflows."""

from __future__ import annotations

import functools
import inspect
from typing import Any

import pytest
from kb_strategies import SCHEMA, THINGS

from knowledge_base import Delta, InputError, KnowledgeBase, ParseError, fact
from knowledge_base.conditions.damping import relaxed
from knowledge_base.language.checking.check import check, check_effect, check_term
from knowledge_base.language.evaluation.evaluator import apply_effect, evaluate_term, holds, query
from knowledge_base.language.evaluation.explanation import explain
from knowledge_base.language.evaluation.query_plan import plan_query
from knowledge_base.language.syntax import effect as eff
from knowledge_base.language.syntax import expression as ex
from knowledge_base.language.syntax.sexpr import MAX_DEPTH
from knowledge_base.language.syntax.text import parse_condition, to_text

CALLER = 150
"""Frames that a caller such as pytest, asyncio and an engine may have used."""


@pytest.fixture
def kb() -> KnowledgeBase:
    made = KnowledgeBase(SCHEMA)
    made.apply(Delta(nodes={"cup1": "cup"}, added=(fact("heavy", "cup1"),)), author="test")
    return made


def deep_in_the_stack(call):
    """What `call` gives when so many frames are in use already."""
    missing = CALLER - len(inspect.stack(context=0))

    def down(left):
        return call() if left <= 0 else down(left - 1)

    return down(missing)


# Each nests one deeper; the deciding leaf is `(heavy ?i)` or `(heavy cup1)`.
FORMS = {
    "not": "(not {})",
    "and": "(and (item cup1) {})",
    "or": "(or (quiet) {})",
    "imply": "(imply (item cup1) {})",
    "premise": "(imply {} (quiet))",
    "exists": "(exists (?i - cup) {})",
    "forall": "(forall (?i - cup) {})",
}
LEAVES = ("(heavy cup1)", "(not (heavy cup1))")


def nested(form: str, leaf: str, depth: int) -> str:
    text = leaf
    for _ in range(depth - leaf.count("(")):
        text = FORMS[form].format(text)
    return text


@pytest.mark.parametrize("leaf", LEAVES)
@pytest.mark.parametrize("form", FORMS)
def test_a_condition_of_maximal_depth_supports_every_operation(kb, form: str, leaf: str) -> None:
    text = nested(form, leaf, MAX_DEPTH)
    flips = text.count("(not") + text.count("(imply") * (form == "premise")

    def use() -> bool:
        truth: bool = kb.ask(text)
        assert bool(kb.query(text)) == truth
        why = kb.explain(text)
        assert why.truth == truth
        assert why.to_json()["truth"] == truth
        assert kb.explain_query(text).steps
        e = parse_condition(text)
        assert parse_condition(to_text(e)) == e
        assert hash(e) == hash(parse_condition(text))
        with kb.install(text) as condition:
            kb.apply(Delta(removed=(fact("heavy", "cup1"),)), author="test")
            after = condition.truth
            kb.apply(Delta(added=(fact("heavy", "cup1"),)), author="test")
            assert condition.truth == truth
        assert kb.ask(text) != after
        return truth

    assert deep_in_the_stack(use) == (flips % 2 == 0)


@pytest.mark.parametrize("form", ["(exists (?p - place) {})", "(or (heavy ?i) {})", "(and (item ?i) {})"])
def test_so_can_what_finds_values(kb, form: str) -> None:
    text = "(heavy ?i)"
    for _ in range(MAX_DEPTH - 1):
        text = form.format(text)

    def use() -> None:
        with kb.install(text) as condition:
            assert condition.witness["i"] == "cup1"
        assert kb.explain_query(text).steps
        assert kb.query(text) == [{"i": "cup1"}]

    deep_in_the_stack(use)


def test_so_can_numbers_and_moved_bounds(kb) -> None:
    depth = MAX_DEPTH - 2
    text = "(> " + "(+ 1 " * depth + "(weight cup1)" + ")" * depth + " 1)"

    def use() -> None:
        assert kb.ask(text)
        assert kb.explain(text).truth
        with kb.install(text, hysteresis=1) as condition:
            kb.apply(Delta(values={fact("weight", "cup1"): -depth}), author="test")
            assert not condition.truth

    deep_in_the_stack(use)


def test_deeper_text_is_refused_where_it_is_too_deep(kb) -> None:
    with pytest.raises(ParseError, match=f"<text>:1:{5 * MAX_DEPTH + 1}: parentheses are nested more than 100 deep"):
        kb.ask("(not " * 100_000 + "(quiet)" + ")" * 100_000)


# --- values that were built in Python

QUIET: Any = ex.Atom("quiet")
TIME: Any = ex.Call("time")
BECOMES_QUIET: Any = eff.Add(QUIET)
DEEP = functools.reduce(lambda e, _: ex.Not(e), range(100_000), QUIET)
DEEP_TERM = functools.reduce(lambda t, _: ex.Arithmetic("-", (t,)), range(100_000), TIME)
DEEP_EFFECT = functools.reduce(lambda e, _: eff.AllOf((e,)), range(100_000), BECOMES_QUIET)
TOO_DEEP = "this is nested more than 100 deep"


@pytest.mark.parametrize("ask", ["ask", "query", "explain", "explain_query", "install"])
@pytest.mark.parametrize("e", [DEEP, ex.Comparison("=", DEEP_TERM, ex.Constant(1)), ex.And((DEEP, DEEP))], ids=range(3))
def test_deep_values_are_one_error(kb, ask: str, e: ex.Expression) -> None:
    for _ in range(2):  # and no less the second time
        with pytest.raises(InputError, match=TOO_DEEP):
            getattr(kb, ask)(e)


@pytest.mark.parametrize(
    "use",
    [
        lambda world: holds(DEEP, world),
        lambda world: query(DEEP, world),
        lambda world: explain(DEEP, world),
        lambda world: plan_query(DEEP, world),
        lambda world: check(DEEP, SCHEMA),
        lambda world: evaluate_term(DEEP_TERM, world),
        lambda world: check_term(DEEP_TERM, SCHEMA),
        lambda world: apply_effect(DEEP_EFFECT, world),
        lambda world: check_effect(DEEP_EFFECT, SCHEMA),
        lambda world: check_effect(eff.When(DEEP, eff.AllOf(())), SCHEMA),
    ],
)
def test_so_are_they_for_the_languages_verbs(kb, use) -> None:
    with pytest.raises(InputError, match=TOO_DEEP):
        use(kb)


@pytest.mark.parametrize(
    "walk", [to_text, hash, repr, ex.free_variables, lambda e: ex.substitute(e, {"x": 1}), lambda e: relaxed(e, 1)]
)
def test_walking_through_deep_values_is_an_error_and_no_crash(walk) -> None:
    with pytest.raises(RecursionError):
        walk(DEEP)


def test_the_deepest_value_that_is_taken_is_as_deep_as_the_deepest_text(kb) -> None:
    deepest = functools.reduce(lambda e, _: ex.Not(e), range(MAX_DEPTH - 1), QUIET)
    assert kb.ask(deepest) == kb.ask(to_text(deepest))
    with pytest.raises(InputError, match=TOO_DEEP):
        kb.ask(ex.Not(deepest))
    with pytest.raises(ParseError, match="more than 100 deep"):
        kb.ask(to_text(ex.Not(deepest)))


# --- long ones


class Counted:
    """A world that counts what it is asked."""

    def __init__(self, world) -> None:
        self._world = world
        self.count = 0

    def __getattr__(self, name: str):
        return getattr(self._world, name)

    def holds(self, predicate, args):
        self.count += 1
        return self._world.holds(predicate, args)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("(and " + "(heavy cup1) " * 10_000 + ")", 10_000),
        ("(or " + "(quiet) " * 9_999 + "(heavy cup1))", 10_000),
        ("(and " + "(or (quiet) (heavy cup1)) " * 500 + ")", 1_000),
        ("(not (or " + "(quiet) " * 1_000 + "))", 1_000),
    ],
    ids=["and", "or", "and of or", "not or"],
)
def test_long_ones_are_asked_part_by_part(kb, text: str, parts: int) -> None:
    assert kb.query(text) == [{}]
    assert kb.explain(text).truth
    asked = Counted(kb)
    assert query(parse_condition(text), asked) == [{}]
    assert asked.count == parts


def test_a_long_query_finds_its_values_first(kb) -> None:
    kb.apply(Delta(nodes=THINGS, added=(fact("on", "cup1", "shelf"),)), author="test")
    text = "(and " + "(not (on ?i home)) " * 1_000 + "(heavy ?i)" + "(on ?i ?p)" + " (= ?p shelf)" * 1_000 + ")"
    assert kb.query(text) == [{"i": "cup1", "p": "shelf"}]
