"""How a query will run: what is said is what the search then does."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from kb_strategies import SCHEMA, THINGS, deltas
from kb_worlds import PROPERTY

from knowledge_base import Delta, InputError, KnowledgeBase, Schema, computed
from knowledge_base.language.checking.binding import only_tested
from knowledge_base.language.evaluation.evaluator import query
from knowledge_base.language.evaluation.query_plan import plan_query
from knowledge_base.language.syntax import expression as ex
from knowledge_base.world.overlay import Overlay
from knowledge_base.world.state import WorldState


@computed("(warm ?t - thing)", reads=["(temperature ?t)"])
def warm(temperature: float) -> bool:
    return temperature > 30


@pytest.fixture
def kb() -> KnowledgeBase:
    schema = Schema.parse("""(define (domain kitchen)
        (:types thing place - object cup can - thing)
        (:predicates (on ?t - thing ?p - place) (clean ?t - thing) (red ?t - thing))
        (:functions (temperature ?t - thing)))""").with_computed(warm)
    made = KnowledgeBase(schema)
    with made.transaction(author="test") as world:
        world.add_node("table", "place")
        world.add_node("shelf", "place")
        for number in range(5):
            world.add_node(f"cup{number}", "cup")
            world.tell("on", f"cup{number}", "table")
        world.tell("clean", "cup3")
        world.tell("on", "cup3", "shelf")
    return made


def lines(plan) -> list[str]:
    return [str(step) for step in plan.steps]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("(on cup1 table)", ["test (on cup1 table)"]),
        ("(on ?t ?p)", ["scan (on ?t ?p): finds ?t ?p, at most 6 matches"]),
        ("(on ?t ?where)", ["look up (on ?t shelf) by shelf: finds ?t, at most 1 match"]),
        ("(and)", []),
        ("(cup ?c)", ["things (cup ?c): finds ?c, at most 5 matches"]),
        ("(and (cup ?c) (not (clean ?c)))", ["things (cup ?c): finds ?c, at most 5 matches", "test (not (clean ?c))"]),
        (
            "(and (cup ?c) (warm ?c) (< (temperature ?c) 50))",
            ["things (cup ?c): finds ?c, at most 5 matches", "test (< (temperature ?c) 50)", "computed (warm ?c)"],
        ),
        ("(or (clean ?t) (red ?t))", ["alternatives (or (clean ?t) (red ?t)): finds ?t"]),
        (
            "(exists (?p - place) (on ?t ?p))",
            ["witnesses (exists (?p - place) (on ?t ?p)): finds ?t"],
        ),
        (
            "(and (not (= ?a ?b)) (on ?a ?p) (on ?b ?p) (clean ?a))",
            [
                "scan (clean ?a): finds ?a, at most 1 match",
                "look up (on ?a ?p) by ?a: finds ?p, at most 2 matches, decided while running",
                "look up (on ?b ?p) by ?p: finds ?b, at most 5 matches, decided while running",
                "test (not (= ?a ?b)): decided while running",
            ],
        ),
        (
            "(and (red ?a) (on ?a ?p) (clean ?a))",
            [
                "scan (red ?a): finds ?a, at most 0 matches",
                "test (clean ?a): not reached",
                "look up (on ?a ?p) by ?a: finds ?p, not reached",
            ],
        ),
    ],
)
def test_the_steps(kb, text, expected) -> None:
    params = {"where": "shelf"} if "?where" in text else {}
    assert lines(kb.explain_query(text, params)) == expected


def test_the_order_is_that_of_the_world_as_it_is(kb) -> None:
    text = "(and (clean ?t) (red ?t))"
    assert lines(kb.explain_query(text))[0].startswith("scan (red ?t)")
    with kb.transaction(author="test") as world:
        world.tell("red", "cup1")
        world.tell("red", "cup2")
    assert lines(kb.explain_query(text))[0].startswith("scan (clean ?t)")
    assert lines(kb.at(version=1).explain_query(text))[0].startswith("scan (red ?t)")


def test_it_reads_well_and_is_plain_data(kb) -> None:
    plan = kb.explain_query("(and (on ?t ?p) (warm ?t))", {"p": "shelf"})
    assert str(plan).splitlines() == [
        "(and (on ?t shelf) (warm ?t))",
        "  1. look up (on ?t shelf) by shelf: finds ?t, at most 1 match",
        "  2. computed (warm ?t)",
    ]
    assert plan.answers == ("t",)
    data = json.loads(json.dumps(plan.to_json()))
    assert [step["kind"] for step in data["steps"]] == ["look up", "computed"]


def test_errors_are_those_of_the_query(kb) -> None:
    with pytest.raises(InputError, match=r"did you mean 'clean'"):
        kb.explain_query("(cleen ?t)")
    with pytest.raises(InputError, match=r"occurs only under 'not'"):
        kb.explain_query("(not (clean ?t))")


# --- what is said is what is done


class Asked:
    """A world that writes down which facts are looked for."""

    def __init__(self, world) -> None:
        self._world = world
        self.matched: list[Any] = []

    def __getattr__(self, name: str):
        return getattr(self._world, name)

    def match(self, predicate, pattern):
        self.matched.append((predicate, tuple(value is not None for value in pattern)))
        return self._world.match(predicate, pattern)


def flat_queries() -> st.SearchStrategy[ex.Expression]:
    term = st.sampled_from([ex.Variable(n) for n in "xyz"] + [ex.Constant(t) for t in THINGS])
    arities = {"heavy": 1, "on": 2, "near": 2, "between": 3}
    atoms = st.sampled_from(sorted(arities)).flatmap(
        lambda p: st.builds(ex.Atom, st.just(p), st.tuples(*[term] * arities[p]))
    )
    negated = st.builds(ex.Not, atoms)
    return st.lists(atoms | atoms | negated, min_size=1, max_size=5).map(lambda parts: ex.And(tuple(parts)))


@PROPERTY
@given(flat_queries(), deltas(), deltas())
def test_the_search_looks_up_what_was_said_in_that_order(e, before, more) -> None:
    assume(not only_tested(e, SCHEMA))
    world = Overlay(WorldState(SCHEMA))
    world.apply(before.then(Delta(added=more.added)))
    plan = plan_query(e, world)
    said = [
        (ex.Atom, step.text.strip("()").split()[0], len(step.by))
        for step in plan.steps
        if step.kind in ("look up", "scan") and step.reached
    ]
    asked = Asked(world)
    query(e, asked)
    done = [(ex.Atom, predicate, sum(known)) for predicate, known in asked.matched]
    assert done[: len(said)] == said
    assert {name for step in plan.steps for name in step.finds} == set(plan.answers)
