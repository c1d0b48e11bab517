"""Kairos on random problems with numbers, with durations, and without a plan: valid plans, equal ones in each run."""

from __future__ import annotations

import json
import multiprocessing
import os
import random
from itertools import pairwise
from typing import Any

import pytest
from unified_planning.engines import SequentialPlanValidator
from unified_planning.plans import ActionInstance, SequentialPlan

from dsc import Component, Outcome, SkillCall, primitive_plot, skill
from knowledge_base import Delta, KnowledgeBase, fact
from knowledge_base.facts import Fact
from knowledge_base.language.syntax.text import parse_condition
from planning.analysis.validation import validate
from planning.engines.process import Deadline, EngineProcess, worker
from planning.engines.registry import engine
from planning.engines.request import read, write_problem
from planning.model.domain import PlanningDomain
from planning.model.ground_action import GroundAction
from planning.model.plan import Plan, PlanStep
from planning.model.problem import Problem
from planning.model.quantities import Assignment, NumericBound
from planning.problem.construction import build_problem
from planning.robot.robot import Robot

pytestmark = pytest.mark.skipif(bool(engine("kairos").lacks()), reason=f"kairos: {engine('kairos').lacks()}")

NUMBERS = PlanningDomain.parse("""
    (define (domain rover) (:requirements :typing :numeric-fluents) (:types place)
      (:predicates (at ?p - place) (link ?a ?b - place) (done ?p - place) (socket ?p - place))
      (:functions (battery) (toll ?a ?b - place))
      (:action go :parameters (?a ?b - place)
        :precondition (and (at ?a) (link ?a ?b) (>= (battery) (+ 1 (toll ?a ?b))))
        :effect (and (not (at ?a)) (at ?b) (decrease (battery) (toll ?a ?b))))
      (:action charge :parameters (?a - place) :precondition (and (at ?a) (socket ?a) (< (battery) 12))
        :effect (assign (battery) (+ (battery) 7.5)))
      (:action work :parameters (?a - place) :precondition (at ?a) :effect (done ?a)))""")
TIME = PlanningDomain.parse("""
    (define (domain kitchen) (:requirements :typing :durative-actions) (:types pot)
      (:predicates (free) (hot ?p - pot) (boiled ?p - pot) (served ?p - pot) (raw ?p - pot))
      (:durative-action heat :parameters (?p - pot) :duration (and (>= ?duration 4) (<= ?duration 6))
        :condition (and (at start (free)) (at start (raw ?p)))
        :effect (and (at start (not (free))) (at start (hot ?p)) (at end (not (hot ?p))) (at end (free))))
      (:durative-action boil :parameters (?p - pot) :duration (= ?duration 3)
        :condition (and (over all (hot ?p))) :effect (at end (boiled ?p)))
      (:durative-action serve :parameters (?p - pot) :duration (= ?duration 1)
        :condition (and (at start (boiled ?p)) (at start (free))) :effect (at end (served ?p))))""")


@pytest.fixture(scope="module")
def kairos():
    process = EngineProcess(worker("kairos"))
    process.start(60)
    yield process
    process.kill()


def answer(process, problem):
    heard: list[Any] = []
    process.ask(write_problem(problem), Deadline(60), heard.append)
    return heard[-1]


def numeric(seed, *, reachable=True):
    draw = random.Random(seed)  # noqa: S311  no secret depends on it
    places = [f"p{n}" for n in range(draw.randint(3, 6))]
    links = list(pairwise(places)) + [tuple(draw.sample(places, 2)) for _ in range(3)]
    world = KnowledgeBase(NUMBERS.schema)
    facts = [
        fact("at", places[0]),
        *(fact("link", *one) for one in links),
        *(fact("socket", one) for one in places[::2]),
    ]
    world.apply(
        Delta(nodes=dict.fromkeys(places, "place"), added=tuple(dict.fromkeys(facts if reachable else facts[:1]))),
        "test",
    )
    with world.transaction(author="test") as change:
        change.set("battery", draw.choice([-3.5, 0, 2, 8]))
        for one in set(links):
            change.set("toll", *one, draw.choice([1, 2.25, 6]))
    goal = f"(and (done {places[-1]}) (done {places[0]}) (>= (battery) {draw.choice([0, 3])}))"
    return build_problem(NUMBERS, world, parse_condition(goal))


