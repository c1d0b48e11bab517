"""A posed problem has a plan exactly if there is one, also with numbers; whole and slice alike."""

from __future__ import annotations

import heapq
import itertools

from hypothesis import given, settings
from hypothesis import strategies as st
from searching import cheapest, solution

from knowledge_base.facts import Delta, fact
from knowledge_base.language.evaluation import holds
from knowledge_base.language.parser import parse_condition
from knowledge_base.overlay import Overlay
from knowledge_base.store import KnowledgeBase
from planning.domain import PlanningDomain
from planning.plan import PlanStep
from planning.problem import Poser, pose
from planning.validation import validate

THINGS = "ab"
FACTS = [fact("p", one) for one in THINGS] + [fact("r")]
FLUENTS = [fact("f", one) for one in THINGS] + [fact("g")]

_number = st.sampled_from(["(f ?x)", "(f a)", "(g)", "1", "2", "(+ (f ?x) (g))", "(* 2 (g))", "(limit)"])
_comparison = st.builds("({} {} {})".format, st.sampled_from(["<", ">=", "=", "!="]), _number, _number)
_literal = st.sampled_from(["(p ?x)", "(p a)", "(r)", "(not (p ?x))", "(not (r))"])
_leaf = st.one_of(_literal, _comparison)
_condition = st.one_of(
    st.just("(and)"), _leaf, st.builds("({} {} {})".format, st.sampled_from(["and", "or", "imply"]), _leaf, _leaf)
)
# What moves a number keeps it between 0 and 3, so that there are few states.
_move = st.sampled_from(
    [
        ("(< (f ?x) 3)", "(increase (f ?x) 1)"),
        ("(> (f ?x) 0)", "(decrease (f ?x) 1)"),
        ("(< (g) 3)", "(increase (g) 1)"),
        ("(and)", "(assign (g) (f ?x))"),
        ("(and)", "(assign (f ?x) (g))"),
        ("(< (f ?x) 2)", "(scale-up (f ?x) 2)"),
    ]
)
_change = st.one_of(_literal, st.builds("(when {} {})".format, _leaf, _literal))
_action = st.tuples(_condition, st.lists(_move, max_size=1), st.lists(_change, max_size=2), st.integers(0, 2))
_actions = st.lists(_action, min_size=2, max_size=4)
_start = st.tuples(st.sets(st.sampled_from(FACTS), max_size=1), st.tuples(*3 * [st.integers(0, 1)]), st.integers(0, 2))
_wanted = st.sampled_from(["(p a)", "(p b)", "(r)", "(> (f b) 1)", "(= (f a) 3)", "(>= (g) 2)", "(< (f a) (g))"])
_goal = st.one_of(
    st.builds("(and {} {})".format, _wanted, _wanted), st.builds("(or (and {0} {1}) (and {2} (not {1})))".format, *3 * [_wanted])
)


def domain_of(actions):
    def action(number, condition, moves, changes, cost):
        asked, moved = (" ".join(part) for part in zip(*moves, strict=True)) if moves else ("", "")
        effects = " ".join([moved, *changes, f"(increase (total-cost) {cost})"])
        return (
            f"(:action a{number} :parameters (?x - thing) :precondition (and {condition} {asked})"
            f" :effect (and {effects}))"
        )

    return PlanningDomain.parse(
        "(define (domain d) (:types thing) (:constants a b - thing) (:predicates (p ?t - thing) (r))"
        " (:functions (f ?t - thing) (g) (limit) (total-cost))"
        + " ".join(action(number, *parts) for number, parts in enumerate(actions))
        + ")"
    )


def world_of(domain, state, limit):
    facts, numbers = state
    world = KnowledgeBase(domain.schema)
    values = {**dict(zip(FLUENTS, numbers, strict=True)), fact("limit"): limit}
    world.apply(Delta(added=tuple(sorted(facts, key=str)), values=values), author="test")
    return world


def state_of(world):
    facts = frozenset(one for one in FACTS if world.holds(one.predicate, one.args))
    return facts, tuple(world.value(one.predicate, one.args) for one in FLUENTS)


def least_cost(domain, start, limit, goal):
    """What the cheapest plan costs, None without a plan: searched in the domain's own terms, nothing posed."""
    steps = [PlanStep(name, (arg,)) for name, arg in itertools.product(domain.actions, THINGS)]
    counter, seen = itertools.count(), set()
    agenda = [(0, next(counter), start)]
    while agenda:
        cost, _, state = heapq.heappop(agenda)
        if state in seen:
            continue
        seen.add(state)
        now = world_of(domain, state, limit)
        if holds(goal, now):
            return cost
        for step in steps:
            if domain.applicable(step, now):
                ahead = Overlay(now)
                ahead.apply(domain.effects(step, now))
                heapq.heappush(agenda, (cost + ahead.value("total-cost", ()), next(counter), state_of(ahead)))
    return None


@settings(max_examples=200, deadline=None, derandomize=True)
@given(_actions, _start, _goal)
def test_what_is_posed_has_a_plan_exactly_if_there_is_one_and_at_the_same_cost(actions, start, goal_text):
    facts, numbers, limit = start
    domain, goal, state = domain_of(actions), parse_condition(goal_text), (frozenset(facts), numbers)
    world = world_of(domain, state, limit)
    problem = pose(domain, world, goal)
    least = least_cost(domain, state, limit, goal)
    whole = problem.whole or problem
    chosen = None if problem.unreachable else cheapest(whole)
    assert (chosen and whole.cost(chosen)) == (least if chosen else chosen)
    assert (chosen is None) == (least is None)
    plan = solution(problem)
    assert (plan is None) == (least is None)
    for found in (plan, None if chosen is None else whole.plan(chosen)):
        assert found is None or validate(found, domain, world, goal).valid


@settings(max_examples=60, deadline=None, derandomize=True)
@given(_actions, st.lists(st.tuples(_start, _goal), min_size=2, max_size=3))
def test_a_poser_poses_the_same_numeric_problem_again(actions, turns):
    domain = domain_of(actions)
    poser = Poser(domain)
    for (facts, numbers, limit), goal_text in turns:
        world, goal = world_of(domain, (frozenset(facts), numbers), limit), parse_condition(goal_text)
        assert poser.pose(world, goal) == Poser(domain).pose(world, goal)
