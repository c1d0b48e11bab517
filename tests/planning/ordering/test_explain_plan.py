"""Why a step is in a plan, said with the facts that it brings about."""

import pytest

from knowledge_base.errors import InputError
from knowledge_base.language.syntax.text import parse_condition
from planning.model.plan import Plan, PlanStep
from planning.ordering.causal_tracing import deordered
from planning.ordering.partial_order import why

GOAL = parse_condition("(and (tidy cup1) (hand-free))")


def steps(*texts):
    words = (text.split() for text in texts)
    return tuple(PlanStep(name, tuple(args)) for name, *args in words)


def purposes(plan, *of):
    order = deordered(plan, *of)
    return [why(order, number) for number in range(1, len(plan.steps) + 1)]


def test_every_step_says_what_it_brings_about_for_whom_and_what_that_serves(clean_up, table):
    plan = Plan(steps("drive operator table", "pick-up cup1 table", "stack cup1 cup2 one none table"))
    assert list(map(str, purposes(plan, clean_up, table(cups=2), GOAL))) == [
        "1 (drive operator table): (robot-at table) for step 2; (robot-at table) for step 3; serves (tidy cup1) (hand-free)",
        "2 (pick-up cup1 table): (holding cup1) for step 3; serves (tidy cup1) (hand-free)",
        "3 (stack cup1 cup2 one none table): (tidy cup1) (hand-free) for the goal",
    ]


def test_a_step_that_is_of_no_use_says_so(clean_up, table):
    plan = Plan(steps("drive operator shelf", "drive shelf operator"))
    first, second = purposes(plan, clean_up, table(), parse_condition("(hand-free)"))
    assert str(first) == "1 (drive operator shelf): (robot-at shelf) for step 2"
    assert str(second) == "2 (drive shelf operator): nothing needs what it does"


def test_a_plan_that_does_not_lead_to_the_goal_has_no_purposes(clean_up, table):
    plan = Plan(steps("pick-up cup1 table"))
    with pytest.raises(InputError, match=r"does not lead to the goal: \(pick-up cup1 table\) needs \(robot-at table\)"):
        purposes(plan, clean_up, table(cups=1), GOAL)
