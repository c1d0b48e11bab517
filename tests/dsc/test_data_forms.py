"""Conditions, terms and effects that read lists, maps, records and optional values (S2.21)."""

from __future__ import annotations

from typing import Any

import pytest

from dsc import ActionPlot, Library, LoopClock, Sequencer, parse_plot, validate_plot
from dsc.errors import PlotError
from dsc.model.data_forms import Values, plain_condition, reads_data
from dsc.sequencer.clock import run_simulated
from knowledge_base import Delta, InputError, KnowledgeBase, Schema, fact
from knowledge_base.language.syntax.text import parse_condition, to_text
from planning import PlanningDomain

DOMAIN = """(define (domain d) (:types item place) (:constants a b c - item table - place)
  (:predicates (seen ?i - item) (in ?i - item ?p - place)) (:functions (size ?i - item)))"""
SCHEMA = Schema.parse(DOMAIN)
FOUND = [{"item": "a", "score": 0.9, "tags": ["red", "big"]}, {"item": "b", "score": 0.2, "tags": [], "pose": [1, 2]}]
PLOT = """
plot: p
types:
  find: {{item: item, score: number, tags: list of text, pose: optional geometry}}
parameters:
  found: list of find
  names: {{type: list of item, default: [a, b]}}
  places: {{type: map of number, default: {{table: 3, shelf: 1}}}}
  hand: optional left | right
  one: {{type: item, default: b}}
outputs: {{yes: {{type: boolean, initial: false}}, out: {{type: any, initial: none}}}}
states:
  start:
    choice:
      - {{to: over, when: '{when}', assign: {{yes: true, out: {out}}}, tell: '{tell}'}}
      - {{to: over, assign: {{yes: false}}}}
  over: {{final: true}}
"""


def plot(when: str = "(and)", out: str = "none", tell: str = "(and)") -> ActionPlot:
    return parse_plot(PLOT.format(when=when, out=out, tell=tell))


def run(made: ActionPlot, **arguments: Any) -> tuple[Any, Any, list[str]]:
    """Return the two outputs and the objects that are seen; raise the first problem."""

    async def main() -> tuple[Any, Any, list[str]]:
        knowledge = KnowledgeBase(SCHEMA)
        knowledge.apply(Delta(added=(fact("in", "c", "table"),)), "test")
        found = validate_plot(made, Library([made]), SCHEMA)
        if found:
            raise PlotError(found)
        sequencer = Sequencer(Library([made]), knowledge, [], LoopClock())
        end = await sequencer.run("p", {"found": FOUND, **arguments})
        if end.problem is not None:
            raise InputError(end.problem)
        return end.outputs["yes"], end.outputs["out"], sorted(str(one["i"]) for one in knowledge.query("(seen ?i)"))

    return run_simulated(main())


@pytest.mark.parametrize(
    ("when", "holds"),
    [
        ("(> ?found.0.score 0.5)", True),
        ("(> ?found.1.score 0.5)", False),
        ("(= ?found.0.item a)", True),
        ("(= ?found.0.tags.1 \"big\")", True),
        ("(= (size ?found) 2)", True),
        ("(= (size ?found.0.tags) 2)", True),
        ("(> (+ (size ?names) (size ?places)) 3)", True),
        ("(in ?one ?names)", True),
        ("(in c ?names)", False),
        ("(in shelf ?places)", True),
        ("(in c table)", True),
        ("(= ?places.table 3)", True),
        ("(is-set ?hand)", False),
        ("(is-set ?found.1.pose)", True),
        ("(not (is-set ?found.0.pose))", True),
        ("(exists (?f - ?found) (> ?f.score 0.5))", True),
        ("(forall (?f - ?found) (> ?f.score 0.5))", False),
        ("(forall (?f - ?found) (imply (> ?f.score 0.5) (= ?f.item a)))", True),
        ("(exists (?f - ?found) (exists (?t - ?f.tags) (= ?t \"red\")))", True),
        ("(exists (?f - ?found ?n - ?names) (and (= ?f.item ?n) (< ?f.score 0.5)))", True),
        ("(exists (?i - item ?n - ?names) (and (in ?i table) (= ?n ?one)))", True),
        ("(exists (?i - item) (and (in ?i ?names) (in ?i table)))", False),
        ("(exists (?place - ?places) (= ?place shelf))", True),
        ("(and (forall (?x - ?names) (in ?x ?names)) (exists (?x - ?found) (> ?x.score 0.5)))", True),
    ],
)  # fmt: skip
def test_a_condition_reads_parts_of_data(when, holds):
    assert run(plot(when.replace("'", "''")))[0] is holds


def test_a_given_optional_value_is_set():
    assert run(plot("(and (is-set ?hand) (= ?hand left))"), hand="left")[0] is True


@pytest.mark.parametrize(
    ("out", "value"),
    [
        ("?found.1.item", "b"),
        ("?found.0", FOUND[0]),
        ("?found.0.pose", None),
        ("(size ?found)", 2),
        ("(+ ?found.0.score (size ?names))", 2.9),
        ("[?one, ?found.0.item]", ["b", "a"]),
        ("{item: ?one, score: (+ 0.1 ?places.shelf)}", {"item": "b", "score": 1.1}),
        ("[]", []),
    ],
)
def test_a_term_reads_and_builds_data(out, value):
    assert run(plot(out=out))[1] == value


