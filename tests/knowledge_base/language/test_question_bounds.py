"""Questions end: by their bounds, when they are cancelled, or after so many answers."""

from __future__ import annotations

from itertools import count, islice, pairwise

import pytest

from knowledge_base import Bounds, ConflictError, Delta, Fact, InputError, KnowledgeBase, OutOfBoundsError, Schema
from knowledge_base.language.evaluation.world_protocol import CHECK_EVERY
from knowledge_base.statements import told

ITEMS = 100
DOMAIN = """(define (domain d) (:types item - object)
    (:predicates (clean ?x - item) (next ?a ?b - item) (between ?a ?b ?c - item)) (:functions (weight ?x - item)))"""
ENDLESS = [
    "(and (item ?a) (item ?b) (item ?c) (item ?d) (not (= ?a ?b)))",
    "(exists (?a ?b ?c ?d - item) (> (+ (weight ?a) (weight ?b) (weight ?c)) 1))",
    "(forall (?a ?b ?c ?d - item) (< (+ (weight ?a) (weight ?b)) 1))",
    "(exists (?a ?b ?c ?d - item) (not (= ?d ?d)))",
    "(not (exists (?a ?b ?c ?d - item) (= (/ 1 (weight ?a)) (weight ?b))))",
    "(or (exists (?a ?b ?c ?d - item) (< (weight ?a) (- (weight ?b)))) (exists (?x ?y ?z ?u - item) (clean ?x)))",
    "(and (next ?a ?b) (next ?c ?d) (next ?e ?f) (next ?g ?h) (= ?a o3))",
    "(forall (?a - item) (exists (?b ?c ?d - item) (not (= ?d ?d))))",
]


@pytest.fixture(scope="module")
def kb():
    kb = KnowledgeBase(Schema.parse(DOMAIN))
    names = [f"o{number}" for number in range(ITEMS)]
    pairs = pairwise(names)
    kb.apply(
        Delta(nodes=dict.fromkeys(names, "item"), added=tuple(Fact("next", pair) for pair in pairs)), author="test"
    )
    return kb


def ways(kb, text):
    yield lambda bounds: kb.query(text, bounds=bounds)
    yield lambda bounds: list(kb.stream(text, bounds=bounds))
    if not text.startswith("(and"):
        yield lambda bounds: kb.ask(text, bounds=bounds)
        yield lambda bounds: kb.explain(text, bounds=bounds)


@pytest.mark.parametrize("text", ENDLESS)
def test_a_question_is_given_up_where_its_work_ends(kb, text):
    for ask in ways(kb, text):
        with pytest.raises(OutOfBoundsError, match="the query visits more than 2000 facts and objects") as raised:
            ask(Bounds(work=2000))
        assert 2000 < raised.value.work <= 2000 + ITEMS + 1
        assert text[:40] in str(raised.value)
        assert "raise the bound" in str(raised.value)


@pytest.mark.parametrize("text", ENDLESS)
def test_a_question_is_given_up_when_its_time_is_over(kb, text):
    for ask in ways(kb, text):
        clock = count(0.0)
        with pytest.raises(OutOfBoundsError, match=r"takes longer than 5 s.*in 7\.00 s"):
            ask(Bounds(seconds=5, now=clock.__next__))


@pytest.mark.parametrize("text", ENDLESS)
def test_a_question_ends_when_it_is_cancelled(kb, text):
    for ask in ways(kb, text):
        looks = (number == 3 for number in count())
        with pytest.raises(OutOfBoundsError, match="the query was cancelled") as raised:
            ask(Bounds(cancelled=looks.__next__))
        assert raised.value.work <= 4 * (CHECK_EVERY + ITEMS + 1)


def test_a_list_that_is_looked_through_for_few_facts_counts():
    kb = KnowledgeBase(Schema.parse(DOMAIN))
    names = [f"o{number}" for number in range(20)]
    facts = tuple(Fact("between", (one, "o0", other)) for one in names for other in names)
    kb.apply(Delta(nodes=dict.fromkeys(names, "item"), added=facts), author="test")
    assert kb.query("(between o1 ?x o2)", bounds=Bounds(work=30)) == [{"x": "o0"}]
    with pytest.raises(OutOfBoundsError):
        kb.query("(between o1 ?x o2)", bounds=Bounds(work=20))


