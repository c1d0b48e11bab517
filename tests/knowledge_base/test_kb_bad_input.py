"""What people get wrong: one clear error with its place and the nearest right name, and nothing changed."""

from __future__ import annotations

import pytest
from kb_strategies import SCHEMA, THINGS
from kb_worlds import everything, graph_content

from knowledge_base import (
    Delta,
    InputError,
    KnowledgeBase,
    ParseError,
    Schema,
    SchemaError,
    UnknownNameError,
    UnsupportedConstructError,
    fact,
)
from knowledge_base.language.syntax.text import parse_condition, parse_effect
from knowledge_base.pddl import read_domain, read_problem

QUESTIONS = [
    # text, kind of error, line:column, nearest name
    ("", ParseError, "1:1", None),
    ("quiet", ParseError, "1:1", None),
    ("(quiet", ParseError, "1:1", None),
    ("(quiet))", ParseError, "1:8", None),
    ("(quiet) (quiet)", ParseError, "1:9", None),
    ('(heavy "cup1)', ParseError, "1:8", None),
    ("((quiet))", ParseError, "1:2", None),
    ("(?x cup1)", ParseError, "1:2", None),
    ("(not)", ParseError, "1:1", None),
    ("(not (quiet) (quiet))", ParseError, "1:14", None),
    ("(imply (quiet))", ParseError, "1:1", None),
    ("(exists ?i (heavy ?i))", ParseError, "1:9", None),
    ("(exists (i - cup) (heavy i))", ParseError, "1:10", None),
    ("(exists (?i ?i - cup) (heavy ?i))", ParseError, "1:13", None),
    ("(exists (?i -) (heavy ?i))", ParseError, "1:13", None),
    ("(exists (- cup) (quiet))", ParseError, "1:10", None),
    ("(exist (?i - cup) (heavy ?i))", ParseError, "1:1", "exists"),
    ("(< 1)", ParseError, "1:1", None),
    ("(< 1 (+ 1))", ParseError, "1:6", None),
    ("(< 1 (and))", ParseError, "1:6", None),
    ("(< 1 1e999)", ParseError, "1:6", None),
    (f"(< 1 {'9' * 5000})", ParseError, "1:6", None),
    ("(heavy ?)", ParseError, "1:8", None),
    ("(heavy cup\0)", ParseError, "1:8", None),
    ("(annd (quiet))", UnknownNameError, "1:1", "and"),
    ("\n  (heavi cup1)", UnknownNameError, "2:3", "heavy"),
    ("(heavy cup11)", UnknownNameError, "1:8", "cup1"),
    ("(heavy ?i)", UnknownNameError, "1:8", None),
    ("(heavy ?thin)", UnknownNameError, "1:8", "?thing"),
    ("(exists (?i - cupp) (heavy ?i))", UnknownNameError, "1:10", "cup"),
    ("(exists (?n - number) (quiet))", UnknownNameError, "1:10", None),
    ("(< (wait cup1) 3)", UnknownNameError, "1:4", "weight"),
    ("(= ?thing shelv)", UnknownNameError, "1:11", "shelf"),
    ("(on cup1)", SchemaError, "1:1", None),
    ("(on cup1 cup2)", SchemaError, "1:10", None),
    ("(forall (?p - place) (heavy ?p))", SchemaError, "1:29", None),
    ("(on 3 shelf)", SchemaError, "1:5", None),
    ("(level cup1 shelf)", SchemaError, "1:13", None),
    ("(< cup1 3)", SchemaError, "1:4", None),
    ("(> (weight shelf) 1)", SchemaError, "1:12", None),
]


