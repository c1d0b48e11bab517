from __future__ import annotations

import json

from knowledge_base.facts import Fact
from planning.engines.request import read, write_problem
from planning.model.ground_action import GroundAction
from planning.model.plan import PlanStep
from planning.model.problem import Problem

HERE, THERE = Fact("here"), Fact("there")


def problem(*costs):
    ways = (GroundAction(PlanStep(f"way{i}"), (HERE,), (THERE,), (HERE,), cost) for i, cost in enumerate(costs))
    return Problem("d", {}, (HERE,), (THERE,), tuple(ways))


def test_actions_of_one_cost_need_nothing_of_an_engine():
    assert problem(1, 1).features == frozenset()


def test_actions_of_different_costs_are_a_feature():
    assert problem(1, 2).features == {"costs"}


def test_costs_survive_json():
    assert read(json.loads(write_problem(problem(1, 2.5)))) == problem(1, 2.5)
