"""A wrong plan of a planner is recorded with its step and condition, and the planner is asked again with the reason."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from dsc import Component, Outcome, RunEnd, SkillCall, primitive_plot, skill
from dsc.trace import Record
from knowledge_base import Delta, fact
from planning import Plan, PlanStep, Robot
from planning.execution.search import MAX_REJECTED
from planning.model.plan import PlanFound, PlanningOutcome
from planning.model.problem import Problem
from planning.robot.tally import Tally

DOMAIN = """
(define (domain house)
  (:types room)
  (:predicates (at ?r - room) (door ?a ?b - room))
  (:action go :parameters (?a ?b - room) :precondition (and (at ?a) (door ?a ?b))
    :effect (and (not (at ?a)) (at ?b))))
"""
RIGHT = [("go", "hall", "bath"), ("go", "bath", "loft")]
DOWN = [("go", "hall", "loft")]
SHORT = RIGHT[:1]
UNKNOWN = [("fly", "hall", "loft")]
NOWHERE = [("go", "hall", "attic")]


class Arrived(Outcome): ...


class Base(Component):
    """Drives anywhere."""

    name = "base"

    @skill
    async def drive(self, call: SkillCall, a: str, b: str) -> Arrived:
        return Arrived(observed=Delta(added=(fact("at", b),), removed=(fact("at", a),)))


class Guesses:
    """A planner that answers with these plans, the last one for ever, and keeps what it was told."""

    def __init__(self, *plans: Sequence[tuple[str, ...]]) -> None:
        self.plans = list(plans)
        self.told: list[list[str]] = []

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        self.told.append([wrong.reason for wrong in problem.wrong])
        steps = self.plans.pop(0) if len(self.plans) > 1 else self.plans[0]
        return PlanFound(Plan(tuple(PlanStep(name, tuple(args)) for name, *args in steps)), "guesses", 0.0, 0.1)


def run(planner: Guesses, seconds: float = 60) -> tuple[RunEnd, list[Record], Tally]:
    base, records, tally = Base(), list[Record](), Tally()
    plot = primitive_plot(base.skills()["drive"], done="arrived", implements="go")
    with Robot(DOMAIN, [plot], [base], planner=planner, clock="simulated") as robot:
        robot.listen(records.append)
        robot.listen(tally)
        rooms = dict.fromkeys(("hall", "bath", "loft"), "room")
        facts = (fact("at", "hall"), fact("door", "hall", "bath"), fact("door", "bath", "loft"))
        robot.knowledge.apply(Delta(nodes=rooms, added=facts), "me")
        return robot.achieve("(at loft)", seconds=seconds), records, tally


def test_the_planner_is_asked_again_with_step_and_condition_of_each_wrong_plan() -> None:
    planner = Guesses(DOWN, SHORT, UNKNOWN, NOWHERE, RIGHT)
    end, records, tally = run(planner)
    wrong = [one.data for one in records if one.type == "plan.wrong"]
    reasons = ["(go hall loft): (door hall loft) is false", "(at loft) is false"]
    assert end
    assert [one["reason"] for one in wrong[:2]] == reasons
    assert [one["step"] for one in wrong] == ["(go hall loft)", None, "(fly hall loft)", "(go hall attic)"]
    assert "fly" in wrong[2]["reason"]
    assert planner.told[:3] == [[], reasons[:1], reasons]
    assert (tally.plans, tally.wrong_plans) == (1, 4)


@pytest.mark.parametrize(("seconds", "asked"), [(60, MAX_REJECTED + 1), (0.001, 1)])
def test_the_goal_is_abandoned_when_number_or_time_is_used_up(seconds: float, asked: int) -> None:
    planner = Guesses(DOWN)
    end, records, tally = run(planner, seconds)
    assert not end
    assert len(planner.told) <= asked
    assert tally.wrong_plans == len(planner.told)
    if asked > 1:
        (none,) = [one.data for one in records if one.type == "plan.none"]
        assert none["kind"] == "failed"
        assert none["reason"] == (
            "the plan found does not lead to the goal: (go hall loft): (door hall loft) is false"
            " (guesses, the last of 6 wrong plans)"
        )
