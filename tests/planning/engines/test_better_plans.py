"""A plan that is found later replaces the rest of one on its way if it costs less, not if it only has fewer steps."""

from __future__ import annotations

import asyncio

import pytest
from obedient_robot import ObedientRobot, plots

from dsc.dynamic.library import Library
from knowledge_base import Delta, KnowledgeBase, fact
from planning import Plan, PlanningDomain, PlanStep, Robot
from planning.execution.step_costs import StepCosts
from planning.model.plan import EngineFailed, PlanFound

TRIP = """(define (domain trip) (:types place) (:predicates (at ?p - place) (packed) (road ?a ?b - place))
  (:functions (total-cost) (toll ?a ?b - place))
  (:action pack :effect (and (packed) (increase (total-cost) 1)))
  (:action drive :parameters (?a ?b - place) :precondition (and (packed) (at ?a) (road ?a ?b))
    :effect (and (not (at ?a)) (at ?b) (increase (total-cost) (toll ?a ?b)))))
"""
FREE = TRIP.replace("(total-cost)", "(driven)")
SHORT, LONG = ("pack", "drive a c"), ("pack", "drive a b", "drive b c")


def steps(texts):
    return tuple(PlanStep(one.split()[0], tuple(one.split()[1:])) for one in texts)


def trip(text):
    """From a to c it is 10 straight on, and 6 through b."""
    domain = PlanningDomain.parse(text)
    world = KnowledgeBase(domain.schema)
    tolls = {("a", "c"): 10, ("a", "b"): 3, ("b", "c"): 3}
    added = (fact("at", "a"), *(fact("road", *pair) for pair in tolls))
    values = {fact("toll", *pair): toll for pair, toll in tolls.items()}
    world.apply(Delta(nodes=dict.fromkeys("abc", "place"), added=added, values=values), "test")
    return domain, world


class Later:
    """Finds one plan at first, and another one when the first step has begun."""

    def __init__(self, first, second):
        self.first, self.second = first, second
        self.begun, self.weighed = asyncio.Event(), asyncio.Event()

    async def solve(self, problem, seconds):
        return self.first

    async def plans(self, problem, seconds):
        yield self.first
        await self.begun.wait()
        yield self.second
        self.weighed.set()  # who asks for a third plan has decided about the second

    def receive(self, record):
        if record.data.get("skill") == "robot.act":
            self.begun.set()


@pytest.mark.parametrize(
    ("text", "first", "second", "taken"),
    [
        (TRIP, SHORT, LONG, True),
        (TRIP, LONG, SHORT, False),
        (FREE, SHORT, LONG, False),
        (FREE, LONG, SHORT, True),
    ],
)
def test_the_cheaper_plan_is_carried_out_and_without_costs_the_shorter_one(text, first, second, taken):
    domain, world = trip(text)
    planner = Later(*(PlanFound(Plan(steps(one)), "fake", 0.0, 0.1) for one in (first, second)))
    robot = ObedientRobot(domain, seconds=0.0, until=planner.weighed)
    robot.knowledge = world
    program = Robot(domain, plots(domain), [robot], world, planner=planner, clock="real")
    program.listen(planner.receive)
    end = program.achieve("(at c)")
    assert (end.finished, end.emitted) == (True, ())
    assert robot.done == [f"({one})" for one in (second if taken else first)]


@pytest.mark.parametrize(("text", "costs"), [(TRIP, (11, 7)), (FREE, (2, 3))])
def test_the_cost_of_a_plan_is_the_total_cost_or_one_per_step(text, costs):
    domain, world = trip(text)
    cost = StepCosts(domain, Library()).total
    assert tuple(cost(steps(one), domain, world) for one in (SHORT, LONG)) == costs
    assert world.ask("(at a)")


@pytest.mark.parametrize("failures", [(), (EngineFailed("other", "it crashed"),)])
def test_the_record_of_a_found_plan_names_the_engines_that_failed(failures):
    domain, world = trip(TRIP)
    robot = ObedientRobot(domain)
    robot.knowledge = world
    found = PlanFound(Plan(steps(SHORT)), "fake", 0.0, 0.1, failures=failures)
    program, told = Robot(domain, plots(domain), [robot], world, planner=Later(found, found), clock="simulated"), []
    program.listen(lambda record: told.append(record.data) if record.type == "plan.found" else None)
    program.achieve("(at c)")
    expected = [[{"engine": "other", "message": "it crashed"}]] if failures else [None]
    assert [data.get("failures") for data in told] == expected
