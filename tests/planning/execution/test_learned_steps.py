"""Plans by experience: the tries of their steps are learned, are the costs of steps, and choose their candidates."""

from __future__ import annotations

import heapq
from dataclasses import replace
from itertools import count
from typing import Any

import pytest
from errands import DOMAIN, HOLDER, ROOMS, ROUND
from obedient_robot import FAILED, ObedientRobot, plots

from dsc import parse_plot
from dsc.dynamic.experience import Experience, Tries, step_situation
from dsc.dynamic.library import Library
from dsc.runs.learning import tries_in
from dsc.text.experience import experience_to_yaml, parse_experience
from dsc.trace import Record
from knowledge_base import Delta, fact
from knowledge_base.language.syntax.text import parse_condition
from planning import PlanningDomain, PlanStep, Robot
from planning.execution.step_costs import StepCosts
from planning.model.plan import Plan, PlanFound, ProvenUnsolvable
from planning.model.problem import WrongPlan
from planning.problem.construction import build_problem

SHORT, LONG = ["(go a b)", "(go b c)"], ["(go a d)", "(go d e)", "(go e c)"]
LINKS = ("a b", "b c", "a d", "d e", "e c")


class Cheapest:
    """A planner: uniform-cost search, which remembers each problem."""

    def __init__(self):
        self.asked = []

    async def solve(self, problem, seconds):
        self.asked.append(problem)
        number, start = count(), frozenset(problem.init)
        agenda: list[Any] = [(0.0, next(number), start, ())]
        seen = set()
        while agenda:
            cost, _, state, way = heapq.heappop(agenda)
            if all(fact in state for fact in problem.goal):
                return PlanFound(problem.plan(way), "cheapest", 0.0, problem.simulated_seconds, cost=cost)
            if state in seen:
                continue
            seen.add(state)
            for index, action in enumerate(problem.actions):
                if action.applicable(state):
                    heapq.heappush(agenda, (cost + action.cost, next(number), action.apply(state), (*way, index)))
        return ProvenUnsolvable("cheapest", "all states were visited")


def tries(text, number, done, seconds, way="go"):
    return (text.strip("()").split()[0], way, step_situation(text)), Tries(number, done, seconds)


CLOSED = Experience().plus([
    tries("(go b c)", 20, 2, 200.0), *(tries(step, 20, 20, 20.0) for step in ("(go a b)", *LONG)),
])  # fmt: skip
"""The door between b and c is mostly closed."""


def ran(goal, *, experience=None, script=None, ways=None, links=LINKS):
    """Run an errand; return the robot's component, the records and the planner."""
    planner, component = Cheapest(), ObedientRobot(DOMAIN, script)
    holder = parse_plot(HOLDER.replace("GOAL", goal).replace("REPLANS", "4"))
    robot = Robot(
        DOMAIN, [holder, *plots(DOMAIN, ways)], [component], planner=planner, clock="simulated", experience=experience
    )
    component.knowledge = robot.knowledge
    told = [fact("at", "a"), fact("in", "cup", "a"), *(fact("way", *one.split()) for one in links)]
    robot.knowledge.apply(Delta({**dict.fromkeys((*ROOMS, "e"), "room"), "cup": "thing"}, added=tuple(told)), "test")
    records: list[Record] = []
    robot.listen(records.append)
    with robot:
        robot.run("errand")
    return component, records, planner


# -- learning --------------------------------------------------------------------------------------------


def test_steps_of_plans_are_tries_of_their_action():
    _, records, _ = ran("(at c)", script={"(go b c)": [FAILED]})
    found = Experience().plus(tries_in(records, steps=True))
    assert found.tries == dict([tries("(go a b)", 1, 1, 1.0), tries("(go b c)", 2, 1, 2.0)])


def test_each_candidate_of_a_step_has_its_tries():
    _, records, _ = ran("(holding cup)", script={"hand: (take cup a)": [FAILED] * 9}, ways={"take": ["hand", "tongs"]})
    found = Experience().plus(tries_in(records, steps=True))
    assert found.tries == dict([tries("(take cup a)", 2, 0, 2.0, "hand"), tries("(take cup a)", 1, 1, 1.0, "tongs")])


def test_the_experience_of_steps_is_kept_as_yaml():
    assert parse_experience(experience_to_yaml(CLOSED)) == CLOSED


# -- costs -----------------------------------------------------------------------------------------------


def test_a_plan_takes_the_way_that_succeeds_sooner():
    assert ran("(at c)")[0].done == SHORT
    assert ran("(at c)", experience=CLOSED)[0].done == LONG


def test_experience_without_steps_leaves_the_costs_of_plans():
    other = Experience().plus([(("main", "hand", ()), Tries(4, 2, 8.0))])
    _, _, planner = ran("(at c)", experience=other)
    assert {action.cost for action in planner.asked[0].actions} == {1.0}


