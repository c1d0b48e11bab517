"""Causal links and de-ordering: every linearisation is as good as the plan, and no step waits without a reason."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from order_strategies import Planned, planned
from standing_links import standing

from knowledge_base.errors import InputError
from knowledge_base.facts import fact
from knowledge_base.language.evaluation.evaluator import holds
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.world.overlay import Overlay
from planning.analysis.validation import validate
from planning.model.domain import PlanningDomain
from planning.model.plan import Plan, PlanStep
from planning.ordering import step_dependencies
from planning.ordering.causal_tracing import deordered
from planning.ordering.partial_order import PartialOrder, reduced


def linearisations(order: PartialOrder):
    def extend(taken):
        if len(taken) == len(order.steps):
            yield taken
        for number, needed in order.earlier.items():
            if number not in taken and needed <= set(taken):
                yield from extend((*taken, number))

    return extend(())


def steps(*texts):
    words = (text.split() for text in texts)
    return tuple(PlanStep(name, tuple(args)) for name, *args in words)


# -- random plans, all linearisations ------------------------------------------------------------------------


@pytest.mark.parametrize("most", [step_dependencies.MOST_INSTANCES, 1])
@settings(max_examples=60, derandomize=True, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(planned())
def test_every_linearisation_leads_to_the_goal_and_to_the_same_world_and_keeps_what_stands(
    most: int, monkeypatch, case: Planned
):
    monkeypatch.setattr(step_dependencies, "MOST_INSTANCES", most)  # 1: no quantified condition is divided
    order = deordered(case.plan, case.domain, case.world, case.goal)
    ends = []
    for taken in linearisations(order):
        ahead = Overlay(case.world)
        for count, number in enumerate(taken):
            done, step = taken[:count], order.steps[number - 1]
            assert all(holds(link.fact, ahead) for link in standing(order.links, done, done)), (taken, count)
            assert case.domain.applicable(step, ahead), (taken, count)
            ahead.apply(case.domain.effects(step, ahead))
        assert holds(case.goal, ahead), taken
        assert all(holds(link.fact, ahead) for link in standing(order.links, taken, taken)), taken
        ends.append((set(ahead.delta.added), set(ahead.delta.removed), ahead.delta.values))
    assert all(end == ends[0] for end in ends)


@settings(max_examples=60, derandomize=True, deadline=None)
@given(planned(), st.data())
def test_there_is_an_order_for_exactly_those_plans_that_are_valid(case: Planned, data):
    steps = case.plan.steps
    plan = Plan(tuple(data.draw(st.lists(st.sampled_from(steps), max_size=6)))) if steps else case.plan
    if validate(plan, case.domain, case.world, case.goal).valid:
        assert deordered(plan, case.domain, case.world, case.goal).steps == plan.steps
    else:
        with pytest.raises(InputError):
            deordered(plan, case.domain, case.world, case.goal)


# -- quantified conditions with many instances ----------------------------------------------------------------

ROW = PlanningDomain.parse("""
(define (domain row)
  (:types thing)
  (:predicates (par ?x ?y - thing) (mark ?x - thing) (hot ?x - thing) (g) (h))
  (:action heat :parameters (?x - thing) :precondition (and) :effect (hot ?x))
  (:action cool :parameters (?x - thing) :precondition (and) :effect (not (hot ?x)))
  (:action join :parameters (?x ?y - thing) :precondition (and) :effect (par ?x ?y))
  (:action part :parameters (?x ?y - thing) :precondition (and) :effect (not (par ?x ?y)))
  (:action unmarked :parameters () :effect (g)
    :precondition (forall (?a ?b ?c ?d - thing) (imply (and (par ?a ?b) (par ?b ?c) (par ?c ?d)) (not (mark ?a)))))
  (:action cold :parameters () :effect (g)
    :precondition (forall (?a ?b - thing) (imply (par ?a ?b) (not (hot ?b)))))
  (:action warm :parameters () :effect (h)
    :precondition (exists (?a ?b ?c ?d - thing) (and (par ?a ?b) (par ?b ?c) (par ?c ?d) (hot ?d)))))
