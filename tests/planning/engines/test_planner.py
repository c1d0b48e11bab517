from __future__ import annotations

import asyncio
import time
from contextlib import aclosing, contextmanager

import pytest
from fake_engines import FIRST, GOAL, HANGING, LONGER, PROBLEM, READY, SECOND, SOLVED, START, answering, gone, planner

from planning.engines.planner import PlannerProcess
from planning.model.plan import EngineFailed, Plan, PlanFound, ProvenUnsolvable, TimedOut
from planning.model.problem import Problem

# Gives all actions in their order; a problem that was sliced is too much for it.
COUNTING = READY + (
    "for line in sys.stdin:\n"
    "    problem = json.loads(line)\n"
    "    if problem['whole']: time.sleep(600)\n"
    "    print(json.dumps({'actions': [0, 1]}), '{\"ended\": 0}', sep='\\n', flush=True)\n"
)


def outcome(script, problem=PROBLEM, seconds=20.0, **options):
    async def ask():
        asked = planner(script, **options)
        try:
            return await asked.solve(problem, seconds)
        finally:
            await asked.close()

    return asyncio.run(ask())


def test_a_plan_is_steps_and_durations():
    found = outcome(answering(SOLVED))
    assert FIRST.step is not None
    assert SECOND.step is not None
    assert isinstance(found, PlanFound)
    assert found.plan == Plan((FIRST.step, SECOND.step))
    assert found.seconds < 20
    assert found.simulated_seconds == PROBLEM.simulated_seconds


def test_no_plan_is_an_outcome():
    found = outcome(answering('{"actions": null}'))
    assert isinstance(found, ProvenUnsolvable)
    assert found.reason == "the search was exhausted"


def test_an_unreachable_goal_is_proven_unsolvable_without_an_engine():
    problem = Problem("d", {}, (), (), (), unreachable=("(tidy cup1)",))
    found = outcome("raise SystemExit(1)", problem)
    assert isinstance(found, ProvenUnsolvable)
    assert "(tidy cup1)" in found.reason


def test_a_goal_that_holds_is_not_even_asked():
    problem = Problem("d", {}, (), (), ())
    found = outcome("raise SystemExit(1)", problem)
    assert found == PlanFound(Plan(), planner("").engine, 0.0, problem.simulated_seconds)


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
        (answering('{"actions": [0, 1, 4]}'), "no action number 4"),
        (answering('{"actions": [-1]}'), "no action number -1"),
        (answering('{"failed": "MemoryError: "}'), "MemoryError"),
        ("raise SystemExit(3)", "did not start: the process ended with status 3"),
    ],
)
def test_an_engine_that_fails_is_told_apart(script, said):
    found = outcome(script)
    assert isinstance(found, EngineFailed)
    assert said in found.message
    assert found.engine == planner("").engine


def test_the_message_of_a_failed_engine_is_its_own():
    assert outcome(answering('{"failed": "MemoryError: no room"}')).message == "MemoryError: no room"


def test_a_command_that_does_not_exist_is_a_failure():
    async def ask():
        return await PlannerProcess(command=("/nowhere/planner",)).solve(PROBLEM, 5)

    assert "did not start" in asyncio.run(ask()).message


def test_an_engine_that_does_not_start_is_not_waited_for():
    found = outcome("import time; time.sleep(600)", start_up_seconds=0.2)
    assert "within 0.2 s" in found.message


def test_the_deadline_is_kept_in_real_time():
    began = time.monotonic()
    assert outcome(HANGING, seconds=0.2) == TimedOut("fake", 0.2)
    assert time.monotonic() - began < 10


def test_an_engine_that_does_not_read_cannot_block_us():
    wide = Problem("d" * 1_000_000, {}, (START,), (GOAL,), (FIRST, SECOND))
    assert isinstance(outcome(HANGING, wide, seconds=0.2), TimedOut)


def test_a_slice_that_takes_too_long_leaves_time_for_the_whole():
    whole = Problem("d", {}, (START,), (GOAL,), (FIRST, SECOND))
    sliced = Problem("d", {}, (START,), (GOAL,), (FIRST, SECOND), unsliced=lambda: whole)
    found = outcome(COUNTING, sliced, seconds=2.0)
    assert isinstance(found, PlanFound)
    assert not found.reproducible  # real time decided which problem was solved