QUESTIONS = [
    "(next ?a ?b)", "(and (next ?a ?b) (next ?b ?c))", "(or (next o1 ?x) (next ?x o7))", "(item ?x)", "(next o1 o2)",
    "(and (item ?x) (exists (?y) (next ?y ?x)) (not (next ?x o9)))", "(clean ?x)", "(exists (?x) (next ?x ?y))",
]  # fmt: skip


@pytest.mark.parametrize("text", QUESTIONS)
def test_with_room_enough_the_answers_are_the_same_one_by_one_too(kb, text):
    answers = kb.query(text)
    assert kb.query(text, bounds=Bounds(work=100_000)) == list(kb.stream(text)) == answers
    for limit in (0, 1, 3, len(answers), len(answers) + 1):
        assert kb.query(text, limit=limit) == answers[:limit]


def test_a_limit_ends_a_question_that_has_more_answers_than_memory(kb):
    assert len(kb.query(ENDLESS[0], limit=250, bounds=Bounds(work=20_000))) == 250
    first = next(kb.stream(ENDLESS[0], bounds=Bounds(work=20_000)))
    assert first == {"a": "o0", "b": "o1", "c": "o0", "d": "o0"}


@pytest.mark.parametrize("limit", [-1, 1.5, True, "3"])
def test_a_limit_is_a_whole_number(kb, limit):
    with pytest.raises(InputError, match="a limit is a whole number, 0 or more, not"):
        kb.query("(item ?x)", limit=limit)


def test_answers_found_before_the_bound_are_not_lost(kb):
    answers = []
    with pytest.raises(OutOfBoundsError):
        answers.extend(kb.stream("(and (item ?a) (item ?b))", bounds=Bounds(work=1000)))
    found = []
    for answer in kb.stream("(and (item ?a) (item ?b))", bounds=Bounds(work=1000)):
        found.append(answer)
        if len(found) == 500:
            break
    assert len(found) == 500


def test_a_change_ends_a_stream(kb):
    other = KnowledgeBase(kb.schema)
    other.apply(Delta(nodes={f"o{number}": "item" for number in range(300)}), author="test")
    answers = other.stream("(item ?x)")
    assert len(list(islice(answers, 5))) == 5
    then = other.at(version=other.version).stream("(item ?x)")
    assert len(list(islice(then, 5))) == 5
    other.apply(Delta(nodes={"more": "item"}), author="test")
    assert len(list(then)) == 295
    with pytest.raises(ConflictError, match="a change was committed while the answers were read"):
        list(answers)


def test_a_mistake_is_said_before_the_first_answer(kb):
    with pytest.raises(InputError, match="no predicate 'nex'"):
        kb.stream("(nex ?x ?y)")


@pytest.mark.parametrize("said", [
    "(forall (?a ?b ?c ?d - item) (and (clean ?a) (clean ?b) (clean ?c) (clean ?d)))",
    "(forall (?a ?b ?c ?d - item) (when (and (= ?a ?b) (= ?c ?d)) (clean ?a)))",
    "(forall (?a ?b ?c ?d - item) (increase (weight ?a) 1))",
    "(when (exists (?a ?b ?c ?d - item) (not (= ?d ?d))) (clean o1))",
    "(forall (?a - item) (and " + "(clean ?a) " * 300 + "))",
    "(assign (weight o1) (+ " + "(weight o1) " * 2500 + "))",
])  # fmt: skip
def test_an_effect_is_given_up_where_its_work_ends(kb, said):
    with pytest.raises(OutOfBoundsError, match="visits more than 2000 facts and objects: FACT"):
        told([said], kb, "FACT", Bounds(work=2000))


def test_only_the_first_of_many_errors_is_kept(kb):
    """Formerly each candidate that cannot be computed left its error in memory."""
    import gc

    def errors():
        return sum(issubclass(type(one), InputError) for one in gc.get_objects())

    answers, before = kb.stream("(and (item ?a) (item ?b) (= (/ 1 (weight ?a)) 1))"), errors()
    with pytest.raises(InputError, match="division by zero"):
        list(answers)
    assert errors() - before < ITEMS
