from __future__ import annotations

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from searching import solution

from knowledge_base.errors import SchemaError
from knowledge_base.facts import Delta, fact
from knowledge_base.language.evaluation.evaluator import holds
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.store import KnowledgeBase
from planning.analysis.explanation import why_unsolvable
from planning.analysis.validation import validate
from planning.model.domain import PlanningDomain
from planning.model.plan import Plan, PlanStep
from planning.model.problem import UnsupportedActionError, UnsupportedGoalError
from planning.problem.construction import build_problem
from planning.problem.derived import derivation

ROOMS = """(define (domain rooms) (:types room robot thing)
  (:predicates (door ?a ?b - room) (connected ?a ?b - room) (near ?a ?b - room) (at ?r - robot ?p - room)
               (lies ?t - thing ?p - room) (held ?t - thing) (busy) (reachable ?r - robot ?t - thing) (closed ?a - room))
  (:derived (near ?a ?b - room) (or (door ?a ?b) (door ?b ?a)))
  (:derived (connected ?a ?b - room)
    (or (near ?a ?b) (exists (?c - room) (and (near ?a ?c) (not (closed ?c)) (connected ?c ?b)))))
  (:derived (busy) (exists (?t - thing) (held ?t)))
  (:derived (reachable ?r - robot ?a - thing) (exists (?b - room) (and (at ?r ?b) (lies ?a ?b))))
  (:action drive :parameters (?r - robot ?a ?b - room) :precondition (and (at ?r ?a) (connected ?a ?b))
    :effect (and (not (at ?r ?a)) (at ?r ?b)))
  (:action take :parameters (?r - robot ?b - thing) :precondition (and (not (busy)) (reachable ?r ?b))
    :effect (and (held ?b) (forall (?a - room) (when (lies ?b ?a) (not (lies ?b ?a)))))))
"""


def rooms(*facts, text=ROOMS) -> tuple[PlanningDomain, KnowledgeBase]:
    domain = PlanningDomain.parse(text, "rooms.pddl")
    kb = KnowledgeBase(domain.schema)
    nodes = {**dict.fromkeys("abcd", "room"), "robby": "robot", "cup": "thing", "can": "thing"}
    doors = (fact("door", "b", "a"), fact("door", "b", "c"), fact("door", "d", "d"))
    kb.apply(Delta(nodes=nodes, added=(*doors, fact("at", "robby", "a"), *facts)), author="test")
    return domain, kb


def plan_for(domain, world, goal):
    wanted = parse_condition(goal)
    plan = solution(build_problem(domain, world, wanted))
    assert plan is None or validate(plan, domain, world, wanted).valid
    return plan


@pytest.mark.parametrize(
    ("goal", "steps"),
    [
        ("(at robby c)", ["drive"]),
        ("(busy)", ["drive", "take"]),
        ("(and (held cup) (reachable robby can))", ["drive", "take"]),
        ("(exists (?b - thing) (reachable robby ?b))", ["drive"]),
        ("(forall (?a - room) (imply (connected a ?a) (not (at robby ?a))))", None),
    ],
)
def test_goals_and_actions_ask_for_derived_predicates(goal, steps):
    domain, world = rooms(fact("lies", "cup", "c"), fact("lies", "can", "c"))
    plan = plan_for(domain, world, goal)
    assert (plan and [step.action for step in plan.steps]) == steps


def test_a_derived_predicate_that_holds_is_a_goal_that_holds():
    assert build_problem(*rooms(), parse_condition("(connected a c)")).goal == ()


def test_a_static_derived_predicate_is_the_least_fixpoint():
    """Nothing is connected through a closed room, so the way leads into it."""
    domain, world = rooms(fact("closed", "b"))
    assert len(plan_for(domain, world, "(at robby c)").steps) == 2
    assert plan_for(domain, world, "(at robby d)") is None


def test_a_derived_precondition_is_judged_step_by_step():
    domain, world = rooms(fact("lies", "cup", "a"), fact("lies", "can", "a"))
    taken = Plan((PlanStep("take", ("robby", "cup")), PlanStep("take", ("robby", "can"))))
    verdict = validate(taken, domain, world, parse_condition("(held can)"))
    assert (verdict.valid, verdict.failing_step, verdict.why) == (False, 1, "(held cup) is true")