def test_a_plan_of_a_slice_found_in_time_is_reproducible():
    sliced = Problem("d", {}, (START,), (GOAL,), (FIRST, SECOND), unsliced=lambda: PROBLEM)
    assert outcome(answering('{"actions": [0, 1]}'), sliced).reproducible


def test_the_time_of_a_slice_is_not_given_to_the_whole_again():
    sliced = Problem("d", {}, (START,), (GOAL,), (FIRST, SECOND), unsliced=lambda: PROBLEM)
    assert outcome(HANGING, sliced, seconds=0.4).seconds == pytest.approx(0.2)


def test_the_translation_is_a_part_of_the_time_of_a_plan():
    assert outcome(answering('{"actions": [0, 1], "translated": 0.25}')).translated == 0.25


def test_a_slice_without_a_plan_proves_nothing():
    script = READY + (
        "for line in sys.stdin:\n"
        "    whole = json.loads(line)['whole']\n"
        "    print(json.dumps({'actions': None if whole else [0, 1]}), '{\"ended\": 0}', sep='\\n', flush=True)\n"
    )
    sliced = Problem("d", {}, (START,), (GOAL,), (FIRST, SECOND), unsliced=lambda: PROBLEM)
    found = outcome(script, sliced)
    assert isinstance(found, PlanFound)
    assert found.reproducible


def test_cheaper_plans_follow_the_first_and_dearer_ones_do_not():
    async def run(script):
        asked = planner(script)
        async with aclosing(asked.plans(PROBLEM, 20)) as plans:
            costs = [found.cost async for found in plans]
        await asked.close()
        return costs

    assert asyncio.run(run(answering(LONGER, LONGER, SOLVED, LONGER))) == [3, 2]


def test_an_engine_fault_after_a_plan_does_not_discard_the_plan():
    for rest in ("sys.stdin.readline(); time.sleep(600)", "os._exit(3)", "print('rubbish', flush=True)"):
        found = outcome(READY + f"sys.stdin.readline(); print({SOLVED!r}, flush=True); {rest}")
        assert isinstance(found, PlanFound), rest


def test_a_search_that_ends_without_a_word_is_a_failure():
    assert "ended with status 0 without an answer" in outcome(answering()).message


def test_cancelling_ends_an_engine_that_cannot_end_its_search_and_the_next_call_starts_another():
    async def run():
        hanging = planner(HANGING)
        await hanging.warm_up()
        process = hanging._process
        task = asyncio.create_task(hanging.solve(PROBLEM, 600))
        while not process._turn.locked():  # noqa: ASYNC110  that happens in a thread
            await asyncio.sleep(0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert gone([process._pid])
        assert isinstance(await hanging.solve(PROBLEM, 0.2), TimedOut)
        await hanging.close()

    asyncio.run(run())


def test_one_problem_at_a_time_in_the_order_asked():
    async def run():
        both = planner(answering(SOLVED))
        found = await asyncio.gather(both.solve(PROBLEM, 20), both.solve(PROBLEM, 20))
        await both.close()
        return found

    assert all(isinstance(one, PlanFound) for one in asyncio.run(run()))


def test_a_warm_engine_is_kept_and_a_dead_one_replaced():
    async def run():
        asked = planner(answering(SOLVED))
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
        try:
            yield
        finally:
            held.append("released")

    async def run():
        asked = planner(answering(SOLVED), clock_hold=hold)
        loop = asyncio.get_running_loop()
        monkeypatch.setattr(loop, "call_later", None)
        monkeypatch.setattr(loop, "call_at", None)
        await asked.solve(PROBLEM, 20)
        await asked.close()

    asyncio.run(run())
    assert held == ["held", "released"]


def test_a_planner_serves_one_run_after_the_other_each_in_a_loop_of_its_own():
    both = planner(answering(SOLVED))

    async def two_at_once():
        return await asyncio.gather(both.solve(PROBLEM, 20), both.solve(PROBLEM, 20))

    try:
        found = [*asyncio.run(two_at_once()), *asyncio.run(two_at_once())]
    finally:
        both.kill()
    assert all(isinstance(one, PlanFound) for one in found)
