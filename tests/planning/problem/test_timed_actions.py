"""Durative actions, derived predicates and metrics as read, and durative actions seen as ordinary ones."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_base.errors import InputError, UnsupportedConstructError
from knowledge_base.facts import Delta, fact
from knowledge_base.language.evaluation.evaluator import apply_effect, holds
from knowledge_base.language.syntax.expression import Constant
from knowledge_base.language.syntax.text import to_text
from knowledge_base.pddl import read_problem
from knowledge_base.store import KnowledgeBase
from planning.model.domain import PlanningDomain
from planning.model.plan import PlanStep

MATCHES = """(define (domain matchcellar)
  (:requirements :durative-actions :derived-predicates)
  (:types match fuse place)
  (:predicates (handfree) (unused ?m - match) (light ?m - match) (mended ?f - fuse) (bright) (at ?p - place))
  (:functions (length ?m - match) (burnt) (total-cost))
  (:derived (bright) (exists (?m - match) (light ?m)))
  (:derived (bright) (handfree))
  (:durative-action strike
    :parameters (?m - match)
    :duration (= ?duration (length ?m))
    :condition (and (at start (unused ?m)) (over all (light ?m)))
    :effect (and (at start (and (not (unused ?m)) (light ?m)))
                 (at end (not (light ?m))) (at end (increase (burnt) (* 2 ?duration)))))
  (:durative-action mend
    :parameters (?f - fuse ?m - match)
    :duration (and (>= ?duration 4) (<= ?duration 6))
    :condition (and (at start (handfree)) (over all (light ?m)) (at end (not (mended ?f))))
    :effect (and (at start (not (handfree))) (at end (mended ?f)) (at end (handfree))))
  (:durative-action walk
    :parameters (?a ?b - place)
    :duration ()
    :condition (forall (?m - match) (at start (unused ?m)))
    :effect (and (at start (at ?b)) (at end (not (at ?a)))
                 (when (at end (bright)) (at end (handfree)))
                 (forall (?m - match) (at end (not (unused ?m)))))))
