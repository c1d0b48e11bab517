"""Prepared questions: the same answers in the same order as each time by their text."""

from __future__ import annotations

import sys
import threading
from itertools import product
from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from kb_strategies import SCHEMA, THINGS, brute, deltas

from knowledge_base import Delta, InputError, KnowledgeBase, SchemaError, UnknownNameError, fact
from knowledge_base.language.evaluation.evaluator import query
from knowledge_base.language.syntax import expression as ex

ITEMS, PLACES = ("cup1", "cup2", "can1"), ("shelf", "home")


def _terms(constants, variables):
    return st.sampled_from([*map(ex.Variable, variables), *map(ex.Constant, constants)])


def _plain_parts() -> st.SearchStrategy[ex.Expression]:
    item, place = _terms(ITEMS, ("x", "y")), _terms(PLACES, ("p", "q"))
    number = _terms((1, 2.5), ("n",))
    atoms = st.one_of(
        st.builds(lambda *args: ex.Atom("on", args), item, place),
        st.builds(lambda *args: ex.Atom("near", args), place, place),
        st.builds(lambda *args: ex.Atom("between", args), item, item, place),
        st.builds(lambda *args: ex.Atom("level", args), item, number),
        st.builds(lambda arg: ex.Atom("heavy", (arg,)), item),
        st.builds(lambda kind, arg: ex.Atom(kind, (arg,)), st.sampled_from(("cup", "item", "object")), item),
        st.just(ex.Atom("quiet", ())),
    )
    equations = st.builds(ex.Comparison, st.sampled_from(("=", "!=")), item | number, item | number)
    return atoms | atoms | atoms | st.builds(ex.Not, atoms) | equations


def _bindings():
    values = {"x": ITEMS, "y": ITEMS, "p": PLACES, "q": PLACES, "n": (1, 2.5, True)}
    return st.fixed_dictionaries({}, optional={name: st.sampled_from(some) for name, some in values.items()})


START = Delta(THINGS, added=(fact("on", "cup1", "shelf"), fact("on", "cup2", "shelf"), fact("near", "home", "shelf")))


def _outcome(ask):
    try:
        return ask()
    except InputError as error:
        return type(error)


def _choices(names, world) -> list[dict[str, Any]]:
    """All values that the variables could have."""
    numbers = list(dict.fromkeys(number for _, number in world.match("level", (None, None))))
    values = {"x": THINGS, "y": THINGS, "p": PLACES, "q": PLACES, "n": numbers}
    return [dict(zip(names, choice, strict=True)) for choice in product(*(values[name] for name in names))]


@settings(max_examples=200)
@given(st.lists(_plain_parts(), min_size=1, max_size=5).map(tuple), _bindings(), st.lists(deltas(), max_size=3))
def test_a_question_is_answered_as_the_textbook_does_and_prepared_in_the_same_order(parts, params, changes) -> None:
    e = ex.And(parts)
    params = {name: value for name, value in params.items() if name in ex.free_variables(e)}
    kb = KnowledgeBase(SCHEMA)
    found = _outcome(lambda: kb.query(e, params))  # the text is checked once, on a world that may be another then
    assume(isinstance(found, list))
    prepared = kb.prepare(e, *params)
    others = sorted(ex.free_variables(e) - params.keys())
    for change in (START, *changes):
        kb.apply(change, "test")
        answers = kb.query(e, params)
        assert answers == query(e, kb.snapshot(), params) == prepared.query(*params.values())
        expected = [choice for choice in _choices(others, kb) if brute(e, kb, {**params, **choice})]
        assert sorted(map(_spelled, answers)) == sorted(map(_spelled, expected))
        if "n" not in others:  # no quantifier ranges over numbers
            some = ex.Exists(tuple(map(ex.TypedVariable, others)), e)
            assert kb.ask(some, params) == bool(expected)
        if not others:
            assert kb.ask(e, params) == prepared.ask(*params.values()) == bool(expected)


def _spelled(answer) -> list[tuple[str, str]]:
    return sorted((name, str(value)) for name, value in answer.items())


@pytest.fixture
def kb() -> KnowledgeBase:
    kb = KnowledgeBase(SCHEMA)
    kb.apply(START, "test")
    return kb


