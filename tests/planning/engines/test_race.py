"""Several engines at once: who wins, what becomes of the others, and what is said when nobody does."""

from __future__ import annotations

import asyncio
from contextlib import aclosing
from types import SimpleNamespace
from typing import Any

import pytest
from fake_engines import (
    ARRIVAL,
    DETOUR,
    HANGING,
    LONGER,
    PROBLEM,
    READY,
    SOLVED,
    answering,
    descendants,
    gone,
    planner,
    session,
)
from fake_engines import FIRST as A
from fake_engines import SECOND as B
from hypothesis import given, settings
from hypothesis import strategies as st

from planning.engines.race import PlannerRace
from planning.engines.registry import ENGINES, able, chosen, engine, repeatable
from planning.model.plan import EngineFailed, PlanFound, ProvenUnsolvable, TimedOut, Unsupported

FIRST, SECOND = ENGINES[:2]


def race(one, other):
    """A race between two scripts."""
    scripts = {FIRST.name: one, SECOND.name: other}
    return PlannerRace(choose=lambda _: [FIRST, SECOND], make=lambda name: planner(scripts[name], name))


def outcome(one, other, seconds=20.0):
    async def run():
        racing = race(one, other)
        try:
            return await racing.solve(PROBLEM, seconds)
        finally:
            await racing.close()

    return asyncio.run(run())


CRASHING = READY + "sys.stdin.readline(); os._exit(7)"
WRONG = answering('{"actions": [1]}')
RUBBISH = answering("here you are")
UNSOLVABLE = answering('{"actions": null}')


@pytest.mark.parametrize(
    "other", [HANGING, CRASHING, WRONG, RUBBISH, "raise SystemExit(3)", "import time; time.sleep(600)"]
)
@pytest.mark.parametrize("swapped", [False, True])
def test_the_first_valid_plan_wins_whatever_the_other_does(other, swapped):
    pair = (other, answering(SOLVED)) if swapped else (answering(SOLVED), other)
    found = outcome(*pair)
    assert isinstance(found, PlanFound)
    assert found.engine == (SECOND.name if swapped else FIRST.name)


def test_an_engine_that_failed_is_named_although_the_other_went_on():
    async def run():
        racing = race(RUBBISH, HANGING)
        async with aclosing(racing.plans(PROBLEM, 1.0)) as plans:
            return [one async for one in plans]

    (found,) = asyncio.run(run())
    assert isinstance(found, TimedOut)
    assert [one.engine for one in found.failures] == [FIRST.name]


def test_one_proof_is_enough():
    found = outcome(HANGING, UNSOLVABLE)
    assert isinstance(found, ProvenUnsolvable)
    assert found.engine == SECOND.name


def test_when_all_fail_each_is_named():
    found = outcome(WRONG, CRASHING)
    assert isinstance(found, EngineFailed)
    assert {*found.engine.split(", ")} == {FIRST.name, SECOND.name}
    assert f"{FIRST.name}: its plan is no solution" in found.message
    assert f"{SECOND.name}: the process ended with status 7" in found.message


def test_when_both_are_late_both_are_named():
    found = outcome(HANGING, HANGING, seconds=0.2)
    assert isinstance(found, TimedOut)
    assert found.engine == ", ".join(sorted([FIRST.name, SECOND.name]))


def test_a_race_ends_with_nothing_left_of_the_loser():
    async def run():
        racing = race(HANGING, answering(SOLVED))
        await racing.warm_up()
        loser = racing._planners[FIRST.name]._process
        alive = {loser._pid, *descendants(loser._pid)}
        await racing.solve(PROBLEM, 600)
        assert gone(alive)
        await racing.close()

    asyncio.run(run())


def test_stopping_takes_effect_at_once_and_leaves_no_process():
    async def run():
        racing = race(HANGING, HANGING)
        await racing.warm_up()
        alive = [one._process._pid for one in racing._planners.values()]
        solving = asyncio.create_task(racing.solve(PROBLEM, 600))
        while not all(one._process._turn.locked() for one in racing._planners.values()):  # noqa: ASYNC110
            await asyncio.sleep(0)
        solving.cancel()
        with pytest.raises(asyncio.CancelledError):
            await solving
        assert gone(alive)

    asyncio.run(run())


def test_a_cheaper_plan_follows_the_first_whoever_finds_it():
    async def run():
        racing = race(
            answering(LONGER), READY + f"for line in sys.stdin: print({SOLVED!r}, flush=True); time.sleep(600)"
        )
        async with aclosing(racing.plans(PROBLEM, 600)) as plans:
            async for found in plans:
                if found.cost == 2:
                    break
        await racing.close()
        return found

    assert asyncio.run(run()).engine == SECOND.name