@pytest.fixture
def kb(tmp_path):
    """A store of which everything is compared after the test: no mistake changes anything of it."""
    with KnowledgeBase.open(SCHEMA, tmp_path / "world.kb") as kb:
        kb.apply(Delta(nodes=THINGS, added=(fact("on", "cup1", "shelf"),), values={fact("time"): 3}), author="test")
        fired: list[object] = []
        kb.install("(exists (?i - item) (heavy ?i))").subscribe(fired.append, falls=True)
        before = everything(kb), graph_content(kb.graph), kb.changes()
        yield kb
        assert (everything(kb), graph_content(kb.graph), kb.changes()) == before
        assert not fired
    with KnowledgeBase.open(None, tmp_path / "world.kb", read_only=True) as again:
        assert everything(again) == before[0]


@pytest.mark.parametrize(("text", "kind", "where", "nearest"), QUESTIONS, ids=[q[0][:30] for q in QUESTIONS])
def test_questions(kb, text: str, kind: type[InputError], where: str, nearest: str | None) -> None:
    for put in (kb.ask, kb.explain, kb.install):
        if put == kb.install and "(heavy ?" in text and "exist" not in text:
            continue  # there a free variable is no mistake
        with pytest.raises(kind) as caught:
            put(text, {"thing": "cup1"})
    assert str(caught.value.place) == f"<text>:{where}"
    if nearest is not None:
        assert caught.value.nearest == nearest


@pytest.mark.parametrize("wrong", [3, None, b"(quiet)", ["quiet"]])
def test_a_condition_that_is_not_text_is_refused(wrong) -> None:
    with pytest.raises(ParseError, match="a condition is written as text, not as"):
        parse_condition(wrong)


@pytest.mark.parametrize("name", ["cup\x1b", '"cup\n"'])
def test_names_have_no_control_characters(name: str) -> None:
    with pytest.raises(ParseError) as caught:
        read_domain(f"(define (domain d) (:constants {name}))")
    assert str(caught.value).startswith("<text>:1:32: 'cup\\")


EFFECTS = [
    ("(or (quiet))", "'or' is not an effect"),
    ("(not (not (quiet)))", "only a predicate can be deleted"),
    ("(increase (weight cup1))", r"\(increase \(FUNCTION ...\) NUMBER\)"),
    ("(increase ?weight 1)", "in parentheses"),
    ("(when ?quiet (heavy cup1))", r"compare it, as in \(= \?quiet true\)"),
    ("(when (quiet))", r"\(when CONDITION EFFECT\)"),
]


@pytest.mark.parametrize(("text", "message"), EFFECTS)
def test_effects(text: str, message: str) -> None:
    with pytest.raises(ParseError, match=message) as caught:
        parse_effect(text, "d.pddl")
    assert str(caught.value).startswith("d.pddl:1:")


