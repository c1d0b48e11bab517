"""Why a condition is true or false: a tree in which each truth follows from the ones below."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kb_strategies import NAMES, SCHEMA, THINGS, brute, deltas, expressions
from kb_worlds import PROPERTY

from knowledge_base import Delta, InputError, KnowledgeBase, Schema, UnknownNameError, fact
from knowledge_base.language.evaluation.evaluator import holds
from knowledge_base.language.evaluation.explanation import Explanation, explain
from knowledge_base.language.syntax import expression as ex
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.world.overlay import Overlay
from knowledge_base.world.state import WorldState


@pytest.fixture
def kb() -> KnowledgeBase:
    made = KnowledgeBase(SCHEMA)
    facts = (
        fact("heavy", "can1"),
        fact("on", "cup1", "shelf"),
        fact("on", "cup2", "shelf"),
        fact("on", "cup2", "home"),
    )
    made.apply(Delta(nodes=THINGS, added=facts, values={fact("weight", "cup1"): 3}), author="test")
    return made


def drawn(explanation: Explanation, indent: str = "") -> list[str]:
    """One line each, the deciding child marked."""
    lines = [f"{indent}{explanation}"]
    for number, child in enumerate(explanation.children):
        first, *rest = drawn(child, indent + "  ")
        lines += [f"{first} <-" if number == explanation.decider else first, *rest]
    return lines


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("(quiet)", ["(quiet) is false"]),
        ("(and)", ["(and) is true"]),
        ("(or)", ["(or) is false"]),
        ("(cup ?c)", ["(cup cup1) is true"]),
        ("(= ?c cup1)", ["(= cup1 cup1) is true"]),
        ("(> (weight ?c) (+ 2 2))", ["(> (weight cup1) (+ 2 2)) is false: 3 > 4"]),
        ("(not (quiet))", ["(not (quiet)) is true", "  (quiet) is false <-"]),
        (
            "(and (cup ?c) (heavy ?c) (quiet))",
            [
                "(and (cup cup1) (heavy cup1) (quiet)) is false",
                "  (cup cup1) is true",
                "  (heavy cup1) is false <-",
                "  (quiet) is false",
            ],
        ),
        (
            "(or (quiet) (cup ?c) (heavy ?c))",
            [
                "(or (quiet) (cup cup1) (heavy cup1)) is true",
                "  (quiet) is false",
                "  (cup cup1) is true <-",
                "  (heavy cup1) is false",
            ],
        ),
        (
            "(imply (cup ?c) (heavy ?c))",
            ["(imply (cup cup1) (heavy cup1)) is false", "  (cup cup1) is true", "  (heavy cup1) is false <-"],
        ),
        (
            "(imply (quiet) (heavy ?c))",
            ["(imply (quiet) (heavy cup1)) is true", "  (quiet) is false <-", "  (heavy cup1) is false"],
        ),
        (
            "(exists (?p - place) (on ?c ?p))",
            ["(exists (?p - place) (on cup1 ?p)) is true: ?p = shelf", "  (on cup1 shelf) is true <-"],
        ),
        (
            "(exists (?i - item) (and (on ?i shelf) (on ?i home) (heavy ?i)))",
            [
                "(exists (?i - item) (and (on ?i shelf) (on ?i home) (heavy ?i))) is false: the nearest miss",
                "  (and (on cup2 shelf) (on cup2 home) (heavy cup2)) is false <-",
                "    (on cup2 shelf) is true",
                "    (on cup2 home) is true",
                "    (heavy cup2) is false <-",
            ],
        ),
        (
            "(exists (?i - item ?p - place) (near ?p ?p))",
            [
                "(exists (?i - item ?p - place) (near ?p ?p)) is false: the nearest miss",
                "  (near home home) is false <-",
            ],
        ),
        ("(forall (?i - cup) (on ?i shelf))", ["(forall (?i - cup) (on ?i shelf)) is true"]),
        (
            "(forall (?i - item) (on ?i shelf))",
            ["(forall (?i - item) (on ?i shelf)) is false: ?i = can1", "  (on can1 shelf) is false <-"],
        ),
    ],
)
def test_each_form(kb, text: str, expected: list[str]) -> None:
    assert drawn(kb.explain(text, {"c": "cup1"} if "?c" in text else {})) == expected


def test_of_nothing_nothing_can_be_chosen() -> None:
    why = KnowledgeBase(SCHEMA).explain("(exists (?i - item) (heavy ?i))")
    assert str(why) == "(exists (?i - item) (heavy ?i)) is false: there is nothing to choose from"


# --- the tree follows from its leaves


def follows(node: Explanation) -> bool:
    """Whether the node's truth is what its children's truths make of it."""
    below = [child.truth for child in node.children]
    match parse_condition(node.text):
        case ex.Not():
            found = not below[0]
        case ex.And():
            found = all(below)
        case ex.Or():
            found = any(below)
        case ex.Imply():
            found = not below[0] or below[1]
        case ex.Exists():
            found = below == [True]
        case ex.Forall():
            found = below != [False]
        case _:
            found = node.truth and not below
    return node.truth is found


def decides(node: Explanation) -> bool:
    """Whether the node's truth is so because of the deciding child, whatever the children after it are."""
    if node.decider is None:
        return not node.children
    before = [child.truth for child in node.children[: node.decider]]
    truth = node.children[node.decider].truth
    match parse_condition(node.text):
        case ex.Not():
            return truth is not node.truth
        case ex.And():
            return truth is node.truth and (node.truth or all(before))
        case ex.Or():
            return truth is node.truth and (not node.truth or not any(before))
        case ex.Imply():
            return truth is node.truth and before == [True] if node.decider else not truth and node.truth
        case _:
            return truth is node.truth


