"""unified-planning's problems as ours, ours as theirs, and domains written as PDDL."""

from __future__ import annotations

from typing import Any

import pytest
import unified_planning.shortcuts as up
from unified_planning.io import PDDLWriter
from unified_planning.plans import SequentialPlan
from unified_planning.test.examples import get_example_problems

from knowledge_base import InputError, KnowledgeBase, UnsupportedConstructError, computed
from planning import Plan, PlanningDomain, PlanStep, from_unified, plan_from_unified, plan_to_unified, to_unified

up.get_environment().credits_stream = None
EXAMPLES = get_example_problems()
REORDERED = {"counter", "travel_with_consumptions"}
"""Their reader flattens a conjunction, or turns the factors of a product round."""
BEYOND = (
    "PDDL supports only", "NotImplementedError", "PDDL does not support", "takes a Problem of unified-planning",
    "Only one metric", "nothing here can plan with",
)  # fmt: skip


def known(domain: PlanningDomain, start) -> KnowledgeBase:
    kb = KnowledgeBase(domain.schema)
    kb.apply(start.delta(), "test")
    return kb


def numbers(start) -> dict[Any, Any]:
    """What functions are worth; what is not said is 0, and they do not say it."""
    return {fluent: number for fluent, number in start.values.items() if number}


@pytest.mark.parametrize("name", EXAMPLES)
def test_their_examples_are_the_same_problem_here_and_back_again(name: str) -> None:
    problem = EXAMPLES[name].problem
    try:
        domain, start = from_unified(problem)
    except UnsupportedConstructError:
        return
    except InputError as error:
        if not any(words in str(error) for words in BEYOND):
            raise
        return
    back, again = from_unified(to_unified(domain, known(domain, start), start.goal, start.metric))
    assert back.actions.keys() == domain.actions.keys()
    assert (set(again.init), numbers(again), again.objects) == (set(start.init), numbers(start), start.objects)
    if name not in REORDERED:
        assert back.actions == domain.actions
        assert again.goal == start.goal


def _sequential():
    for name, example in EXAMPLES.items():
        for number, plan in enumerate(example.valid_plans):
            if (
                isinstance(plan, SequentialPlan) and plan.actions and name != "basic_undef_numeric"
            ):  # it leaves the goal
                yield pytest.param(example.problem, plan, id=f"{name} {number}")


@pytest.mark.parametrize(("problem", "plan"), list(_sequential()))
def test_their_plans_reach_the_goal_here(problem, plan) -> None:
    try:
        domain, start = from_unified(problem)
    except InputError:
        return
    kb = known(domain, start)
    for line in PDDLWriter(problem).get_plan(plan).splitlines():
        action, *args = line.strip("()").split()
        step = PlanStep(action, tuple(args))
        assert domain.applicable(step, kb), domain.why_not(step, kb)
        kb.apply(domain.effects(step, kb), "test")
    assert kb.ask(start.goal)


DOMAIN = PlanningDomain.parse("""
(define (domain delivery)
  (:requirements :typing)
  (:types parcel van - thing place thing)
  (:constants depot - place)
  (:predicates (at ?t - thing ?p - place) (in ?x - parcel ?v - van) (near ?a ?b - place) (idle))
  (:functions (total-cost) (distance ?a ?b - place))
  (:action drive
    :parameters (?v - van ?from ?to - place)
    :precondition (and (at ?v ?from) (not (= ?from ?to)))
    :effect (and (at ?v ?to) (not (at ?v ?from)) (increase (total-cost) (distance ?from ?to))))
  (:action load
    :parameters (?x - parcel ?v - van ?p - place)
    :precondition (and (at ?v ?p) (at ?x ?p) (forall (?o - parcel) (not (in ?o ?v))))
    :effect (and (in ?x ?v) (not (at ?x ?p)))))
""")