DOMAINS = [
    # sections, kind, place, text of the message, nearest
    ("(:typos a)", ParseError, "1:21", "no section ':typos'", ":types"),
    ("(:durative-action a)", ParseError, "1:38", "how long", None),
    ("(:durative-action a :duration 3)", ParseError, "1:50", r"\(= \?duration SECONDS\)", None),
    ("(:durative-action a :duration (< ?duration 3))", ParseError, "1:50", r"\(<= \?duration SECONDS\)", None),
    ("(:durative-action a :precondition (p))", ParseError, "1:40", "a durative action has no part", ":condition"),
    ("(:durative-action a :duration () :condition (p))", ParseError, "1:64", "says when", None),
    ("(:durative-action a :duration () :effect (over all (p)))", ParseError, "1:61", "says when", None),
    ("(:derived p)", ParseError, "1:20", r"written \(:derived \(NAME", None),
    ("(:types a) (:types b)", ParseError, "1:31", "the first is at d:1:20", None),
    ("(:types cup - itm item)", SchemaError, "1:28", "unknown parent", "item"),
    ("(:types a - b b - a)", SchemaError, "1:28", "cycle: a - b - a", None),
    ("(:types b c - object a - b a - c)", SchemaError, "1:", "declared differently before", None),
    ("(:types a - (either b c) b c)", SchemaError, "1:28", "only one type", None),
    ("(:predicates (p ?x) (p ?x ?y))", SchemaError, "1:40", r"differently before: \(p .*\) \(at d:1:33\)", None),
    ("(:types c) (:predicates (p ?x - cc))", SchemaError, "1:47", "unknown type 'cc'", "c"),
    ("(:types number)", SchemaError, "1:28", "type of values", None),
    ("(:types object - a a)", SchemaError, "1:28", "all things", None),
    ("(:predicates p)", ParseError, "1:33", "in parentheses", None),
    ("(:predicates (p x))", ParseError, "1:36", r"begins with '\?'", None),
    ("(:predicates (p)) (:functions (p))", SchemaError, "1:50", "name of a predicate", None),
    ("(:functions (f) - item)", UnsupportedConstructError, "1:38", "values are things.*Tamer", None),
    ("(:process p)", UnsupportedConstructError, "1:20", "':process'.*ENHSP", None),
    ("(:constants a - cup)", SchemaError, "1:32", "unknown type 'cup'", None),
    ("(:constants 1)", ParseError, "1:32", "cannot be a name", None),
    ("(:action)", ParseError, "1:20", "an action has a name", None),
    ("(:action a :precondition)", ParseError, "1:31", "followed by nothing", None),
    ("(:action a :effects (p))", ParseError, "1:31", "no part ':effects'", ":effect"),
    (
        "(:action a) (:action A :effect (p))",
        SchemaError,
        "1:41",
        r"differently before \(at d:1:29\), with the effect",
        None,
    ),
    ("(:action a :parameters ?x)", ParseError, "1:43", "in parentheses", None),
]


@pytest.mark.parametrize(("text", "kind", "where", "message", "nearest"), DOMAINS, ids=[d[0] for d in DOMAINS])
def test_domains(text: str, kind: type[InputError], where: str, message: str, nearest: str | None) -> None:
    with pytest.raises(kind, match=message) as caught:
        Schema.parse(f"(define (domain d) {text})", "d")
    assert str(caught.value.place).startswith(f"d:{where}")
    if nearest is not None:
        assert caught.value.nearest == nearest


PROBLEMS = [
    ("(:objects cup1 - cupp)", UnknownNameError, "unknown|no type 'cupp'", "cup"),
    ("(:objects a - cup a - can)", SchemaError, "of type 'cup' already", None),
    ("(:objects home - cup)", SchemaError, "of type 'place' already", None),
    ("(:objects ?a - cup)", ParseError, "cannot be a name", None),
    ("(:init (quiett))", UnknownNameError, "no predicate", "quiet"),
    ("(:init (on cup1 home))", UnknownNameError, "no object 'cup1'", None),
    ("(:objects a b - cup) (:init (on a b))", SchemaError, "'b' is of type cup", None),
    ("(:objects a - cup) (:init (can a))", SchemaError, "say it in :objects", None),
    ("(:objects a - object) (:init (cup a))", SchemaError, "say it in :objects", None),
    ("(:init (= (time) (+ 1 1)))", ParseError, "':init' has facts", None),
    ("(:init (or (quiet)))", ParseError, "':init' has facts", None),
    ("(:init (and (oneof (quiet) (and))))", UnsupportedConstructError, "'oneof'.*contingent", None),
    ("(:init (at 5 (quiet)))", UnsupportedConstructError, "'at 5'.*temporal", None),
    ("(:goal (preference p (quiet)))", UnsupportedConstructError, "'preference'.*PDDL 3", None),
    ("(:metric minimise (time))", ParseError, "'minimise'", "minimize"),
    ("(:metric minimize (tmie))", UnknownNameError, "no function", "time"),
    ("(:goal (quiet) (quiet))", ParseError, "one goal", None),
    ("(:gaol (quiet))", ParseError, "no section", ":goal"),
    ("(:goal (exists (?x - cup) (on ?x hom)))", UnknownNameError, "no object 'hom'", "home"),
    ("(:goal (heavy ?x))", UnknownNameError, "not bound", None),
]


