"""A plan mended: which end of it is kept, and when it is not worth it."""

import pytest
from breadth_first import BreadthFirst

from knowledge_base import Delta, KnowledgeBase, fact
from knowledge_base.language.syntax.text import parse_condition
from planning import Plan, PlanningDomain, PlanStep, validate
from planning.execution.plan_progress import PlanProgress, local_repair

DOMAIN = PlanningDomain.parse("""
(define (domain shopping)
  (:types shop ware)
  (:predicates (at ?s - shop) (sells ?s - shop ?w - ware) (have ?w - ware) (open ?s - shop))
  (:action go :parameters (?from ?to - shop) :precondition (and (at ?from) (open ?to)) :effect (and (not (at ?from)) (at ?to)))
  (:action buy :parameters (?w - ware ?s - shop) :precondition (and (at ?s) (sells ?s ?w)) :effect (have ?w)))
""")
GOAL = parse_condition("(and (have nut) (have egg))")
STEPS = (
    PlanStep("go", ("a", "b")),
    PlanStep("buy", ("nut", "b")),
    PlanStep("go", ("b", "c")),
    PlanStep("buy", ("egg", "c")),
)


def world(at="a", *facts):
    kb = KnowledgeBase(DOMAIN.schema)
    told = (
        fact("at", at),
        fact("sells", "b", "nut"),
        fact("sells", "c", "egg"),
        *(fact("open", s) for s in "abc"),
        *facts,
    )
    kb.apply(Delta(nodes={**dict.fromkeys("abcd", "shop"), "nut": "ware", "egg": "ware"}, added=told), "test")
    return kb


def solved(how):
    coroutine = BreadthFirst().solve(how.problem, 1.0)
    with pytest.raises(StopIteration) as answer:
        coroutine.send(None)
    return answer.value.value.plan


def test_the_nearest_end_is_kept_and_reached_in_the_fewest_steps():
    here = world("d")
    how = local_repair(PlanProgress(STEPS, DOMAIN, GOAL), set(), DOMAIN, here, GOAL)
    assert how.end == STEPS[2:]  # as near as the end with one more step, and without a way over a
    plan = how.repaired(solved(how), STEPS, DOMAIN, here, GOAL)
    assert plan is not None
    assert plan.steps == (PlanStep("go", ("d", "b")), *STEPS[1:])
    assert validate(plan, DOMAIN, here, GOAL).valid


def test_a_mended_plan_omits_what_became_useless():
    here = world("d", fact("have", "nut"))
    how = local_repair(PlanProgress(STEPS, DOMAIN, GOAL), set(), DOMAIN, world("d"), GOAL)
    plan = how.repaired(solved(how), STEPS, DOMAIN, here, GOAL)
    assert plan is not None
    assert PlanStep("buy", ("nut", "b")) not in plan.steps


def test_an_end_with_a_step_that_is_done_without_is_not_kept():
    how = local_repair(PlanProgress(STEPS, DOMAIN, GOAL), {STEPS[1]}, DOMAIN, world("d"), GOAL)
    assert how.end == STEPS[2:]
    assert local_repair(PlanProgress(STEPS, DOMAIN, GOAL), {STEPS[3]}, DOMAIN, world("d"), GOAL) is None


def test_a_missing_condition_that_no_action_achieves_is_not_repaired():
    here = world("d")
    here.apply(Delta(removed=(fact("sells", "c", "egg"),)), "test")
    assert local_repair(PlanProgress(STEPS, DOMAIN, GOAL), set(), DOMAIN, here, GOAL) is None


def test_a_plan_with_too_many_missing_conditions_is_not_repaired():
    here = world("d")
    here.apply(Delta(removed=(fact("open", "b"), fact("open", "c"), fact("sells", "b", "nut"))), "test")
    assert local_repair(PlanProgress(STEPS, DOMAIN, GOAL), set(), DOMAIN, here, GOAL) is None


def test_a_mended_plan_that_is_much_longer_or_wrong_is_not_taken():
    here = world("d")
    how = local_repair(PlanProgress(STEPS, DOMAIN, GOAL), set(), DOMAIN, here, GOAL)
    round_trip = [PlanStep("go", way) for way in (("d", "a"), ("a", "d"), ("d", "a"), ("a", "b"))]
    assert how.repaired(Plan(tuple(round_trip)), STEPS, DOMAIN, here, GOAL) is None
    assert how.repaired(Plan(()), STEPS, DOMAIN, here, GOAL) is None