def test_why_there_is_no_plan_is_said_in_what_it_follows_from():
    domain, world = rooms(fact("lies", "cup", "c"), fact("lies", "can", "c"), fact("held", "can"))
    [why] = why_unsolvable(domain, world, parse_condition("(held cup)"))
    assert why == "(held cup) needs (take robby cup), which needs (not (exists (?t - thing) (held ?t)))"


RECURSIVE = """(define (domain towers) (:types block)
  (:predicates (on ?a ?b - block) (above ?a ?b - block) (painted ?a - block) (odd ?a - block))
  (:derived (above ?a ?b - block) (or (on ?a ?b) (exists (?c - block) (and (on ?a ?c) (above ?c ?b)))))
  (:action stack :parameters (?a ?b - block) :precondition (not (above ?b ?a)) :effect (on ?a ?b))
  (:action paint :parameters (?a - block) :effect (painted ?a)))
"""


def test_a_recursive_predicate_that_actions_change_is_an_error_where_it_matters():
    domain = PlanningDomain.parse(RECURSIVE, "towers.pddl")
    world = KnowledgeBase(domain.schema)
    world.apply(Delta(nodes=dict.fromkeys("ab", "block")), author="test")
    with pytest.raises(UnsupportedGoalError, match=r"'above'.*towers.pddl:3.*'on'"):
        build_problem(domain, world, parse_condition("(above a b)"))
    with pytest.raises(UnsupportedActionError, match="'stack' asks for 'above'") as caught:
        build_problem(domain, world, parse_condition("(on a b)"))
    assert caught.value.place.line == 4
    assert len(plan_for(domain, world, "(painted a)").steps) == 1


def test_a_predicate_that_follows_from_its_own_negation_is_an_error():
    text = RECURSIVE.replace("(:action stack", "(:derived (odd ?a - block) (not (odd ?a)))\n  (:action stack")
    with pytest.raises(SchemaError, match=r"towers.pddl:4.*'odd' follows from its own negation"):
        derivation(PlanningDomain.parse(text, "towers.pddl")).expand(parse_condition("(odd a)"))


def test_a_domain_without_derived_predicates_stays_itself(clean_up, table):
    found, world, goal = derivation(clean_up), table(1), parse_condition("(hand-free)")
    assert (found.domain, found.world(world), found.expand(goal)) == (clean_up, world, goal)


NODES = "abc"


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    st.sets(st.sampled_from(list(itertools.product(NODES, NODES)))),
    st.sets(st.sampled_from(NODES)),
    st.permutations(["x", "y", "z"]),
)
def test_derived_predicates_say_what_their_axioms_say(edges, marked, names):
    """The closure of a relation, counted by hand; the names of variables make no difference."""
    x, y, z = names
    domain = PlanningDomain.parse(f"""(define (domain d) (:types n)
      (:predicates (e ?x ?y - n) (path ?x ?y - n) (m ?x - n) (sees ?x - n) (bad))
      (:derived (path ?{x} ?{y} - n) (or (e ?{x} ?{y}) (exists (?{z} - n) (and (e ?{x} ?{z}) (path ?{z} ?{y})))))
      (:derived (sees ?{x} - n) (exists (?{y} - n) (and (path ?{x} ?{y}) (m ?{y}))))
      (:derived (bad) (exists (?{x} - n) (and (m ?{x}) (not (sees ?{x}))))))""")
    world = KnowledgeBase(domain.schema)
    added = (*(fact("e", *pair) for pair in sorted(edges)), *(fact("m", n) for n in sorted(marked)))
    world.apply(Delta(nodes=dict.fromkeys(NODES, "n"), added=added), author="test")
    path = set(edges)
    while more := {(a, d) for a, b in path for c, d in path if b == c} - path:
        path |= more
    sees = {a for a, b in path if b in marked}
    found = derivation(domain)
    closed = found.world(world)

    def true(text):
        return holds(found.expand(parse_condition(text)), closed)

    assert {(a, b) for a, b in itertools.product(NODES, NODES) if true(f"(path {a} {b})")} == path
    assert {a for a in NODES if true(f"(sees {a})")} == sees
    assert true("(bad)") == (not marked <= sees)
    assert true("(forall (?x - n) (imply (sees ?x) (exists (?y - n) (path ?x ?y))))")