@pytest.mark.parametrize(("text", "kind", "message", "nearest"), PROBLEMS, ids=[p[0] for p in PROBLEMS])
def test_problems(text: str, kind: type[InputError], message: str, nearest: str | None) -> None:
    with pytest.raises(kind, match=message) as caught:
        read_problem(f"(define (problem p) (:domain small)\n {text})", SCHEMA, "p.pddl")
    assert str(caught.value.place).startswith("p.pddl:2:")
    if nearest is not None:
        assert caught.value.nearest == nearest


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty"),
        ("; nothing", "empty"),
        ("(domain d)", "begins with"),
        ("(define domain d)", "followed by"),
        ("(define (problem p))", "this defines a 'problem'$"),
        ("(define (domian p))", "did you mean 'domain'"),
        ("(define (domain))", "one name"),
        ("(define (domain d)) )", "without a"),
        ("(define (domain d)) (define (domain e))", "holds one"),
        ("(define (domain d) types)", "a section"),
    ],
)
def test_files_that_are_no_domain(text: str, message: str) -> None:
    with pytest.raises(ParseError, match=message) as caught:
        read_domain(text, "d.pddl")
    assert str(caught.value).startswith("d.pddl:1:")


def test_files_that_cannot_be_read(tmp_path) -> None:
    (tmp_path / "domain.pddl").write_bytes(b"(define\n\xff")
    with pytest.raises(InputError, match=r"did you mean 'domain.pddl'"):
        read_domain(tmp_path / "domian.pddl")
    with pytest.raises(ParseError, match=r"domain.pddl:2:1: this is not UTF-8"):
        read_domain(str(tmp_path / "domain.pddl"))
    with pytest.raises(InputError, match="cannot read"):
        read_domain(tmp_path)
    with pytest.raises(InputError, match="cannot read"):
        read_domain("a\0b")


def test_a_name_that_is_valid_twice_is_listed_once() -> None:
    error = InputError("no such thing", found="x", valid=["home", "shelf", "home"])
    assert str(error) == "no such thing; valid: home, shelf"


TELLS = [
    (Delta(nodes={"cup9": "cpu"}), UnknownNameError, "no type 'cpu'.*'cup'"),
    (Delta(nodes={"": "cup"}), InputError, "not empty"),
    (Delta(nodes={"cup1": "can"}), SchemaError, "of type 'cup' and cannot become"),
    (Delta(nodes={"n": "number"}), UnknownNameError, "no type"),
    (Delta(added=(fact("onn", "cup1", "shelf"),)), UnknownNameError, "'on'"),
    (Delta(added=(fact("cup", "cup1"),)), SchemaError, "'cup' is a type"),
    (Delta(added=(fact("on", "cup1"),)), SchemaError, "takes 2 arguments"),
    (Delta(added=(fact("on", "cup1", "shelv"),)), UnknownNameError, "'shelf'"),
    (Delta(added=(fact("on", "shelf", "cup1"),)), SchemaError, "'shelf' is of type place"),
    (Delta(added=(fact("on", 3, "shelf"),)), SchemaError, "not 3"),
    (Delta(added=(fact("level", "cup1", "high"),)), SchemaError, "not 'high'"),
    (Delta(removed=(fact("on", "cup9", "shelf"),)), UnknownNameError, "'cup1'|'cup2'"),
    (Delta(values={fact("weigth", "cup1"): 1}), UnknownNameError, "'weight'"),
    (Delta(values={fact("weight", "shelf"): 1}), SchemaError, "of type place"),
    (Delta(values={fact("time"): float("nan")}), InputError, "finite"),
    (Delta(values={fact("time"): True}), SchemaError, "not True"),
    (Delta(removed_nodes=("home",)), SchemaError, "constant"),
    (Delta(removed_nodes=("cup1",), added=(fact("heavy", "cup1"),)), UnknownNameError, "no object 'cup1'"),
    (Delta(replaced=(fact("onn", "cup1", "shelf"),)), UnknownNameError, "'on'"),
    (Delta(replaced=(fact("on", "cup1", "shelv"),)), UnknownNameError, "'shelf'"),
    (Delta(added=(fact("on", "cup1", ("a", "b")),)), SchemaError, r"not \('a', 'b'\)"),  # type: ignore[arg-type]
    (Delta(added=(fact("level", "cup1", float("inf")),)), InputError, "finite"),
    (Delta(values={fact("weight", "cup1", "cup2"): 1}), SchemaError, "takes 1 argument"),
    (Delta(values={fact("distance", "shelf", "hom"): 1}), UnknownNameError, "'home'"),
    (Delta(values={fact("time"): "late"}), SchemaError, "not 'late'"),
    (Delta(values={fact("time"): (1.0, 2.0)}), SchemaError, r"not \(1.0, 2.0\)"),
    (Delta(nodes={"home": "cup"}), SchemaError, "of type 'place' and cannot become"),
]