def test_a_world_and_a_goal_convert_to_unified_planning_and_back() -> None:
    kb = KnowledgeBase(DOMAIN.schema)
    with kb.transaction("test") as tx:
        tx.add_node("van1", "van")
        tx.add_node("box", "parcel")
        tx.add_node("home", "place")
        tx.tell("at", "van1", "depot")
        tx.tell("at", "box", "home")
        tx.set("distance", "depot", "home", 3)
        tx.set("distance", "home", "depot", 3)
    problem = to_unified(DOMAIN, kb, "(exists (?v - van) (in box ?v))")
    assert {action.name for action in problem.actions} == {"drive", "load"}
    assert {thing.name for thing in problem.all_objects} == {"van1", "box", "home", "depot"}
    assert len(problem.quality_metrics) == 1
    domain, start = from_unified(problem)
    assert domain.actions.keys() == DOMAIN.actions.keys()
    assert known(domain, start).ask("(and (at box home) (= (distance home depot) 3))")


def test_a_construct_that_unified_planning_cannot_read_is_named() -> None:
    kb = KnowledgeBase(DOMAIN.schema)
    with pytest.raises(InputError, match="'boxed'"):
        to_unified(DOMAIN, kb, "(boxed)")
    derived = PlanningDomain.parse("(define (domain d) (:predicates (p) (q)) (:derived (p) (q)))")
    with pytest.raises(InputError, match="does not support a derived predicate, such as 'p'"):
        to_unified(derived, KnowledgeBase(derived.schema), "(p)")
    labelled = PlanningDomain.parse("(define (domain d) (:types t) (:functions (label ?t - t) - text))")
    with pytest.raises(InputError, match="does not support a non-numeric function, such as 'label'"):
        to_unified(labelled, KnowledgeBase(labelled.schema), "(and)")
    another = KnowledgeBase(PlanningDomain.parse("(define (domain d) (:predicates (warm)))").schema)
    with pytest.raises(InputError, match=r"cannot read the problem: .*warm"):
        to_unified(DOMAIN, another, "(warm)")


def test_a_computed_predicate_is_no_pddl() -> None:
    @computed("(close ?a ?b - place)", reads=["(distance ?a ?b)"])
    def close(distance: float) -> bool:
        return distance < 1

    text = "(define (domain d) (:types place) (:functions (distance ?a ?b - place)))"
    domain = PlanningDomain.parse(text, computed=[close])
    with pytest.raises(InputError, match="computes the predicate 'close'"):
        domain.to_pddl()


def _all_plans():
    for name, example in EXAMPLES.items():
        for number, plan in enumerate(example.valid_plans):
            yield pytest.param(example.problem, plan, id=f"{name} {number}")


@pytest.mark.parametrize(("problem", "plan"), list(_all_plans()))
def test_their_plans_are_plans_here_and_the_same_back_again(problem, plan) -> None:
    try:
        ours = plan_from_unified(plan, problem)
    except InputError as error:
        assert any(words in str(error) for words in (*BEYOND, "cannot become a sequence", "cannot be written as PDDL"))  # noqa: PT017
        return
    back = plan_to_unified(ours, problem)
    if isinstance(plan, SequentialPlan):
        assert back == plan
    assert plan_from_unified(back, problem) == ours


def test_a_plan_for_a_renamed_problem_has_the_original_names() -> None:
    problem = up.Problem("move")
    place = up.UserType("Place")
    at = problem.add_fluent("at", up.BoolType(), default_initial_value=False, p=place)
    move = up.InstantaneousAction("Forall", p=place)
    move.add_effect(at(move.p), True)
    problem.add_action(move)
    hall = problem.add_object("The Hall", place)
    problem.add_goal(at(hall))
    domain, start = from_unified(problem)
    (name,) = domain.actions
    (thing,) = start.objects
    plan = Plan((PlanStep(name, (thing,)),))
    assert (name, thing) != ("Forall", "The Hall")
    assert str(plan_to_unified(plan, problem).actions[0]) == "Forall(The Hall)"
    with pytest.raises(InputError, match=r"\(fly the_hall\) is not a step of the problem"):
        plan_to_unified(Plan((PlanStep("fly", ("the_hall",)),)), problem)