""")


@pytest.fixture
def row(world_of):
    facts = tuple(fact("par", f"o{number}", f"o{number + 1}") for number in range(59))
    return world_of(ROW.schema, {f"o{number}": "thing" for number in range(60)}, facts)


def ordered(world, *texts, goal="(g)"):
    return deordered(Plan(steps(*texts)), ROW, world, parse_condition(goal))


def test_a_condition_with_millions_of_instances_is_one_link(row):
    order = ordered(row, "unmarked")
    assert [(link.provider, link.user) for link in order.links] == [(0, 1), (1, 2)]
    assert "forall" in str(order.links[0])


def test_steps_that_change_one_of_many_instances_are_ordered_around_their_user(row):
    assert ordered(row, "cold", "heat o3").before == {(1, 2)}
    assert ordered(row, "heat o3", "cool o3", "cold").before == {(1, 2), (2, 3)}
    assert ordered(row, "cold", "heat o0").before == set()  # nothing is before o0
    assert ordered(row, "heat o0", "cold", "join o7 o0").before == {(2, 3)}
    assert ordered(row, "join o7 o0", "cold", "heat o0").before == {(2, 3)}
    assert ordered(row, "heat o0", "join o5 o0", "part o5 o0", "cold").before == {(2, 3), (3, 4)}
    with pytest.raises(InputError, match=r"\(cold\) needs"):
        ordered(row, "heat o3", "cold")


NAMED = PlanningDomain.parse("""
(define (domain named)
  (:types door)
  (:predicates (door ?d - door) (near ?x ?y - door) (shut ?x - door) (g))
  (:action shut :parameters (?x - door) :precondition (and) :effect (shut ?x))
  (:action pass :parameters () :effect (g)
    :precondition (forall (?a ?b - door) (imply (near ?a ?b) (not (shut ?b))))))
""")


def test_a_predicate_with_the_name_of_its_type_is_not_taken_for_the_type(world_of):
    facts = tuple(fact("near", f"d{number}", f"d{number + 1}") for number in range(59))
    world = world_of(NAMED.schema, {f"d{number}": "door" for number in range(60)}, facts)
    plan = Plan(steps("pass", "shut d3"))
    assert deordered(plan, NAMED, world, parse_condition("(g)")).before == {(1, 2)}
    with pytest.raises(InputError, match=r"\(pass\) needs"):
        deordered(Plan(steps("shut d3", "pass")), NAMED, world, parse_condition("(g)"))


def test_one_of_many_witnesses_suffices(row):
    order = ordered(row, "heat o9", "warm", "cool o9", goal="(h)")
    assert order.before == {(1, 2), (2, 3)}
    with pytest.raises(InputError, match=r"\(warm\) needs"):
        ordered(row, "heat o1", "warm", goal="(h)")


# -- what waits for what, and why ----------------------------------------------------------------------------

DOMAIN = PlanningDomain.parse("""
(define (domain jobs)
  (:types part)
  (:predicates (raw ?p - part) (drilled ?p - part) (painted ?p - part) (tool-free) (lights-on))
  (:functions (spent) (paint))
  (:action drill :parameters (?p - part) :precondition (raw ?p)
    :effect (and (drilled ?p) (increase (spent) 1)))
  (:action paint :parameters (?p - part) :precondition (and (raw ?p) (>= (paint) 1))
    :effect (and (painted ?p) (decrease (paint) 1) (increase (spent) 2)))
  (:action borrow :parameters () :precondition (tool-free) :effect (and (not (tool-free)) (tool-free)))
  (:action light :parameters () :precondition () :effect (lights-on))
  (:action look :parameters (?p - part) :precondition (or (lights-on) (painted ?p)) :effect (and))
  (:action leave :parameters () :precondition (forall (?p - part) (drilled ?p)) :effect (not (lights-on))))