def timed(seed):
    draw = random.Random(seed)  # noqa: S311  no secret depends on it
    pots = [f"pot{n}" for n in range(draw.randint(1, 4))]
    world = KnowledgeBase(TIME.schema)
    world.apply(
        Delta(nodes=dict.fromkeys(pots, "pot"), added=(fact("free"), *(fact("raw", one) for one in pots))), "test"
    )
    goal = parse_condition(f"(and {' '.join(f'(served {one})' for one in pots)})")
    problem = build_problem(TIME, world, goal, durations=True)
    assert problem.timed is not None
    return problem.timed


@pytest.mark.parametrize("seed", range(30))
def test_a_plan_with_numbers_is_valid_here_and_in_unified_planning(kairos, seed):
    from planning.engines.up import translated

    problem = numeric(seed)
    found = answer(kairos, problem)
    if found["actions"] is None:
        pytest.skip("no plan exists")
    assert isinstance(problem.plan(found["actions"]), Plan)
    theirs = translated(problem)
    steps = [ActionInstance(theirs.action(f"a{number}")) for number in found["actions"]]
    with SequentialPlanValidator(environment=theirs.environment) as validator:
        assert validator.validate(theirs, SequentialPlan(steps, theirs.environment)).status.name == "VALID"
    assert answer(kairos, problem)["actions"] == found["actions"]


@pytest.mark.parametrize("seed", range(15))
def test_a_plan_with_durations_is_valid_and_the_same_again(kairos, seed):
    problem = timed(seed)
    found = answer(kairos, problem)["timed"]
    assert isinstance(problem.scheduled([tuple(one) for one in found]), Plan)
    assert answer(kairos, problem)["timed"] == found


BOTH = PlanningDomain.parse("""(define (domain farm) (:types row)
  (:predicates (at ?r - row) (linked ?a ?b - row) (sprayed ?r - row) (socket ?r - row) (still))
  (:functions (battery) (tank) (need ?r - row) (far ?a ?b - row))
  (:durative-action drive :parameters (?a ?b - row) :duration (= ?duration (far ?a ?b))
    :condition (and (at start (at ?a)) (at start (linked ?a ?b)) (at start (>= (battery) (far ?a ?b))))
    :effect (and (at start (not (at ?a))) (at end (at ?b)) (at end (decrease (battery) (far ?a ?b)))))
  (:durative-action charge :parameters (?r - row) :duration (and (>= ?duration 2) (<= ?duration 5))
    :condition (and (over all (at ?r)) (over all (socket ?r)) (at end (<= (battery) 20)))
    :effect (at end (increase (battery) 9)))
  (:durative-action fill :parameters (?r - row) :duration (= ?duration 3)
    :condition (and (over all (at ?r)) (over all (socket ?r)) (over all (>= (battery) 1)))
    :effect (at end (assign (tank) 10)))
  (:durative-action spray :parameters (?r - row) :duration (= ?duration (* 2 (need ?r)))
    :condition (and (over all (at ?r)) (at start (>= (tank) (need ?r))))
    :effect (and (at start (decrease (tank) (need ?r))) (at end (sprayed ?r)))))""")


def farm(seed):
    draw = random.Random(seed)  # noqa: S311  no secret depends on it
    rows = [f"r{n}" for n in range(draw.randint(2, 5))]
    links = [pair for one in pairwise(rows) for pair in (one, one[::-1])]
    world = KnowledgeBase(BOTH.schema)
    facts = [fact("at", rows[0]), fact("socket", rows[0]), *(fact("linked", *one) for one in links)]
    values = {fact("battery"): draw.choice([0.5, 2, 8]), fact("tank"): 0}
    values |= {fact("need", one): draw.choice([2, 3.5]) for one in rows}
    values |= {fact("far", *one): draw.choice([1, 1.5]) for one in links}
    world.apply(Delta(nodes=dict.fromkeys(rows, "row"), added=tuple(facts), values=values), "test")
    goal = f"(and {' '.join(f'(sprayed {one})' for one in rows[-2:])} (>= (battery) {draw.choice([0, 3])}))"
    return world, parse_condition(goal)


