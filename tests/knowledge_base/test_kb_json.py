"""Worlds as JSON: nothing is lost on the way out and back, and what is wrong is named."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kb_strategies import SCHEMA, THINGS, deltas, removals
from kb_worlds import PROPERTY, everything

from knowledge_base import Delta, Fact, InputError, KnowledgeBase, Schema, exchange, fact
from knowledge_base.facts import Value


@PROPERTY
@given(st.lists(deltas() | removals(), max_size=4))
def test_a_world_survives_json(changes):
    kb = KnowledgeBase(SCHEMA)
    for change in changes:
        kb.apply(Delta(nodes=THINGS), author="test")
        kb.apply(change, author="test")
    again = KnowledgeBase.from_json(kb.to_json())
    assert everything(again) == everything(kb)
    assert again.to_json() == kb.to_json()
    assert exchange.schema_hash(again.schema) == exchange.schema_hash(SCHEMA)


@PROPERTY
@given(deltas() | removals())
def test_a_change_survives_json(change):
    assert repr(exchange.delta_of(json.loads(exchange.compact(exchange.delta_form(change))))) == repr(change)


def test_kinds_of_values_are_told_apart():
    schema = Schema.parse("(define (domain d) (:predicates (said ?v - (either number boolean text))))")
    kb = KnowledgeBase(schema)
    values: list[Value] = [1, 2.0, False, "1", "true", "ü", 1e-300, 2**53 + 1]
    kb.apply(Delta(added=tuple(fact("said", v) for v in values)), author="test")
    again = KnowledgeBase.from_json(kb.to_json())
    assert repr(again.facts()) == repr(kb.facts())


def test_it_goes_on_from_the_version_it_was_written_at():
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(added=(Fact("quiet"),)), author="a")
    again = KnowledgeBase.from_json(kb.to_json())
    assert again.apply(Delta(removed=(Fact("quiet"),)), author="b").version == 2
    assert again.at(version=1).ask("(quiet)")
    with pytest.raises(InputError, match="version 0 is no longer kept"):
        again.at(version=0)


def test_a_past_world_is_written_too():
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(nodes=THINGS), author="a")
    kb.apply(Delta(added=(Fact("quiet"),)), author="a")
    past = KnowledgeBase.from_json(kb.at(version=1).to_json())
    assert (past.version, past.ask("(quiet)"), past.nodes()) == (1, False, kb.nodes())


def test_a_file_is_read_with_more_declarations(tmp_path):
    path = tmp_path / "world.json"
    path.write_text(KnowledgeBase(Schema.parse("(define (domain d) (:types cup))")).to_json())
    kb = KnowledgeBase.from_json(path, Schema.parse("(define (domain d) (:types cup) (:constants best - cup))"))
    assert kb.objects("cup") == ["best"]


def world(**changed) -> str:
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(nodes=THINGS, added=(fact("on", "cup1", "shelf"),), values={fact("weight", "cup1"): 1}), author="a")
    said = json.loads(kb.to_json())
    said.update(changed)
    return json.dumps({part: value for part, value in said.items() if value is not ...})


BAD = {
    "empty": ("", "world.json:1:1: this is not JSON"),
    "no JSON": ("{\n 'format': 1}", "world.json:2:2: this is not JSON"),
    "list": ("[]", "a world in JSON is an object with"),
    "too deep": ("[" * 100_000, "not JSON that can be read"),
    "too long a number": ("1" * 10_000, "not JSON that can be read"),
    "other format": (world(format="x"), 'an object with "format": "dsc-knowledge/2"'),
    "missing part": (world(facts=...), "the part 'facts' is missing"),
    "unknown part": (world(fact=[]), "no part 'fact'; did you mean 'facts'?"),
    "twice": ('{"format": 1, "format": 2}', "'format' is there twice in one object"),
    "not a number": (world().replace("1]]", "NaN]]"), "NaN is not a number"),
    "infinite": (world().replace("1]]", "1e999]]"), "(weight cup1) is a finite number, not inf"),
    "version": (world(version=-1), "'version' is a whole number from 0, not -1"),
    "version of truth": (world(version=True), "'version' is a whole number from 0, not True"),
    "schema": (world(schema=[1]), "'schema' does not have the form"),
    "changed schema": (world(schema={"types": {}, "constants": {}, "predicates": {}, "functions": {}, "functional": []}), "'schema_hash' is not that"),
    "nodes": (world(nodes=["cup1"]), "'nodes' is an object"),
    "type": (world(nodes={"home": "place", "cup1": "cupp"}), "there is no type 'cupp'; did you mean 'cup'?"),
    "type is a number": (world(nodes={"cup1": 3}), "there is no type '3'"),
    "constant": (world(nodes={"home": "cup"}, facts=[], values=[]), "the constant 'home' is an object of type 'cup' there, not 'place'"),
    "facts": (world(facts={}), "'facts' is a list"),
    "fact": (world(facts=[["quiet"], 7]), 'facts[1] is of the form ["NAME", ARGUMENT...], not 7'),
    "fact without name": (world(facts=[[]]), "facts[0] is of the form"),
    "fact with a list": (world(facts=[["quiet", []]]), "facts[0] is of the form"),
    "fact with null": (world(facts=[["quiet", None]]), "facts[0] is of the form"),
    "predicate": (world(facts=[["onn", "cup1", "shelf"]]), "there is no predicate 'onn'; did you mean 'on'?"),
    "object": (world(facts=[["on", "cup9", "shelf"]]), "there is no object 'cup9', used in (on cup9 shelf); did you mean 'cup"),
    "arity": (world(facts=[["on", "cup1"]]), "on"),
    "value": (world(values=[["weight"]]), 'values[0] is of the form ["NAME", ARGUMENT..., CONTENT]'),
    "value is text": (world(values=[["weight", "cup1", "heavy"]]), "(weight cup1) is a number, not 'heavy'"),
    "function": (world(values=[["wait", "cup1", 1]]), "there is no function 'wait'"),
}  # fmt: skip


@pytest.mark.parametrize("kind", BAD)
def test_an_invalid_json_world_is_refused_with_its_file_and_the_reason(tmp_path, kind):
    text, message = BAD[kind]
    path = tmp_path / "world.json"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        KnowledgeBase.from_json(path)
    assert message in str(caught.value)
    assert "world.json" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("number", [float("nan"), float("inf"), 10**400])
def test_a_number_that_no_text_can_hold_is_no_argument(number):
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(nodes=THINGS), author="a")
    for bad in (Delta(added=(fact("level", "cup1", number),)), Delta(values={Fact("time"): number})):
        with pytest.raises(InputError, match=r"finite|at most"):
            kb.apply(bad, author="a")
    assert kb.version == 1