""")


@pytest.fixture
def shop(world_of):
    facts = (fact("raw", "a"), fact("raw", "b"), fact("tool-free"))
    return world_of(DOMAIN.schema, {"a": "part", "b": "part"}, facts, {fact("paint"): 2})


def order_of(world, *texts, goal="(and)"):
    return deordered(Plan(steps(*texts)), DOMAIN, world, parse_condition(goal))


def test_steps_that_have_nothing_to_do_with_each_other_do_not_wait(shop):
    assert order_of(shop, "drill a", "drill b", "light").before == set()


def test_steps_that_only_add_to_a_number_are_unordered_unless_a_step_reads_it(shop):
    assert order_of(shop, "drill a", "drill b", goal="(> (spent) 1)").before == set()
    assert order_of(shop, "paint a", "paint b").before == {(1, 2)}


def test_a_fact_that_is_taken_and_given_back_is_not_there_in_between(shop):
    assert order_of(shop, "borrow", "borrow").before == {(1, 2)}


def test_a_condition_for_all_things_is_one_link_for_each(shop):
    order = order_of(shop, "drill b", "light", "drill a", "leave")
    assert list(map(str, order.links)) == [
        "0 -(raw b)-> 1", "0 -(raw a)-> 3", "3 -(drilled a)-> 4", "1 -(drilled b)-> 4",
    ]  # fmt: skip
    assert order.before == {(1, 4), (3, 4), (2, 4)}  # `leave` turns off what `light` turned on


def test_a_disjunction_is_one_link_from_what_made_it_true(shop):
    order = order_of(shop, "paint a", "light", "look a")
    assert [str(link) for link in order.links if link.user == 3] == ["1 -(or (lights-on) (painted a))-> 3"]
    assert order.before == {(1, 3)}


def test_a_link_from_several_steps_stands_after_the_last_of_them(shop):
    order = order_of(shop, "drill a", "drill b", goal="(> (spent) 1)")
    links = [link for link in order.links if link.user == 3]
    assert [link.provider for link in links] == [1, 2]
    assert set(links).isdisjoint(standing(order.links, {1}, {1}))
    assert set(links) <= set(standing(order.links, {1, 2}, {1, 2}))


def test_a_link_from_the_present_says_so(shop):
    assert (
        str(deordered(Plan(steps("drill a")), DOMAIN, shop, parse_condition("(raw b)")).links[-1]) == "0 -(raw b)-> 2"
    )


def test_a_plan_that_does_not_lead_to_the_goal_has_no_links(shop):
    with pytest.raises(InputError, match=r"the goal needs \(drilled b\)"):
        order_of(shop, "drill a", goal="(drilled b)")


def test_a_derived_fact_is_provided_by_the_steps_that_add_its_base_facts(world_of):
    domain = PlanningDomain.parse("""
(define (domain kitchen) (:types pan)
  (:predicates (hot ?p - pan) (oiled ?p - pan) (ready ?p - pan) (fried ?p - pan))
  (:derived (ready ?p - pan) (and (hot ?p) (oiled ?p)))
  (:action heat :parameters (?p - pan) :precondition () :effect (hot ?p))
  (:action oil :parameters (?p - pan) :precondition () :effect (oiled ?p))
  (:action fry :parameters (?p - pan) :precondition (ready ?p) :effect (fried ?p)))