"""


@pytest.fixture(scope="module")
def matches():
    return PlanningDomain.parse(MATCHES, "m.pddl")


def test_a_durative_action_keeps_what_it_needs_and_does_by_time(matches):
    strike = matches.actions["strike"]
    assert strike.duration.fixed
    assert to_text(strike.duration.least) == "(length ?m)"
    assert to_text(strike.timed.start) == "(unused ?m)"
    assert to_text(strike.timed.over_all) == "(light ?m)"
    assert to_text(strike.timed.start_effect) == "(and (not (unused ?m)) (light ?m))"
    assert to_text(strike.timed.end_effect) == "(and (not (light ?m)) (increase (burnt) (* 2 (length ?m))))"


def test_bounds_of_a_duration(matches):
    mend, walk = matches.actions["mend"].duration, matches.actions["walk"].duration
    assert (mend.least, mend.most, mend.fixed) == (Constant(4), Constant(6), False)
    assert (walk.least, walk.most) == (Constant(0), Constant(float("inf")))


def test_alone_an_action_needs_only_what_it_does_not_bring_about_itself(matches):
    assert to_text(matches.actions["strike"].precondition) == "(unused ?m)"
    assert to_text(matches.actions["mend"].precondition) == "(and (handfree) (light ?m) (not (mended ?f)))"


def test_alone_an_action_has_done_what_its_end_leaves(matches):
    assert to_text(matches.actions["mend"].effect) == "(and (mended ?f) (handfree))"
    strike = to_text(matches.actions["strike"].effect)
    assert strike == "(and (not (unused ?m)) (not (light ?m)) (increase (burnt) (* 2 (length ?m))))"


def test_timed_parts_inside_quantifiers_and_conditions(matches):
    walk = matches.actions["walk"]
    assert to_text(walk.timed.start) == "(forall (?m - match) (unused ?m))"
    assert "(when (bright) (handfree))" in to_text(walk.timed.end_effect)
    assert "(forall (?m - match) (not (unused ?m)))" in to_text(walk.timed.end_effect)


@pytest.mark.parametrize(("start", "end", "there"), [("a", "b", {"b"}), ("a", "a", set())])
def test_a_deletion_at_the_end_applies_also_to_coinciding_variables(matches, world_of, start, end, there):
    world = world_of(matches.schema, {"a": "place", "b": "place"}, [fact("at", start)])
    world.apply(matches.effects(PlanStep("walk", (start, end)), world), author="test")
    assert {answer["p"] for answer in world.query("(at ?p)")} == there


def test_axioms_take_their_types_from_the_declaration():
    domain = PlanningDomain.parse("""(define (domain blocks) (:types block)
      (:predicates (on ?x ?y - block) (above ?x ?y - block))
      (:derived (above ?a ?b) (or (on ?a ?b) (exists (?c - block) (and (on ?a ?c) (above ?c ?b))))))""")
    (above,) = domain.axioms
    assert (above.predicate, [p.types for p in above.parameters]) == ("above", [("block",), ("block",)])


def test_several_axioms_for_one_predicate(matches):
    assert [to_text(axiom.condition) for axiom in matches.axioms] == [
        "(exists (?m - match) (light ?m))",
        "(handfree)",
    ]


@pytest.mark.parametrize(
    ("old", "new", "line", "said"),
    [
        ("(:derived (bright) (handfree))", "(:derived (brght) (handfree))", 7, "bright"),
        ("(:derived (bright) (handfree))", "(:derived (bright ?x) (handfree))", 7, "takes 0 arguments"),
        ("(:derived (bright) (handfree))", "(:derived (bright) (light ?x))", 7, "?x"),
        ("(at end (mended ?f))", "(at end (bright))", 18, "derived (at m.pddl:7:13)"),
        ("(at start (handfree))", "(at start (handfre))", 17, "handfree"),
        ("(over all (light ?m)) (at end", "(over all (light ?f)) (at end", 17, "of type fuse"),
        ("(= ?duration (length ?m))", "(= ?duration (lenth ?m))", 10, "length"),
        ("(= ?duration (length ?m))", "(= ?duration ?m)", 10, "numbers"),
        ("(at start (not (handfree)))", "(at start (not (handfree ?f)))", 18, "takes 0 arguments"),
    ],
)
def test_a_mistake_in_a_timed_part_is_named_with_its_line(old, new, line, said):
    assert old in MATCHES
    with pytest.raises(InputError) as caught:
        PlanningDomain.parse(MATCHES.replace(old, new), "m.pddl")
    assert said in str(caught.value)
    assert caught.value.place.line == line


@pytest.mark.parametrize(
    ("old", "new", "line", "construct"),
    [
        ("(* 2 ?duration)", "(* 2 #t)", 13, "#t"),
        ("(= ?duration (length ?m))", "(at end (= ?duration 3))", 10, "at end"),
        ("(= ?duration (length ?m))", "(>= ?duration 3)", 13, "?duration"),
        ("(when (at end (bright))", "(when (at start (bright))", 24, "when"),
        ("(at start (handfree))", "(preference p (at start (handfree)))", 17, "preference"),
    ],
)
def test_an_unsupported_timed_construct_is_refused_with_its_name_and_line(old, new, line, construct):
    assert old in MATCHES
    with pytest.raises(UnsupportedConstructError) as caught:
        PlanningDomain.parse(MATCHES.replace(old, new), "m.pddl")
    assert caught.value.construct == construct
    assert caught.value.place.line == line
    assert caught.value.engines in str(caught.value)


@pytest.mark.parametrize(
    ("text", "direction", "term"),
    [
        ("minimize (total-cost)", "minimize", "(total-cost)"),
        ("MAXIMIZE (- (burnt) (* 2 (total-time)))", "maximize", "(- (burnt) (* 2 (total-time)))"),
        ("minimize total-time", "minimize", "(total-time)"),
    ],
)
def test_a_metric_is_kept(matches, text, direction, term):
    problem = read_problem(f"(define (problem p) (:domain matchcellar) (:metric {text}))", matches.schema)
    assert (problem.metric.direction, to_text(problem.metric.term)) == (direction, term)


def test_without_a_metric_there_is_none(matches):
    assert read_problem("(define (problem p) (:domain matchcellar))", matches.schema).metric is None


def test_total_time_is_a_number_only_in_a_metric(matches):
    with pytest.raises(InputError, match="total-time"):
        read_problem("(define (problem p) (:domain d) (:goal (< (total-time) 3)))", matches.schema)


SMALL = """(define (domain small) (:types thing)
  (:predicates (p ?x - thing) (q) (r ?x ?y - thing))
  (:durative-action a :parameters (?x ?y - thing) :duration (= ?duration 1)
    :condition (and (at start START) (over all ALL) (at end END))
    :effect (and (at start BEGUN) (at end ENDED))))"""
ATOMS = st.sampled_from(["(p ?x)", "(p ?y)", "(q)", "(r ?x ?y)", "(r ?y ?x)"])
LITERALS = ATOMS | ATOMS.map("(not {})".format)
CONDITIONS = st.recursive(
    LITERALS,
    lambda inner: (
        st.lists(inner, max_size=2).map(lambda parts: f"(and {' '.join(parts)})")
        | st.lists(inner, max_size=2).map(lambda parts: f"(or {' '.join(parts)})")
        | st.tuples(inner, inner).map(lambda two: "(imply {} {})".format(*two))
        | inner.map("(not {})".format)
    ),
    max_leaves=4,
)
EFFECTS = st.lists(LITERALS, max_size=3).map(lambda parts: f"(and {' '.join(parts)})")
FACTS = [fact("p", "a"), fact("p", "b"), fact("q"), fact("r", "a", "b"), fact("r", "b", "a"), fact("r", "a", "a")]


@settings(derandomize=True, deadline=None, max_examples=200)
@given(CONDITIONS, CONDITIONS, CONDITIONS, EFFECTS, EFFECTS, st.sets(st.sampled_from(FACTS)), st.sampled_from("ab"))
def test_seen_as_ordinary_an_action_does_what_its_two_ends_do(start, over_all, end, begun, ended, facts, y):
    text = SMALL.replace("START", start).replace("ALL", over_all).replace("BEGUN", begun).replace("ENDED", ended)
    domain = PlanningDomain.parse(text.replace("END", end))
    action, bindings = domain.actions["a"], {"x": "a", "y": y}
    before = KnowledgeBase(domain.schema)
    before.apply(Delta(nodes={"a": "thing", "b": "thing"}, added=tuple(facts)), author="test")
    world = KnowledgeBase.from_json(before.to_json())
    world.apply(apply_effect(action.timed.start_effect, world, bindings), author="start")
    between = all(holds(e, world, bindings) for e in (action.timed.over_all, action.timed.end))
    world.apply(apply_effect(action.timed.end_effect, world, bindings), author="end")
    possible = holds(action.timed.start, before, bindings) and between

    if y == "b":  # written alike is meant alike only where no two variables have one value
        assert holds(action.precondition, before, bindings) == possible
    before.apply(apply_effect(action.effect, before, bindings), author="whole")
    assert set(before.facts()) == set(world.facts())
