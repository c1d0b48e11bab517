from __future__ import annotations

import asyncio

import pytest
from fake_engines import answering, planner
from hypothesis import given
from hypothesis import strategies as st

from knowledge_base.facts import Fact
from planning.engines.action_elimination import indispensable
from planning.model.ground_action import GroundAction
from planning.model.plan import Plan, PlanStep
from planning.model.problem import Problem
from planning.model.quantities import Assignment, NumericBound

HOME, AWAY, DONE = Fact("at", ("home",)), Fact("at", ("away",)), Fact("done")
ENERGY = Fact("energy")
GO = GroundAction(PlanStep("go"), (HOME,), (AWAY,), (HOME,))
BACK = GroundAction(PlanStep("back"), (AWAY,), (HOME,), (AWAY,))
WORK = GroundAction(PlanStep("work"), (HOME,), (DONE,), ())
LOAD = GroundAction(PlanStep("load"), (HOME,), (), (), assignments=(Assignment(ENERGY, 5, increase=True),))
STRAIN = GroundAction(
    PlanStep("strain"),
    (HOME,),
    (DONE,),
    (),
    1.0,
    (NumericBound(">=", ENERGY, 8),),
    (Assignment(ENERGY, -8, increase=True),),
)
ERRAND = Problem("d", {}, (HOME,), (DONE,), (GO, BACK, WORK, LOAD, STRAIN), numbers={ENERGY: 0})


@pytest.mark.parametrize(
    ("chosen", "left"),
    [
        ([2], [2]),
        ([0, 1, 2], [2]),  # there and back again
        ([0, 1, 0, 1, 2, 0], [2]),
        ([3, 3, 4], [3, 3, 4]),  # both are needed for the number
        ([3, 3, 3, 4], [3, 3, 4]),
        ([3, 0, 1, 3, 4, 0], [3, 3, 4]),
        ([], []),
    ],
)
def test_actions_that_the_goal_is_reached_without_are_left_out(chosen, left):
    assert indispensable(ERRAND, chosen) == left


def test_an_action_that_only_serves_a_needless_action_is_removed_too():
    key, door = Fact("key"), Fact("door-open")
    take = GroundAction(PlanStep("take-key"), (), (key,), ())
    unlock = GroundAction(PlanStep("unlock"), (key,), (door,), ())
    work = GroundAction(PlanStep("work"), (), (DONE,), ())
    assert indispensable(Problem("d", {}, (), (DONE,), (take, unlock, work)), [0, 1, 2]) == [2]


def test_a_planner_gives_no_needless_steps_and_the_cost_of_what_is_left():
    async def run():
        asked = planner(answering('{"actions": [0, 1, 2]}'))
        found = await asked.solve(ERRAND, 20)
        await asked.close()
        return found

    found = asyncio.run(run())
    assert WORK.step is not None
    assert (found.plan, found.cost) == (Plan((WORK.step,)), 1)


_facts = st.lists(st.sampled_from([Fact("p", (i,)) for i in range(5)]), max_size=2).map(
    lambda fs: tuple(dict.fromkeys(fs))
)


@given(
    st.lists(st.tuples(_facts, _facts, _facts), min_size=1, max_size=5), _facts, st.lists(st.integers(0, 4), max_size=8)
)
def test_the_remaining_actions_are_a_plan_without_a_needless_action(actions, init, tried):
    made = [
        GroundAction(PlanStep(f"a{i}"), needs, adds, tuple(one for one in gone if one not in adds))
        for i, (needs, adds, gone) in enumerate(actions)
    ]
    chosen: list[int] = []
    state = frozenset(init)
    for index in tried:
        if index < len(made) and made[index].applicable(state):
            chosen, state = [*chosen, index], made[index].apply(state)
    problem = Problem("d", {}, init, tuple(sorted(state, key=str)[:2]), tuple(made))
    left = indispensable(problem, chosen)
    assert isinstance(problem.plan(left), Plan)
    assert all(isinstance(problem.plan([*left[:i], *left[i + 1 :]]), str) for i in range(len(left)))