def test_an_effect_goes_through_a_list():
    assert run(plot(tell="(forall (?f - ?found) (when (> ?f.score 0.5) (seen ?f.item)))"))[2] == ["a"]
    assert run(plot(tell="(and (seen ?found.1.item) (forall (?n - ?names) (seen ?n)))"))[2] == ["a", "b"]


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({"when": "(> ?found.0.scor 1)"}, "'?found.0' is of type find, and has no part 'scor'; did you mean 'score'?"),
        ({"when": "(> ?found.0.item 1)"}, "'>' works on numbers"),
        ({"when": "(seen ?found)"}, "'?found' is of type list of find, and a condition reads its parts"),
        ({"when": "(seen ?found.0)"}, "'?found.0' is of type find, and a condition reads its parts"),
        ({"when": "(exists (?o - ?one) (seen ?o))"}, "'?one' is of type item, and has no elements"),
        ({"when": "(exists (?o - ?foun) (seen ?o))"}, "did you mean '?found'?"),
        ({"when": "(forall (?f - ?found) (seen ?f.score))"}, "'?f.score' is of type number, but '?i' of 'seen'"),
        ({"out": "?found.0.scor"}, "has no part 'scor'"),
        ({"out": "(+ ?found.0.item 1)"}, "'+' works on numbers"),
        ({"tell": "(forall (?f - ?found) (seen ?f.score))"}, "'?f.score' is of type number"),
        ({"tell": "(seen ?found)"}, "a condition reads its parts"),
    ],
)
def test_a_mistake_is_found_before_the_run(parts, said):
    with pytest.raises(PlotError) as caught:
        run(plot(**parts))
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({"when": "(> ?found.7.score 0)"}, "'?found' has 2 elements, and no part '7'"),
        ({"when": "(= ?found.0.pose.0 0)"}, "'?found.0.pose.0' has no value"),
        ({"when": "(= ?places.cellar 0)"}, "'?places.cellar' has no value"),
    ],
)
def test_a_missing_part_is_an_error_of_the_state(parts, said):
    with pytest.raises(InputError) as caught:
        run(plot(**parts))
    assert said in str(caught.value)


def test_a_plot_with_these_forms_is_equal_after_its_written_form():
    made = plot("(exists (?f - ?found) (in ?f.item ?names))", "[{item: ?one, tags: [a, 'B c']}, 3]")
    assert ActionPlot.model_validate(made.to_form()) == made


def test_plain_conditions_are_not_changed():
    condition = parse_condition("(exists (?i - item) (and (seen ?i) (= ?event.item ?i)))")
    assert not reads_data(condition)


def test_a_form_is_replaced_by_a_plain_condition():
    condition = parse_condition("(forall (?f - ?found) (or (seen ?f.item) (in ?f.item ?names)))")
    plain = plain_condition(condition, Values({"found": FOUND, "names": ["a"]}))
    assert to_text(plain) == '(and (or (seen "a") (or (= "a" "a"))) (or (seen "b") (or (= "b" "a"))))'


@pytest.mark.parametrize("where", [":precondition (forall (?o - ?found) (seen ?o)) :effect (seen a)", ":effect (forall (?o - ?found) (seen ?o))"])  # fmt: skip
def test_a_planning_domain_has_no_lists(where):
    with pytest.raises(InputError, match="'\\?found' would be a list, which only plots have"):
        PlanningDomain.parse(DOMAIN[:-1] + f" (:action look :parameters () {where}))")


USED = """
plot: used
types: {order: {item: item, places: list of place}}
parameters: {order: order}
states: {s: {after: {seconds: 1, to: e}}, e: {final: true}}
"""
RULED = """
plot: ruled
types: {{order: {{item: item, places: list of place}}}}
variables: {{mine: {{type: order, initial: {{item: a, places: [table]}}}}, other: {{type: item, initial: b}}}}
states:
  step: {{use: used, with: {{order: {given}}}, on: {{done: over}}}}
  over: {{final: true}}
rules:
  - before: step
    when: {when}
    do: {{tell: (seen ?step.order.item), then: continue}}
"""


@pytest.mark.parametrize(
    ("given", "when", "seen"),
    [
        ("?mine", "(= ?step.order.item a)", ["a"]),
        ("?mine", "(= ?step.order.places.0 table)", ["a"]),
        ("?mine", "(= ?step.order.item b)", []),
        ("{item: ?other, places: [table]}", "(= ?step.order.item b)", ["b"]),
        ("{item: ?other, places: [table]}", "(= ?step.order.places.0 table)", ["b"]),
    ],
)
def test_a_rule_reads_parts_of_the_arguments_of_its_step(given, when, seen):
    async def main() -> list[str]:
        knowledge = KnowledgeBase(SCHEMA)
        library = Library([parse_plot(RULED.format(given=given, when=when)), parse_plot(USED)])
        end = await Sequencer(library, knowledge, [], LoopClock()).run("ruled")
        assert end.finished, end.problem
        return [str(one["i"]) for one in knowledge.query("(seen ?i)")]

    assert run_simulated(main()) == seen
