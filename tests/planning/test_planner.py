from __future__ import annotations

import asyncio
import sys
import time
from contextlib import contextmanager

import pytest

from knowledge_base.facts import Fact
from planning.plan import EngineFailed, Plan, PlanFound, PlanStep, ProvenUnsolvable, TimedOut
from planning.planner import PlannerProcess
from planning.strips import GroundAction, Problem

READY = "import json, sys, time, os\nprint('{\"ready\": true}', flush=True)\n"
HANGING = READY + "time.sleep(600)\n"
COUNTING = READY + (
    "for line in sys.stdin:\n"
    "    problem = json.loads(line)\n"
    "    if problem['whole']: time.sleep(600)\n"
    "    print(json.dumps({'actions': list(range(len(problem['actions'])))}), flush=True)\n"
)

START, MIDDLE, GOAL = Fact("start"), Fact("middle"), Fact("goal")
FIRST = GroundAction(PlanStep("first", ("a",)), (START,), (MIDDLE,), (START,))
SECOND = GroundAction(PlanStep("second", ("b",)), (MIDDLE,), (GOAL,), ())
PROBLEM = Problem("d", {}, (START,), (GOAL,), (FIRST, SECOND))


def planner(script, **options):
    return PlannerProcess(command=(sys.executable, "-c", script), **options)


def outcome(script, problem=PROBLEM, seconds=20.0, **options):
    async def ask():
        asked = planner(script, **options)
        try:
            return await asked.solve(problem, seconds)
        finally:
            await asked.close()

    return asyncio.run(ask())


def answering(answer):
    return READY + f"for line in sys.stdin: print({answer!r}, flush=True)\n"


def test_a_plan_is_steps_and_durations():
    found = outcome(answering('{"actions": [0, 1]}'))
    assert isinstance(found, PlanFound)
    assert found.plan == Plan((FIRST.step, SECOND.step))
    assert found.seconds < 20
    assert found.simulated_seconds == PROBLEM.simulated_seconds


def test_no_plan_is_an_outcome():
    assert isinstance(outcome(answering('{"actions": null}')), ProvenUnsolvable)


def test_what_is_unreachable_is_not_even_asked():
    problem = Problem("d", {}, (), (), (), unreachable=("(tidy cup1)",))
    found = outcome("raise SystemExit(1)", problem)
    assert isinstance(found, ProvenUnsolvable)
    assert "(tidy cup1)" in found.reason


def test_a_goal_that_holds_is_not_even_asked():
    assert outcome("raise SystemExit(1)", Problem("d", {}, (), (), ())).plan == Plan()


@pytest.mark.parametrize(
    ("script", "said"),
    [
        (READY + "sys.stdin.readline(); os._exit(7)", "status 7"),
        (answering("here is your plan"), "Expecting value"),
        (answering("[1, 2]"), "no answer"),
        (answering('{"actions": "all"}'), "no answer"),
        (answering('{"steps": []}'), "no answer"),
        (answering('{"actions": [1, 0]}'), "(second b) is not applicable, (middle) does not hold"),
        (answering('{"actions": [0]}'), "goal fact (goal) does not hold"),
        (answering('{"actions": [0, 1, 2]}'), "no action number 2"),
        (answering('{"actions": [-1]}'), "no action number -1"),
        (answering('{"failed": "MemoryError: "}'), "MemoryError"),
        ("raise SystemExit(3)", "did not start: the process ended with status 3"),
    ],
)
def test_an_engine_that_fails_is_told_apart(script, said):
    found = outcome(script)
    assert isinstance(found, EngineFailed)
    assert said in found.message


def test_a_command_that_does_not_exist_is_a_failure():
    async def ask():
        return await PlannerProcess(command=("/nowhere/planner",)).solve(PROBLEM, 5)

    assert "did not start" in asyncio.run(ask()).message


def test_an_engine_that_does_not_start_is_not_waited_for():
    found = outcome("import time; time.sleep(600)", start_up_seconds=0.2)
    assert "within 0.2 s" in found.message


def test_the_deadline_is_kept_in_real_time():
    began = time.monotonic()
    assert outcome(HANGING, seconds=0.2) == TimedOut("pyperplan", 0.2)
    assert time.monotonic() - began < 10