""")
    world = world_of(domain.schema, {"big": "pan"})
    order = deordered(Plan(steps("heat big", "oil big", "fry big")), domain, world, parse_condition("(fried big)"))
    assert order.before == {(1, 3), (2, 3)}
    assert list(map(str, order.links))[:2] == ["1 -(hot big)-> 3", "2 -(oiled big)-> 3"]


def test_pairs_that_follow_from_others_are_left_out():
    assert reduced({(1, 2), (2, 3), (1, 3), (1, 4), (3, 4)}) == {(1, 2), (2, 3), (3, 4)}


# -- unified-planning's own conversion as an oracle -----------------------------------------------------------

ORACLE_PROBLEM = """(define (problem p) (:domain clean-up-table)
  (:objects table shelf - surface  sink bin - destination  cup1 cup2 cup3 - cup  can1 - can)
  (:init (robot-at table) (hand-free) (one-less one none) (passable table) (passable sink) (passable shelf)
         (lies-at cup1 table) (lies-at cup2 table) (lies-at cup3 shelf) (graspable cup1) (graspable cup2)
         (graspable cup3) (fits cup1 cup2) (goes-to cup1 sink) (goes-to cup2 sink) (goes-to cup3 sink)
         (free-room cup1 one) (free-room cup2 one) (free-room cup3 none)
         (= (failures cup1) 0) (= (failures cup2) 0) (= (failures cup3) 0) (= (failures can1) 0)
         (= (detours table) 0) (= (detours shelf) 0) (= (detours sink) 0) (= (detours bin) 0))
  (:goal (hand-free)))"""


@pytest.mark.parametrize(
    "texts",
    [
        ("check-room cup1 one none table", "check-room cup2 one none table", "pick-up cup1 table"),
        ("pick-up cup1 table", "stack cup1 cup2 one none table", "drive table shelf", "pick-up cup3 shelf",
         "drive shelf sink", "throw-away cup3 sink"),
        ("check-room cup2 one none table", "drive table shelf", "drive shelf table"),
    ],
)  # fmt: skip
def test_no_more_pairs_are_kept_than_by_unified_planning(texts, domain_file, clean_up, world_of):
    from unified_planning.io import PDDLReader
    from unified_planning.plans import ActionInstance, PlanKind, SequentialPlan

    from knowledge_base.pddl import read_problem

    problem = PDDLReader().parse_problem_string(domain_file.read_text(), ORACLE_PROBLEM)
    things = problem.environment.expression_manager.ObjectExp
    taken = steps(*texts)
    instances = [
        ActionInstance(problem.action(s.action), tuple(things(problem.object(a)) for a in s.args)) for s in taken
    ]
    graph = SequentialPlan(instances).convert_to(PlanKind.PARTIAL_ORDER_PLAN, problem).get_adjacency_list
    number = {id(instance): n for n, instance in enumerate(instances, start=1)}
    theirs = {(number[id(one)], number[id(after)]) for one, later in graph.items() for after in later}

    read = read_problem(ORACLE_PROBLEM, clean_up.schema).delta()
    world = world_of(clean_up.schema, read.nodes, read.added, read.values)
    order = deordered(Plan(taken), clean_up, world, parse_condition("(and)"))
    allowed = PartialOrder(taken).restricted(theirs).earlier
    assert all(order.earlier[n] <= allowed[n] for n in allowed)


def test_a_step_that_decreases_a_number_does_not_provide_the_remainder(world_of):
    domain = PlanningDomain.parse("""
(define (domain drive) (:types place) (:predicates (at ?p - place)) (:functions (fuel) (warmth))
  (:action go :parameters (?from ?to - place) :precondition (and (at ?from) (>= (- (fuel) 2) 1) (not (< (warmth) 1)))
    :effect (and (not (at ?from)) (at ?to) (decrease (fuel) 3) (decrease (warmth) 1)))
  (:action refuel :parameters () :effect (increase (fuel) 3))
  (:action heat :parameters () :effect (increase (warmth) 3)))
""")
    world = world_of(domain.schema, dict.fromkeys("abc", "place"), (fact("at", "a"),), {fact("fuel"): 3})
    order = deordered(Plan(steps("heat", "go a b", "refuel", "go b c")), domain, world, parse_condition("(at c)"))
    assert set(map(str, order.links)) == {
        "1 -(not (< (warmth) 1))-> 2", "0 -(>= (- (fuel) 2) 1)-> 2", "0 -(at a)-> 2",
        "1 -(not (< (warmth) 1))-> 4", "3 -(>= (- (fuel) 2) 1)-> 4", "2 -(at b)-> 4", "4 -(at c)-> 5",
    }  # fmt: skip
    assert order.before == {(1, 2), (2, 3), (3, 4)}


def test_a_fact_that_holds_only_during_a_step_does_not_hold_after_it(world_of):
    domain = PlanningDomain.parse("""
(define (domain paint) (:requirements :durative-actions :negative-preconditions) (:types thing)
  (:predicates (painted ?t - thing) (busy))
  (:durative-action paint :parameters (?t - thing) :duration (= ?duration 2) :condition (at start (not (busy)))
    :effect (and (at start (busy)) (at end (not (busy))) (at end (painted ?t)))))
""")
    world = world_of(domain.schema, {"pot": "thing", "lid": "thing"}, ())
    both = Plan(steps("paint pot", "paint lid"))
    goal = parse_condition("(and (painted pot) (painted lid) (not (busy)))")
    assert validate(both, domain, world, goal).valid
    assert deordered(both, domain, world, goal).before == {(1, 2)}
    with pytest.raises(InputError, match=r"needs \(busy\)"):
        deordered(both, domain, world, parse_condition("(busy)"))
