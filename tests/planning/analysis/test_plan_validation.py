"""Our validator against unified-planning's, on small random domains and on plans found, cut and mixed up."""

from __future__ import annotations

import random

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from random_domains import ACTIONS, FLUENTS, GOAL, START, THINGS, domain_of, domain_text, world_of
from searching import solution

from knowledge_base.language.syntax.text import parse_condition, to_text
from planning.analysis.validation import validate
from planning.model.plan import Plan, PlanStep
from planning.problem.construction import build_problem


class Oracle:
    """unified-planning's reader and validator for one domain, first state and goal."""

    def __init__(self, text, state, limit, goal):
        from unified_planning.engines import SequentialPlanValidator
        from unified_planning.io import PDDLReader

        facts, numbers = state
        values = [*zip(map(str, FLUENTS), numbers, strict=True), ("(limit)", limit), ("(total-cost)", 0)]
        init = " ".join([*map(str, sorted(facts, key=str)), *(f"(= {fluent} {value})" for fluent, value in values)])
        self._problem = PDDLReader().parse_problem_string(
            text, f"(define (problem p) (:domain d) (:objects) (:init {init}) (:goal {to_text(goal)}))"
        )
        self._validator = SequentialPlanValidator()

    def valid(self, plan):
        from unified_planning.engines import ValidationResultStatus
        from unified_planning.plans import ActionInstance, SequentialPlan

        things = self._problem.environment.expression_manager.ObjectExp
        steps = [
            ActionInstance(self._problem.action(s.action), tuple(things(self._problem.object(a)) for a in s.args))
            for s in plan.steps
        ]
        result = self._validator.validate(self._problem, SequentialPlan(steps))
        return result.status is ValidationResultStatus.VALID


# Not made smaller when it fails: the oracle's reader takes a tenth of a second.
@settings(max_examples=10, deadline=None, derandomize=True, phases=[Phase.generate])
@given(ACTIONS, START, GOAL, st.integers(0, 2**16))
def test_both_judge_alike_plans_that_were_found_and_what_became_of_them(actions, start, goal_text, seed):
    facts, numbers, limit = start
    domain, goal, state = domain_of(actions), parse_condition(goal_text), (frozenset(facts), numbers)
    world = world_of(domain, state, limit)
    oracle = Oracle(domain_text(actions), state, limit, goal)
    for plan in _plans(solution(build_problem(domain, world, goal)), domain, random.Random(seed)):  # noqa: S311  a seed, no secret
        assert validate(plan, domain, world, goal).valid == oracle.valid(plan), plan


def _plans(found, domain, chance):
    """The plan, if there is one; the plan mutated; random steps."""
    steps = [PlanStep(name, (thing,)) for name in domain.actions for thing in THINGS]
    found = list(found.steps) if found else chance.choices(steps, k=2)
    yield Plan(tuple(found))
    for _ in range(9):
        other = list(found)
        for change in chance.choices(("drop", "swap", "replace", "insert"), k=chance.randint(1, 2)):
            at = chance.randrange(len(other)) if other else 0
            if change == "insert" or not other:
                other.insert(at, chance.choice(steps))
            elif change == "drop":
                del other[at]
            elif change == "replace":
                other[at] = chance.choice(steps)
            else:
                other[at], other[-1] = other[-1], other[at]
        yield Plan(tuple(other))


@pytest.mark.parametrize(("goal", "why"), [("(> (f b) 1)", "(> (f b) 1) is false: 0 < 1"), ("(r)", "(r) is false")])
def test_the_verdict_on_a_plan_names_the_goal_that_it_misses(goal, why):
    domain = domain_of([("(and)", [], ["(p ?x)"], 0)])
    world = world_of(domain, (frozenset(), (0, 0, 0)), 0)
    verdict = validate(Plan((PlanStep("a0", ("a",)),)), domain, world, parse_condition(goal))
    assert (verdict.valid, verdict.failing_step) == (False, None)
    assert verdict.why.split(":")[0] == why.split(":")[0]