def test_an_engine_that_does_not_read_cannot_block_us():
    wide = Problem("d" * 1_000_000, {}, (START,), (GOAL,), (FIRST, SECOND))
    assert isinstance(outcome(HANGING, wide, seconds=0.2), TimedOut)


def test_a_slice_that_takes_too_long_leaves_time_for_the_whole():
    whole = Problem("d", {}, (START,), (GOAL,), (FIRST, SECOND))
    sliced = Problem("d", {}, (START,), (GOAL,), (FIRST, SECOND), whole=whole)
    found = outcome(COUNTING, sliced, seconds=2.0)
    assert isinstance(found, PlanFound)
    assert not found.reproducible  # real time decided which problem was solved


def test_a_slice_without_a_plan_proves_nothing():
    script = READY + (
        "for line in sys.stdin:\n"
        "    whole = json.loads(line)['whole']\n"
        "    print(json.dumps({'actions': None if whole else [0, 1]}), flush=True)\n"
    )
    sliced = Problem("d", {}, (START,), (GOAL,), (FIRST, SECOND), whole=PROBLEM)
    found = outcome(script, sliced)
    assert isinstance(found, PlanFound)
    assert found.reproducible


def test_cancelling_kills_the_engine_and_the_next_call_starts_another():
    async def run():
        hanging = planner(HANGING)
        await hanging.warm_up()
        process = hanging._process
        task = asyncio.create_task(hanging.solve(PROBLEM, 600))
        await asyncio.sleep(0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert not process.alive
        assert isinstance(await hanging.solve(PROBLEM, 0.2), TimedOut)
        await hanging.close()

    asyncio.run(run())


def test_one_problem_at_a_time_in_the_order_asked():
    async def run():
        both = planner(answering('{"actions": [0, 1]}'))
        found = await asyncio.gather(both.solve(PROBLEM, 20), both.solve(PROBLEM, 20))
        await both.close()
        return found

    assert all(isinstance(one, PlanFound) for one in asyncio.run(run()))


def test_a_warm_engine_is_kept_and_a_dead_one_replaced():
    async def run():
        asked = planner(answering('{"actions": [0, 1]}'))
        await asked.warm_up()
        process = asked._process
        await asked.solve(PROBLEM, 20)
        assert asked._process is process
        process.kill()
        assert isinstance(await asked.solve(PROBLEM, 20), PlanFound)
        assert asked._process is not process
        await asked.close()
        await asked.close()

    asyncio.run(run())


def test_warming_up_something_broken_waits_with_the_bad_news():
    async def run():
        broken = planner("raise SystemExit(3)")
        await broken.warm_up()
        return await broken.solve(PROBLEM, 5)

    assert isinstance(asyncio.run(run()), EngineFailed)


def test_the_clock_is_held_while_the_engine_works_and_no_timer_of_the_loop_is_used(monkeypatch):
    held = []

    @contextmanager
    def hold():
        held.append("held")
        yield
        held.append("released")

    async def run():
        asked = planner(answering('{"actions": [0, 1]}'), clock_hold=hold)
        loop = asyncio.get_running_loop()
        monkeypatch.setattr(loop, "call_later", None)
        monkeypatch.setattr(loop, "call_at", None)
        await asked.solve(PROBLEM, 20)
        await asked.close()

    asyncio.run(run())
    assert held == ["held", "released"]


def test_a_planner_serves_one_run_after_the_other_each_in_a_loop_of_its_own():
    both = planner(answering('{"actions": [0, 1]}'))

    async def two_at_once():
        return await asyncio.gather(both.solve(PROBLEM, 20), both.solve(PROBLEM, 20))

    try:
        found = [*asyncio.run(two_at_once()), *asyncio.run(two_at_once())]
    finally:
        both.kill()
    assert all(isinstance(one, PlanFound) for one in found)


def test_a_deadline_that_comes_just_after_the_answer_does_not_spoil_the_next_problem():
    async def run():
        asked = planner(answering('{"actions": [0, 1]}'))
        await asked.solve(PROBLEM, 20)
        process = asked._process
        process._expire()
        process._popen.poll = lambda: None  # killed, and not yet gone from the process table
        found = await asked.solve(PROBLEM, 20)
        await asked.close()
        return found, process

    found, process = asyncio.run(run())
    assert isinstance(found, PlanFound)
    assert not process.alive