@pytest.mark.parametrize(("delta", "kind", "message"), TELLS, ids=[t[2] for t in TELLS])
def test_changes(kb, delta: Delta, kind: type[InputError], message: str) -> None:
    with pytest.raises(kind, match=message):
        kb.apply(delta, author="test")
    with pytest.raises(kind, match=message):
        _told_after_something_else(kb, delta)


def _told_after_something_else(kb, delta: Delta) -> None:
    """What came before the mistake goes with it."""
    with kb.transaction("test") as tx:
        tx.tell("heavy", "cup2")
        tx.apply(delta)


def test_transaction_verbs() -> None:
    kb = KnowledgeBase(SCHEMA)
    with kb.transaction(author="test") as tx:
        with pytest.raises(UnknownNameError, match="did you mean 'home'"):
            tx.remove_node("hom")
        with pytest.raises(InputError, match="content to set"):
            tx.set("time")
        with pytest.raises(SchemaError, match=r"\(time\) is a number, not 'now'"):
            tx.set("time", "now")
        with pytest.raises(UnknownNameError, match="no type"):
            kb.objects("cups")


@pytest.mark.parametrize(
    ("ask", "error", "said"),
    [
        (lambda kb: kb.holds("on", "cup1"), InputError, r"the arguments of 'on' are a tuple, e\.g\. \('cup1',\)"),
        (lambda kb: kb.match("on", "cup1"), InputError, "are a tuple"),
        (lambda kb: kb.holds("onn", ("cup1", "table")), UnknownNameError, "did you mean 'on'"),
        (lambda kb: kb.match("onn", (None,)), UnknownNameError, "did you mean 'on'"),
        (lambda kb: kb.estimate("onn", (None,)), UnknownNameError, "did you mean 'on'"),
        (lambda kb: kb.holds("on", ("cup1",)), SchemaError, "'on' has 2 arguments, not 1"),
        (lambda kb: kb.value("weight", ()), SchemaError, "'weight' has 1 argument, not 0"),
        (lambda kb: kb.value("wieght", ("cup1",)), UnknownNameError, "did you mean 'weight'"),
    ],
)
def test_a_wrong_question_about_facts_is_refused_instead_of_answered(ask, error, said):
    text = "(define (domain d) (:types item) (:predicates (on ?a ?b - item)) (:functions (weight ?i - item)))"
    kb = KnowledgeBase(Schema.parse(text))
    kb.apply(Delta(nodes={"cup1": "item", "table": "item"}, added=(fact("on", "cup1", "table"),)), "me")
    assert kb.holds("on", ("cup1", "table"))
    assert kb.holds("item", ("cup1",))
    assert kb.match("item", (None,)) == [("cup1",), ("table",)]
    assert not kb.holds("item", ("cup2",))
    with pytest.raises(error, match=said):
        ask(kb)