def world_of(domain, things=("cup",)):
    planner = Cheapest()
    robot = Robot(domain, plots(domain), [ObedientRobot(domain)], planner=planner, clock="simulated")
    told = [fact("at", "a"), *(fact("in", one, "a") for one in things), *(fact("way", *one.split()) for one in ROUND)]
    robot.knowledge.apply(
        Delta({**dict.fromkeys(ROOMS, "room"), **dict.fromkeys(things, "thing")}, added=tuple(told)), "test"
    )
    return robot.knowledge


def costs_of(experience, domain=DOMAIN):
    library = Library()
    library.experience = experience
    return StepCosts(domain, library)


def test_the_cost_of_a_step_is_its_expected_time_with_the_prior_of_its_action():
    costs = costs_of(CLOSED)
    all_done, all_seconds = 5 * (82 + 1) / (100 + 2), 5 * 280 / 100
    expected = (200 + all_seconds) / (2 + all_done)
    assert costs.total([PlanStep("go", ("b", "c"))], DOMAIN, None) == round(expected, 1)
    never = PlanStep("go", ("c", "b"))
    assert costs.total([never], DOMAIN, None) == round(all_seconds / all_done, 1)
    assert costs.total([PlanStep("take", ("cup", "a"))], DOMAIN, None) == costs.total([never], DOMAIN, None)


def test_a_step_without_duration_costs_less_than_the_mean():
    known = Experience().plus([tries("(take cup a)", 5, 5, 0.0, "take"), tries("(go a b)", 5, 5, 50.0)])
    assert costs_of(known).total([PlanStep("take", ("cup", "a"))], DOMAIN, None) == 0.1


def test_of_equal_ways_the_one_that_succeeds_sooner_is_taken():
    links = ("a b", "b c", "a d", "d c")
    bad, good = (Experience().plus([tries("(go b c)", 20, done, 20.0), tries("(go d c)", 20, 20 - done, 20.0)])
                 for done in (1, 19))  # fmt: skip
    assert ran("(at c)", experience=bad, links=links)[0].done == ["(go a d)", "(go d c)"]
    assert ran("(at c)", experience=good, links=links)[0].done == ["(go a b)", "(go b c)"]


def test_objects_that_others_can_replace_are_not_left_out_since_they_may_be_cheaper(clean_up, table):
    problem = build_problem(
        clean_up, table(cups=2, robot_at="table"), parse_condition("(forall (?i - item) (tidy ?i))")
    )
    assert "shelf" not in problem.objects
    known = Experience().plus([tries("(drive table shelf)", 5, 5, 5.0, "drive")])
    told = replace(problem, one_at_a_time=True, timed=problem, wrong=(WrongPlan(Plan(), "no step"),))
    priced = costs_of(known, clean_up).price(told)
    assert "shelf" in priced.objects
    assert (priced.one_at_a_time, priced.timed, priced.wrong) == (True, problem, told.wrong)


def test_a_disjunctive_goal_costs_nothing_more():
    problem = build_problem(DOMAIN, world_of(DOMAIN), parse_condition("(or (at b) (at d))"))
    priced = costs_of(CLOSED).price(problem)
    assert {action.cost for action in priced.actions if action.step is None} == {0.0}
    assert all(action.cost > 1 for action in priced.actions if action.step is not None)


def test_declared_costs_precede_experience():
    text = DOMAIN.to_pddl().replace("(:predicates", "(:functions (total-cost) - number)\n(:predicates", 1)
    text = text.replace("(at ?to))", "(at ?to) (increase (total-cost) 3))", 1)
    domain = PlanningDomain.parse(text)
    assert (
        costs_of(CLOSED, domain).price(problem := build_problem(domain, world_of(domain), parse_condition("(at c)")))
        is problem
    )


# -- choosing the candidates of steps ----------------------------------------------------------------------

CLUMSY = Experience().plus([
    tries("(take cup a)", 20, 4, 20.0, "hand"), tries("(take cup a)", 20, 20, 60.0, "tongs"),
])  # fmt: skip


@pytest.mark.parametrize(("experience", "way"), [(None, "hand"), (CLUMSY, "tongs")])
def test_a_step_takes_the_candidate_that_succeeds_sooner(experience, way):
    component, records, _ = ran("(holding cup)", experience=experience, ways={"take": ["hand", "tongs"]})
    assert component.done == [f"{way}: (take cup a)"]
    decision = next(one.data for one in records if one.type == "decision" and one.data["chosen"] == way)
    assert decision.get("by") == (None if experience is None else "learned")


def test_a_failed_candidate_is_tried_last_although_it_was_the_best():
    script = {"tongs: (take cup a)": [FAILED] * 9}
    component, _, _ = ran("(holding cup)", experience=CLUMSY, script=script, ways={"take": ["hand", "tongs"]})
    assert component.done == [*["tongs: (take cup a)"] * 2, "hand: (take cup a)"]