def test_a_prepared_question_takes_its_values_in_order(kb) -> None:
    on = kb.prepare("(on ?item ?place)", "place", "item")
    assert on.parameters == ("place", "item")
    assert on.ask("shelf", "cup1")
    assert not on.ask("home", "cup1")
    assert on.query("shelf", "cup1") == [{}]
    below = kb.prepare("(on ?item ?place)", "Place")
    assert below.query("shelf") == [{"item": "cup1"}, {"item": "cup2"}]
    kb.apply(Delta(removed=(fact("on", "cup1", "shelf"), fact("on", "cup2", "shelf"))), "test")
    assert below.query("shelf") == []
    heavy = kb.prepare("(and (on ?x ?p) (> (weight ?x) ?least))", "least")
    kb.apply(Delta(added=(fact("on", "can1", "home"),), values={fact("weight", "can1"): 3}), "test")
    assert heavy.query(2) == [{"x": "can1", "p": "home"}]
    assert heavy.query(3) == []


def test_a_prepared_question_says_what_is_wrong(kb) -> None:
    with pytest.raises(UnknownNameError, match="no free variable '\\?plaec'") as caught:
        kb.prepare("(on ?item ?place)", "plaec")
    assert caught.value.found == "?plaec"
    assert "?place" in caught.value.valid
    with pytest.raises(UnknownNameError, match="'onn'"):
        kb.prepare("(onn ?item ?place)")
    with pytest.raises(InputError, match="named once each"):
        kb.prepare("(on ?item ?place)", "item", "item")
    below = kb.prepare("(on ?item ?place)", "place")
    with pytest.raises(UnknownNameError, match="'\\?item' is not bound"):
        below.ask("shelf")
    with pytest.raises(InputError, match="'\\?place' is a name, a number or a truth value, not None"):
        below.query(None)
    heavy = kb.prepare("(and (on ?x ?p) (> (weight ?x) ?least))", "p", "least")
    for ask, values in (
        (below.query, ()),
        (below.query, ("shelf", 1)),
        (heavy.query, ("shelf",)),
        (kb.prepare("(quiet)").ask, (1,)),
    ):
        with pytest.raises(InputError, match=f"takes the values of its parameters .*, not {len(values)} values"):
            ask(*values)
    with pytest.raises(SchemaError, match="cannot be a geometry"):
        below.query((1.0, 2.0))
    with pytest.raises(InputError, match="'\\?place' is a name, a number or a truth value, not \\['shelf'\\]"):
        kb.ask("(quiet)", {}) or kb.query("(on ?item ?place)", {"place": ["shelf"]})


@pytest.mark.parametrize("text", ["(on cup1 shelf)", "(forall (?x - cup) (on ?x shelf))", "(= (weight cup1) 0)"])
def test_others_ask_while_a_transaction_prepares_a_change(kb, text: str) -> None:
    answers = []
    with kb.transaction("slow") as tx:
        tx.retract("on", "cup1", "shelf")
        tx.set("weight", "cup1", 2)
        reader = threading.Thread(target=lambda: answers.append(kb.ask(text)))
        reader.start()
        reader.join(10)
        assert answers == [True]
    assert not kb.ask(text)


def test_an_answer_is_of_one_version(kb) -> None:
    """A cup is on one place or the other at every version; a mixture of two would show neither or both."""
    kb.apply(Delta(added=(fact("heavy", "cup2"),)), "test")
    somewhere = kb.prepare("(and (not (on ?x shelf)) (not (on ?x home)))", "x").ask
    twice = kb.prepare("(and (on ?x shelf) (on ?x home))", "x").ask
    where = kb.prepare("(on ?x ?where)", "x").query
    beside = kb.prepare("(and (heavy ?y) (on ?x ?p) (on ?y ?p) (!= ?x ?y))", "x").query
    to = {"home": "shelf", "shelf": "home"}
    stop = threading.Event()

    def write() -> None:
        at = "shelf"
        while not stop.is_set():
            kb.apply(Delta(removed=(fact("on", "cup1", at),), added=(fact("on", "cup1", to[at]),)), "writer")
            at = to[at]

    writer = threading.Thread(target=write)
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        writer.start()
        while kb.version < 3000:
            assert not somewhere("cup1")
            assert not twice("cup1")
            assert len(where("cup1")) == 1
            assert beside("cup1") in ([], [{"y": "cup2", "p": "shelf"}])
    finally:
        stop.set()
        writer.join()
        sys.setswitchinterval(interval)
