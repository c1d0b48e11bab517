"""Functional predicates, and replacing a fact by another: one step, whatever was true before."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kb_strategies import SCHEMA, THINGS, deltas
from kb_worlds import PROPERTY

from knowledge_base import (
    Delta,
    InputError,
    KnowledgeBase,
    Schema,
    SchemaError,
    SchemaMismatchError,
    UnknownNameError,
    exchange,
    fact,
)

TEXT = """(define (domain house) (:types item place)
  (:predicates (robot-at ?p - place) (at ?i - item ?p - place) (between ?i - item ?a ?b - place) (quiet)))"""
OPEN = Schema.parse(TEXT)
HOUSE = OPEN.with_functional("robot-at", "at")
NODES = {"cup": "item", "can": "item", "hall": "place", "kitchen": "place", "yard": "place"}


@pytest.fixture(params=[HOUSE, OPEN.with_functional("robot-at")], ids=["functional", "any"])
def kb(request):
    return house(request.param)


def house(schema) -> KnowledgeBase:
    kb = KnowledgeBase(schema)
    start = (fact("robot-at", "hall"), fact("at", "cup", "hall"), fact("at", "can", "hall"))
    kb.apply(Delta(nodes=NODES, added=start), author="test")
    return kb


def test_a_replacement_takes_the_place_of_all_that_differ_in_the_last_argument_only(kb):
    with kb.transaction(author="test") as tx:
        tx.replace("robot-at", "kitchen")
        tx.replace("at", "cup", "kitchen")
        tx.replace("between", "cup", "hall", "yard")
        assert tx.ask("(at cup kitchen)")
        assert not tx.ask("(at cup hall)")
    assert tx.change.delta == Delta(
        removed=(fact("robot-at", "hall"), fact("at", "cup", "hall")),
        added=(fact("robot-at", "kitchen"), fact("at", "cup", "kitchen"), fact("between", "cup", "hall", "yard")),
    )
    assert kb.query("(at ?i ?p)") == [{"i": "can", "p": "hall"}, {"i": "cup", "p": "kitchen"}]


def test_several_facts_are_replaced_by_one():
    kb = house(OPEN)
    kb.apply(Delta(added=(fact("at", "cup", "yard"), fact("at", "cup", "kitchen"))), author="test")
    change = kb.apply(Delta(replaced=(fact("at", "cup", "yard"),)), author="test")
    assert change.delta == Delta(removed=(fact("at", "cup", "hall"), fact("at", "cup", "kitchen")))


def test_a_replacement_by_what_is_true_alone_changes_nothing(kb):
    assert not kb.apply(Delta(replaced=(fact("at", "cup", "hall"),)), author="test").delta
    assert kb.version == 1


def test_conditions_see_one_step(kb):
    told: list[Any] = []
    kb.install("(exists (?p - place) (at cup ?p))").subscribe(told.append, falls=True)
    moved = kb.install("(at cup yard)")
    moved.subscribe(lambda firing: told.append(firing.version))
    kb.apply(Delta(replaced=(fact("at", "cup", "yard"),)), author="test")
    assert told == [2]


SECOND = [
    Delta(added=(fact("at", "cup", "kitchen"),)),
    Delta(added=(fact("robot-at", "kitchen"),)),
    Delta(added=(fact("at", "cup", "kitchen"), fact("at", "cup", "yard")), removed=(fact("at", "cup", "hall"),)),
    Delta(added=(fact("at", "cup", "kitchen"),), replaced=(fact("at", "cup", "yard"),)),
    Delta(added=(fact("at", "cup", "kitchen"), fact("at", "cup", "hall"))),
]


@pytest.mark.parametrize("delta", SECOND)
def test_a_second_fact_is_refused_and_names_both(delta):
    kb = house(HOUSE)
    with pytest.raises(
        SchemaError, match=r"\((robot-)?at .*\) and \((robot-)?at .*\) cannot both be true.*use replace"
    ):
        kb.apply(delta, author="test")
    assert kb.version == 1
    assert house(OPEN).apply(delta, author="test").version == 2


@pytest.mark.parametrize(
    "delta",
    [
        Delta(added=(fact("at", "cup", "kitchen"),), removed=(fact("at", "cup", "hall"),)),
        Delta(added=(fact("at", "cup", "hall"),)),
        Delta(added=(fact("at", "cup", "kitchen"),), removed_nodes=("cup",), nodes={"cup": "item"}),
        Delta(added=(fact("at", "cup", "kitchen"),), removed_nodes=("hall",)),
        Delta(added=(fact("at", "cup", "kitchen"),), replaced=(fact("at", "cup", "kitchen"),)),
    ],
)
def test_a_change_that_leaves_one_fact_is_fine(delta):
    kb = house(HOUSE)
    kb.apply(delta, author="test")
    assert len(kb.match("at", ("cup", None))) == 1


@pytest.mark.parametrize(
    ("delta", "kind", "message"),
    [
        (Delta(replaced=(fact("at", "cup", "hall"), fact("at", "cup", "yard"))), SchemaError, r"\(at cup hall\) and \(at cup yard\) are two replacements"),
        (Delta(replaced=(fact("quiet"),)), SchemaError, r"\(quiet\) has no argument that could be replaced"),
        (Delta(replaced=(fact("att", "cup", "hall"),)), UnknownNameError, "did you mean 'at'"),
        (Delta(replaced=(fact("at", "cup"),)), SchemaError, "takes 2 arguments"),
        (Delta(replaced=(fact("at", "cup", "can"),)), SchemaError, "'can' is of type item"),
        (Delta(replaced=(fact("at", "cup", "hal"),)), UnknownNameError, "did you mean 'hall'"),
    ],
)  # fmt: skip
def test_bad_replacements(kb, delta, kind, message):
    with pytest.raises(kind, match=message):
        kb.apply(delta, author="test")
    assert kb.version == 1


@pytest.mark.parametrize(
    ("name", "kind", "message"),
    [
        ("att", UnknownNameError, "did you mean 'at'"),
        ("quiet", SchemaError, "'quiet' has no argument that others could settle"),
    ],
)
def test_a_predicate_that_is_unknown_or_without_arguments_cannot_be_functional(name, kind, message):
    with pytest.raises(kind, match=message):
        OPEN.with_functional(name)


def test_functional_predicates_are_kept_in_stores_and_copies(tmp_path):
    path = tmp_path / "world.kb"
    with KnowledgeBase.open(HOUSE, path) as kb:
        kb.apply(Delta(nodes=NODES, added=(fact("at", "cup", "hall"),)), author="test")
        copy = KnowledgeBase.from_json(kb.to_json())
    for again in (KnowledgeBase.open(None, path), copy):
        with again, pytest.raises(SchemaError, match="use replace"):
            again.apply(SECOND[0], author="test")
    with pytest.raises(SchemaMismatchError, match=r"the predicate 'at' was functional, now it is not; .*'robot-at'"):
        KnowledgeBase.open(OPEN, path)
    assert OPEN.merged(HOUSE).functional == {"at", "robot-at"}
    assert exchange.schema_hash(OPEN) != exchange.schema_hash(HOUSE)


def test_a_world_that_says_two_things_is_not_made_functional(tmp_path):
    path = tmp_path / "world.kb"
    with KnowledgeBase.open(OPEN, path) as kb:
        kb.apply(Delta(nodes=NODES, added=(fact("robot-at", "yard"),)), author="test")
    with KnowledgeBase.open(OPEN.with_functional("robot-at"), path) as kb:
        kb.apply(Delta(added=(fact("at", "cup", "hall"), fact("at", "cup", "yard"))), author="test")
        text = kb.to_json()
    for open_it in (lambda: KnowledgeBase.open(HOUSE, path), lambda: KnowledgeBase.from_json(text, HOUSE)):
        with pytest.raises(SchemaError, match=r"\(at cup \w+\) and \(at cup \w+\) cannot both be true"):
            open_it()


@PROPERTY
@given(st.lists(deltas(), max_size=5))
def test_a_functional_predicate_never_says_two_things(changes):
    kb = KnowledgeBase(SCHEMA.with_functional("on", "near"))
    kb.apply(Delta(nodes=THINGS), author="test")
    for change in changes:
        before = kb.facts()
        try:
            kb.apply(change, author="test")
        except InputError:
            assert kb.facts() == before
    for predicate in ("on", "near"):
        firsts = [args[0] for args in kb.match(predicate, (None, None))]
        assert len(firsts) == len(set(firsts))
