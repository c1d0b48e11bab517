"""Computed predicates where plots ask: in candidates' conditions and guards, and refused where plots tell."""

from __future__ import annotations

import pytest
from dsc_charts import plot

from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.events import Event
from dsc.validation import validate_library
from knowledge_base import Delta, KnowledgeBase, Schema, computed, fact


@computed("(at-hand ?i - item)", reads=["(distance ?i)", "(hidden ?i)"])
def at_hand(distance: float, hidden: bool) -> bool:
    return distance < 1 and not hidden


SCHEMA = Schema.parse("""
    (define (domain kitchen)
      (:types item)
      (:predicates (hidden ?i - item))
      (:functions (distance ?i - item)))
""").with_computed(at_hand)

REACH = "{plot: reach, parameters: {item: item}, when: (at-hand ?item), states: {s: }}"
APPROACH = "{plot: approach, parameters: {item: item}, when: (not (at-hand ?item)), states: {s: }}"
HOLDER = """
    plot: fetch
    parameters: {item: item}
    receives: {nearer: , farther: }
    states:
      get:
        dynamic: [reach, approach]
        with: {item: ?item}
        on:
          nearer: {to: fine, when: (at-hand ?item), do: [{tell: (assign (distance ?item) 0)}]}
          farther: {to: far, when: (exists (?i - item) (not (at-hand ?i)))}
          no_candidate: far
          done: fine
      fine: {final: true}
      far: {final: true}
"""


@pytest.fixture
def kb():
    made = KnowledgeBase(SCHEMA)
    values = {fact("distance", "far_cup"): 3}
    made.apply(Delta(nodes={"cup": "item", "far_cup": "item"}, values=values), author="test")
    return made


def started(kb, item):
    library = Library([plot(text) for text in (HOLDER, REACH, APPROACH)])
    machine = Machine(library)
    return machine, library, machine.start("fetch", {"item": item}, KnowledgeSituation(kb, library))


@pytest.mark.parametrize(("item", "chosen"), [("cup", "reach"), ("far_cup", "approach")])
def test_a_candidates_condition_is_computed_and_the_record_shows_from_what(kb, item, chosen):
    (made,) = started(kb, item)[2].decisions
    assert made.decision.chosen == chosen
    distance = 0 if item == "cup" else 3
    why = f"(distance {item}) = {distance}, (hidden {item}) is false"
    assert why in made.decision.verdicts[0].reason


def test_guards_are_computed_from_the_world_as_it_is(kb):
    machine, library, _ = started(kb, "far_cup")
    machine.send(Event("nearer"), KnowledgeSituation(kb, library))
    assert machine.state.configuration() == ("get", "get/s")
    kb.apply(Delta(values={fact("distance", "far_cup"): 0.5}), author="test")
    machine.send(Event("nearer"), KnowledgeSituation(kb, library))
    assert machine.state.configuration() == ()  # it has ended


def findings(text):
    library = Library([plot(one) for one in (text, REACH, APPROACH)])
    return [str(f) for f in validate_library(library, SCHEMA, (), ()) if f.code in ("condition", "effect")]


def test_the_validator_knows_it():
    assert findings(HOLDER) == []
    (said,) = findings(HOLDER.replace("(assign (distance ?item) 0)", "(at-hand ?item)"))
    assert "'at-hand' is computed and has no facts" in said


def test_a_function_that_fails_says_so_in_the_run(kb):
    @computed("(at-hand ?i - item)", reads=["(distance ?i)"])
    def broken(distance: float) -> bool:
        return 1 / distance > 1

    plain = Schema(SCHEMA.types, SCHEMA.constants, SCHEMA.predicates, SCHEMA.functions)
    world = KnowledgeBase(plain.with_computed(broken))
    world.apply(Delta(nodes={"cup": "item"}), author="test")
    (error,) = started(world, "cup")[2].bugs
    assert "(at-hand cup) cannot be computed: ZeroDivisionError" in str(error)