def nodes(explanation: Explanation) -> list[Explanation]:
    return [explanation, *(node for child in explanation.children for node in nodes(child))]


@PROPERTY
@given(expressions(), deltas(), st.fixed_dictionaries({name: st.sampled_from(sorted(THINGS)) for name in NAMES}))
def test_every_truth_is_that_of_its_text_and_follows_from_those_below(e, delta, b) -> None:
    world = Overlay(WorldState(SCHEMA))
    world.apply(delta)
    explanation = explain(e, world, b)
    assert explanation.truth == brute(e, world, b)
    for node in nodes(explanation):
        assert holds(parse_condition(node.text), world) == node.truth
        assert follows(node)
        assert decides(node)
    path = [explanation]
    while path[-1].decider is not None:
        path.append(path[-1].children[path[-1].decider])
    assert explanation.deciding is path[-1]
    assert not path[-1].children


# --- what cannot be computed

WEIGHTS = Schema.parse(
    """(define (domain d) (:types item)
      (:predicates (known ?i - item) (good ?i - item)) (:functions (weight ?i - item)))"""
)
RATIO = "(> (/ 1 (weight ?i)) 2)"


@pytest.fixture
def weights() -> KnowledgeBase:
    made = KnowledgeBase(WEIGHTS)
    made.apply(Delta(nodes={"a": "item"}, added=(fact("known", "a"),)), author="test")
    return made


@pytest.mark.parametrize(
    ("text", "truth", "leaf"),
    [
        (f"(and (good ?i) {RATIO})", False, "(good a) is false"),
        (f"(or (known ?i) {RATIO})", True, "(known a) is true"),
        (f"(imply (good ?i) {RATIO})", True, "(good a) is false"),
        (f"(exists (?i - item) (and {RATIO} (good ?i)))", False, "(good a) is false"),
        (f"(forall (?i - item) (or (known ?i) {RATIO}))", True, None),
    ],
)
def test_an_incomputable_operand_is_harmless_if_another_operand_decides(weights, text, truth, leaf) -> None:
    params = {} if text.startswith(("(exists", "(forall")) else {"i": "a"}
    assert weights.ask(text, params) is truth
    why = weights.explain(text, params)
    assert why.truth is truth
    if leaf is not None:
        assert str(why.deciding) == leaf
        failed = next(node for node in nodes(why) if node.text.startswith("(>"))
        assert not failed.truth
        assert failed.detail is not None
        assert "cannot be computed: <text>:1:" in failed.detail
        assert "division by zero" in failed.detail


@pytest.mark.parametrize(
    "text",
    [RATIO, f"(and (known ?i) {RATIO})", f"(or (good ?i) {RATIO})", f"(imply (known ?i) {RATIO})", f"(not {RATIO})"],
)
def test_an_incomputable_operand_that_decides_is_an_error(weights, text: str) -> None:
    for ask in (weights.ask, weights.explain):
        with pytest.raises(InputError, match="division by zero"):
            ask(text, {"i": "a"})


def test_a_mistake_in_a_part_that_does_not_decide_is_an_error_all_the_same(weights) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'good'"):
        explain(parse_condition("(and (good a) (god a))"), weights)


def test_the_size_of_an_explanation_does_not_multiply_with_nesting() -> None:
    kb = KnowledgeBase(WEIGHTS)
    kb.apply(Delta(nodes={f"i{n}": "item" for n in range(20)}), author="test")
    names = [f"?v{n}" for n in range(8)]
    text = "(good ?v7)"
    for name in reversed(names):
        text = f"(exists ({name} - item) {text})"  # 20 ** 8 choices
    why = kb.explain(text)
    assert len(nodes(why)) == 9
    assert str(why.deciding) == "(good i0) is false"
