from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

from fake_engines import FIRST, GOAL, PROBLEM, SECOND, START

from planning.engines.race import CachingPlanner
from planning.model.plan import Plan, PlanFound, ProvenUnsolvable, TimedOut
from planning.model.problem import Problem

assert FIRST.step is not None
assert SECOND.step is not None
FOUND = PlanFound(Plan((FIRST.step, SECOND.step)), "fake", 1.5, 0.2, cost=2)


class Counting:
    """A planner that always says the same and counts how often it is asked."""

    def __init__(self, *outcomes):
        self.outcomes, self.asked = outcomes, 0

    async def plans(self, problem, seconds):
        self.asked += 1
        for outcome in self.outcomes:
            yield outcome


def solve(planner, *problems):
    async def run():
        return [await planner.solve(one, 5) for one in problems]

    return asyncio.run(run())


def test_the_same_problem_is_asked_once_and_the_answer_says_so():
    counting: Any = Counting(FOUND)
    first, second = solve(CachingPlanner(counting), PROBLEM, replace(PROBLEM, init=tuple(reversed(PROBLEM.init))))
    assert counting.asked == 1
    assert first == FOUND
    assert second.from_cache
    assert second.plan == FOUND.plan
    assert second.simulated_seconds == FOUND.simulated_seconds  # so that a run does not depend on what was run before


def test_a_problem_that_differs_in_any_part_is_solved_anew():
    counting: Any = Counting(FOUND)
    others = [
        replace(PROBLEM, init=(START, GOAL)),
        replace(PROBLEM, goal=(START,)),
        replace(PROBLEM, actions=(FIRST, replace(SECOND, cost=2.0))),
        Problem("e", {}, PROBLEM.init, PROBLEM.goal, PROBLEM.actions),
    ]
    solve(CachingPlanner(counting), PROBLEM, *others)
    assert counting.asked == 1 + len(others)


def test_a_proof_is_remembered_and_running_out_of_time_is_not():
    for outcome, asked in [(ProvenUnsolvable("fake", "no"), 1), (TimedOut("fake", 5), 2)]:
        counting: Any = Counting(outcome)
        solve(CachingPlanner(counting), PROBLEM, PROBLEM)
        assert counting.asked == asked


def test_a_full_cache_drops_the_least_recently_used_problem():
    counting: Any = Counting(FOUND)
    one, two, three = (replace(PROBLEM, domain=name) for name in "abc")
    solve(CachingPlanner(counting, largest=2), one, two, one, three, one)
    assert counting.asked == 3
    solve(CachingPlanner(counting, largest=2), one, two, three, one)
    assert counting.asked == 7


def test_the_best_that_was_found_is_remembered():
    async def run():
        counting: Any = Counting(FOUND, replace(FOUND, cost=1))
        caching = CachingPlanner(counting)
        costs = [found.cost async for found in caching.plans(PROBLEM, 5)]
        again = [found.cost async for found in caching.plans(PROBLEM, 5)]
        return costs, again

    assert asyncio.run(run()) == ([2, 1], [1])
