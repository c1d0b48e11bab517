from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.overlay import Overlay
from planning.analysis.validation import validate
from planning.model.plan import Plan, PlanStep

GOAL = parse_condition("(and (tidy cup1) (hand-free))")


def steps(*texts):
    words = (text.split() for text in texts)
    return tuple(PlanStep(name, tuple(args)) for name, *args in words)


def test_a_step_is_written_as_in_pddl():
    assert str(PlanStep("pick-up", ("cup1", "table"))) == "(pick-up cup1 table)"
    assert str(Plan(steps("hush", "press l1"))) == "(hush)\n(press l1)"


NESTED = Plan(steps("drive operator table", "pick-up cup1 table", "stack cup1 cup2 one none table"))


def test_a_plan_that_reaches_the_goal_is_valid_and_changes_nothing(clean_up, table):
    world = table(cups=2)
    version = world.version
    assert validate(NESTED, clean_up, world, GOAL).valid
    assert world.version == version


@pytest.mark.parametrize(
    ("plan", "failing_step", "why"),
    [
        (steps("drive operator table"), None, "(tidy cup1)"),
        (steps("pick-up cup1 table"), 0, "(robot-at table)"),
        (steps("drive operator table", "pick-up cup1 table", "pick-up cup2 table"), 2, "(hand-free)"),
        (steps("drive operator table", "pick-up cup1 table", "throw-away cup1 sink"), 2, "(robot-at sink)"),
        (steps("fly operator table"), 0, "no planning action 'fly'"),
        (steps("drive operator"), 0, "takes 2 arguments"),
        (steps("drive operator tabel"), 0, "tabel"),
        (steps("drive operator cup1"), 0, "(place cup1)"),
    ],
)
def test_an_invalid_plan_says_which_step_and_why(clean_up, table, plan, failing_step, why):
    found = validate(Plan(plan), clean_up, table(cups=2), GOAL)
    assert not found.valid
    assert found.failing_step == failing_step
    assert why in found.why


PROBLEM = """(define (problem p) (:domain clean-up-table)
  (:objects table shelf - surface  sink - destination  cup1 cup2 - cup)
  (:init (robot-at table) (hand-free) (one-less one none) (passable table) (passable sink) (passable shelf)
         (lies-at cup1 table) (lies-at cup2 table) (graspable cup1) (graspable cup2) (fits cup1 cup2)
         (fits cup2 cup1) (goes-to cup1 sink) (goes-to cup2 sink) (free-room cup1 one) (free-room cup2 one)
         (= (failures cup1) 0) (= (failures cup2) 0) (= (detours table) 0) (= (detours shelf) 0)
         (= (detours sink) 0))
  (:goal (hand-free)))"""
ORACLE_GOAL = parse_condition("(hand-free)")


@pytest.fixture(scope="module")
def oracle(domain_file, clean_up):
    """unified-planning's own reader and validator: `oracle(steps) -> bool`, and our world for it."""
    from unified_planning.engines import SequentialPlanValidator, ValidationResultStatus
    from unified_planning.io import PDDLReader
    from unified_planning.plans import ActionInstance, SequentialPlan

    from knowledge_base.pddl import read_problem

    problem = PDDLReader().parse_problem_string(domain_file.read_text(), PROBLEM)
    things = problem.environment.expression_manager.ObjectExp
    validator = SequentialPlanValidator()
    world = KnowledgeBase(clean_up.schema)
    world.apply(read_problem(PROBLEM, clean_up.schema).delta(), author="test")

    def valid(taken):
        chosen = [
            ActionInstance(problem.action(s.action), tuple(things(problem.object(a)) for a in s.args)) for s in taken
        ]
        result = validator.validate(problem, SequentialPlan(chosen))
        return result.status is ValidationResultStatus.VALID

    return valid, world


def _applicable(domain, world):
    """All applicable steps, found by trying every choice of arguments."""
    from planning.problem.conditions import Grounder

    grounder = Grounder(world, frozenset())
    found = []
    for action in domain.actions.values():
        for bindings in grounder.choices(action.parameters, {}):
            step = PlanStep(action.name, tuple(str(bindings[p.name]) for p in action.parameters))
            if domain.applicable(step, world):
                found.append(step)
    return found


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_validation_agrees_with_unified_planning(clean_up, oracle, data):
    """Random walks of up to six steps, sometimes with a step replaced by any other or cut off."""
    valid, world = oracle
    ahead, taken = Overlay(world), []
    for _ in range(data.draw(st.integers(0, 6))):
        step = data.draw(st.sampled_from(_applicable(clean_up, ahead)))
        ahead.apply(clean_up.effects(step, ahead))
        taken.append(step)
    if taken and data.draw(st.booleans()):
        taken.pop(data.draw(st.integers(0, len(taken) - 1)))
    assert validate(Plan(tuple(taken)), clean_up, world, ORACLE_GOAL).valid == valid(taken)


def test_validation_agrees_with_unified_planning_on_a_plan(clean_up, oracle):
    valid, world = oracle
    plan = steps("pick-up cup1 table", "stack cup1 cup2 one none table")
    assert valid(plan)
    assert validate(Plan(plan), clean_up, world, ORACLE_GOAL).valid