@pytest.mark.parametrize("seed", range(15))
def test_a_plan_with_numbers_and_durations_is_valid_in_the_ground_problem_and_in_the_domain(kairos, seed):
    world, goal = farm(seed)
    problem = build_problem(BOTH, world, goal, durations=True).timed
    assert problem is not None
    assert problem.features >= {"numeric", "durations"}
    assert read(json.loads(write_problem(problem))) == problem
    found = answer(kairos, problem)["timed"]
    plan = problem.scheduled([tuple(one) for one in found])
    assert isinstance(plan, Plan), plan
    assert validate(plan, BOTH, world, goal).valid
    assert answer(kairos, problem)["timed"] == found


def test_a_number_that_durative_actions_cannot_reach_is_no_plan(kairos):
    world, _ = farm(0)
    problem = build_problem(BOTH, world, parse_condition("(> (tank) 10)"), durations=True).timed
    assert problem is None or problem.unreachable or answer(kairos, problem)["actions"] is None


@pytest.mark.parametrize("seed", range(5))
def test_without_a_way_there_is_no_plan(kairos, seed):
    problem = numeric(seed, reachable=False)
    assert problem.unreachable or answer(kairos, problem)["actions"] is None


def test_a_search_without_enough_memory_fails_and_the_worker_goes_on():
    weights = [2.0 * (k + 1) ** 2 + 2 * k for k in range(24)]
    free, total = [Fact("free", (f"i{k}",)) for k in range(24)], Fact("total")
    actions = tuple(
        GroundAction(
            PlanStep("take", (str(one.args[0]),)), (one,), (), (one,), assignments=(Assignment(total, weight, True),)
        )
        for one, weight in zip(free, weights, strict=True)
    )
    odd = NumericBound("=", total, float(int(sum(weights)) // 2 | 1))  # all weights are even: no plan, found by search
    problem = Problem("knapsack", {}, tuple(free), (), actions, numbers={total: 0.0}, bounds=(odd,))
    process = EngineProcess(worker("kairos", megabytes=150))
    process.start(60)
    assert answer(process, problem)["failed"] == "it ran out of memory"
    assert answer(process, numeric(0))["actions"]
    process.kill()


class Went(Outcome): ...


class Rover(Component):
    """A rover whose program is killed during its action number `last`."""

    def __init__(self, last: int | None = None) -> None:
        super().__init__()
        self.last, self.begun = last, 0

    @skill(after_crash="repeat")
    async def act(self, call: SkillCall) -> Went:
        self.begun += 1
        if self.begun == self.last:
            os._exit(9)
        await call.clock.sleep(1.0)
        return Went()


def rover_robot(store, last=None):
    rover = Rover(last)
    plots = [
        primitive_plot(rover.skills()["act"], name=name, done="went", implements=name, effects="assumed")
        for name in ("go", "charge", "work")
    ]
    return Robot(NUMBERS, plots, [rover], clock="simulated", store=store)


def run_until_killed(store, last):
    with rover_robot(store, last) as robot:
        nodes = dict.fromkeys("ab", "place")
        facts = (fact("at", "a"), fact("link", "a", "b"), fact("link", "b", "a"), fact("socket", "a"))
        robot.knowledge.apply(Delta(nodes=nodes, added=facts), "test")
        with robot.knowledge.transaction(author="test") as change:
            change.set("battery", 1)
            change.set("toll", "a", "b", 4)
        robot.achieve("(done b)")


@pytest.mark.parametrize("last", [1, 2, 3])
def test_a_run_with_numbers_is_killed_and_resumed(tmp_path, last):
    killed = multiprocessing.get_context("fork").Process(target=run_until_killed, args=(tmp_path / "run.kb", last))
    killed.start()
    killed.join(60)
    assert killed.exitcode == 9
    with rover_robot(tmp_path / "run.kb") as robot:
        assert robot.resume().finished
        assert robot.knowledge.ask("(done b)")
        assert robot.knowledge.value("battery", ()) == 4.5
