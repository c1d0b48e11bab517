"""A posed problem has a plan exactly if there is one, also with numbers; whole and slice alike."""

from __future__ import annotations

import heapq
import itertools
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from random_domains import ACTIONS, GOAL, START, THINGS, domain_of, state_of, world_of
from searching import cheapest, solution

from knowledge_base.language.evaluation.evaluator import holds
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.world.overlay import Overlay
from planning.analysis.validation import validate
from planning.model.plan import Plan, PlanStep
from planning.problem.construction import ProblemBuilder, build_problem


def least_cost(domain, start, limit, goal):
    """What the cheapest plan costs, None without a plan: searched in the domain's own terms, nothing posed."""
    steps = [PlanStep(name, (arg,)) for name, arg in itertools.product(domain.actions, THINGS)]
    counter, seen = itertools.count(), set()
    agenda: list[tuple[Any, int, Any]] = [(0, next(counter), start)]
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
@given(ACTIONS, START, GOAL)
def test_a_problem_has_a_plan_exactly_if_the_domain_has_one_of_the_same_cost(actions, start, goal_text):
    facts, numbers, limit = start
    domain, goal, state = domain_of(actions), parse_condition(goal_text), (frozenset(facts), numbers)
    world = world_of(domain, state, limit)
    problem = build_problem(domain, world, goal)
    least = least_cost(domain, state, limit, goal)
    whole = problem.whole or problem
    chosen = None if problem.unreachable else cheapest(whole)
    assert (chosen and whole.cost(chosen)) == (least if chosen else chosen)
    assert (chosen is None) == (least is None)
    plan = solution(problem)
    assert (plan is None) == (least is None)
    for found in (plan, None if chosen is None else whole.plan(chosen)):
        assert found is None or isinstance(found, Plan)
        assert found is None or validate(found, domain, world, goal).valid


@settings(max_examples=60, deadline=None, derandomize=True)
@given(ACTIONS, st.lists(st.tuples(START, GOAL), min_size=2, max_size=3))
def test_a_poser_poses_the_same_numeric_problem_again(actions, turns):
    domain = domain_of(actions)
    builder = ProblemBuilder(domain)
    for (facts, numbers, limit), goal_text in turns:
        world, goal = world_of(domain, (frozenset(facts), numbers), limit), parse_condition(goal_text)
        assert builder.build_problem(world, goal) == ProblemBuilder(domain).build_problem(world, goal)