def test_the_next_problem_ends_the_search_for_a_better_plan():
    improving = READY + f"for line in sys.stdin: print({SOLVED!r}, flush=True); time.sleep(600)"

    async def run():
        racing = race(improving, HANGING)
        plans = racing.plans(PROBLEM, 600)
        first = await anext(plans)
        second = await racing.solve(PROBLEM, 600)
        left = [one async for one in plans]
        await racing.close()
        return first, second, left

    first, second, left = asyncio.run(run())
    assert isinstance(first, PlanFound)
    assert isinstance(second, PlanFound)
    assert left == []


def test_no_engine_that_can_is_an_outcome_that_says_how_to_get_one():
    async def run():
        return await PlannerRace(choose=lambda _: []).solve(PROBLEM, 1)

    found = asyncio.run(run())
    assert isinstance(found, Unsupported)
    assert found.message.startswith("the problem needs STRIPS; no permitted engine can do that, fast-downward could")


def test_two_at_most_race_and_only_those_that_can():
    everything = chosen(PROBLEM, usable=lambda _: True)
    assert [one.name for one in everything] == ["fast-downward", "pyperplan"]
    assert chosen(PROBLEM, usable=lambda one: one.name == "pyperplan") == [engine("pyperplan")]
    assert chosen(PROBLEM, usable=lambda _: False) == []


def test_a_large_problem_is_left_to_those_that_are_made_for_it():
    class Large:
        features: frozenset[str] = frozenset()
        actions = range(5000)

    large: Any = Large
    assert [one.name for one in chosen(large, usable=lambda _: True)] == ["fast-downward"]
    assert chosen(large, usable=lambda one: one.name == "pyperplan") == [engine("pyperplan")]


def test_in_simulated_time_one_repeatable_engine_starts():
    numeric: Any = SimpleNamespace(features=frozenset({"numeric"}))
    timed: Any = SimpleNamespace(features=frozenset({"durations"}))
    everything = [
        [one.name for one in repeatable(problem, usable=lambda _: True)] for problem in (PROBLEM, numeric, timed)
    ]
    assert everything == [["pyperplan"], ["kairos"], ["kairos"]]
    assert repeatable(numeric, usable=lambda one: one.name == "pyperplan") == []


def test_features_are_needs_and_costs_a_wish():
    assert [one.name for one in able({"numeric"}) if one.races] == ["kairos", "enhsp"]
    assert [one.name for one in able({"costs"}) if one.races][:3] == ["fast-downward", "enhsp", "pyperplan"]
    assert [one.name for one in able({"numeric", "durations"})] == ["kairos"]


BEHAVIOURS = {
    "hang": "time.sleep(600)",
    "crash": "os._exit(3)",
    "babble": "print('bla' * 100_000, end='', flush=True)",
    "rubbish": "print('no plan of mine', flush=True)",
    "wrong plan": "print('{\"actions\": [1, 0]}', flush=True)",
    "no numbers": 'print(\'{"actions": ["first"]}\', flush=True)',
    "fail": 'print(\'{"failed": "tired"}\', flush=True)',
    "end": "print('{\"ended\": 0}', flush=True)",
    "fork": "os.fork()",
    "plan": f"print({SOLVED!r}, flush=True)",
    "longer plan": f"print({LONGER!r}, flush=True)",
}
BEHAVING = st.lists(st.sampled_from(sorted(BEHAVIOURS)), max_size=4)


@settings(derandomize=True, deadline=None, max_examples=25)
@given(BEHAVING, BEHAVING)
def test_however_two_engines_behave_there_is_an_outcome_a_plan_is_valid_and_nothing_is_left(one, other):
    def script(doing):
        return READY + "sys.stdin.readline()\n" + "\n".join(BEHAVIOURS[what] for what in doing)

    async def run():
        racing = race(script(one), script(other))
        await racing.warm_up()
        workers = [planner._process._pid for planner in racing._planners.values()]
        found = await racing.solve(PROBLEM, 0.3)
        await racing.close()
        return found, workers

    found, workers = asyncio.run(run())
    if isinstance(found, PlanFound):
        assert found.plan.steps in {(A.step, B.step), (A.step, DETOUR.step, ARRIVAL.step)}
    else:
        assert isinstance(found, EngineFailed | TimedOut)
        assert FIRST.name in found.engine or SECOND.name in found.engine
    assert all(gone(session(pid, dead="ZX")) for pid in workers)
