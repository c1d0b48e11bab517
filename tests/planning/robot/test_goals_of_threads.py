"""The queue of goals in somebody's program: goals of other threads, a busy robot, and a robot that is closed."""

from __future__ import annotations

import asyncio
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
from obedient_robot import ObedientRobot, plots

from dsc import Outcome, SkillCall, run_real, run_simulated, skill
from knowledge_base import Delta, InputError, StoreError, UnknownNameError
from planning import PlanningDomain, Robot

DOMAIN = PlanningDomain.parse("""(define (domain lamps) (:types lamp)
  (:predicates (on ?l - lamp))
  (:action light :parameters (?l - lamp) :effect (on ?l)))""")


def robot(store=None):
    device = ObedientRobot(DOMAIN)
    made = Robot(DOMAIN, plots(DOMAIN), [device], store=store)
    device.knowledge = made.knowledge
    if not made.knowledge.nodes():
        made.knowledge.apply(Delta(nodes=dict.fromkeys("ab", "lamp")), "me")
    return made


def in_thread(call, *arguments, **named):
    """Call in another thread, and return its result."""
    results = []
    thread = threading.Thread(target=lambda: results.append(call(*arguments, **named)))
    thread.start()
    thread.join()
    return results[0]


def test_a_goal_of_another_thread_wakes_the_robot():
    async def main():
        async with robot() as one:
            serving = asyncio.create_task(one.serve())
            for goal in ("(on a)", "(on b)"):
                await asyncio.sleep(0.05)  # the queue is empty, and no timer is due
                number = in_thread(one.goals.put, goal)
                ended = await asyncio.wait_for(one.goals.end_of(number), 5.0)
                assert ended.state == "reached"
            serving.cancel()

    run_real(main())


def test_a_waiting_goal_that_another_thread_withdraws_ends():
    async def main():
        async with robot() as one:
            number = one.goals.put("(on a)")
            ending = asyncio.create_task(one.goals.end_of(number))
            await asyncio.sleep(0.01)
            in_thread(one.goals.withdraw, number, "not now")
            assert (await asyncio.wait_for(ending, 5.0)).reason == "not now"

    run_real(main())


def test_goals_of_several_threads_have_different_numbers():
    with robot() as one:
        threads = [threading.Thread(target=lambda: [one.goals.put("(on a)") for _ in range(50)]) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert [goal.id for goal in one.goals.list()] == [*range(1, 201)]


@pytest.mark.parametrize("kept", [False, True])
def test_a_closed_robot_serves_no_further_goal(tmp_path, kept):
    async def main():
        async with robot(tmp_path / "robot.kb" if kept else None) as one:
            serving = asyncio.create_task(one.serve())
            await asyncio.sleep(1.0)
        await asyncio.wait_for(serving, 5.0)
        with pytest.raises(InputError, match="the robot is closed; it serves no further goal"):
            one.goals.put("(on a)")

    run_simulated(main())


def test_a_goal_waits_while_another_run_is_in_progress(tmp_path):
    async def main():
        async with robot(tmp_path / "robot.kb") as one:
            run = one.start("(on a)")
            number = one.goals.put("(on b)")
            with pytest.raises(InputError, match="already has a run"):
                await one.serve(until_empty=True)
            assert one.goals.get(number).state == "waiting"
            await run
            await one.serve(until_empty=True)
            assert one.goals.get(number).state == "reached"

    run_simulated(main())


def test_a_goal_waits_if_the_store_has_a_suspended_run(tmp_path):
    async def main():
        async with robot(tmp_path / "robot.kb") as one:
            run = one.start("(on a)")
            await asyncio.sleep(0.1)
            run.suspend()
            await run
            number = one.goals.put("(on b)")
            with pytest.raises(StoreError, match="unfinished run"):
                await one.serve(until_empty=True)
            assert one.goals.get(number).state == "waiting"

    run_simulated(main())


def test_an_unknown_state_of_goals_has_the_nearest_name():
    with robot() as one, pytest.raises(UnknownNameError, match="did you mean 'reached'"):
        one.goals.list("reachd")


def test_a_run_that_has_ended_takes_no_change():
    async def main():
        async with robot() as one:
            run = one.start("(on a)")
            await run
            for late in (
                lambda: run.change(Delta(), "me"),
                lambda: run.set_parameter("light", "speed", 1),
                lambda: run.wire("a.b", None),
            ):
                with pytest.raises(InputError, match="the run has ended and receives nothing"):
                    late()

    run_simulated(main())


def test_an_unknown_clock_is_refused_when_the_robot_is_made():
    with pytest.raises(InputError, match="real or simulated, not 'reel'; did you mean 'real'"):
        Robot(DOMAIN, [], [], clock="reel")  # type: ignore[arg-type]


class Done(Outcome): ...


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"after_crash": "senze"}, "not 'senze'; did you mean 'sense'"),
        ({"unlimited": "yes"}, "true or false, not 'yes'"),
    ],
)
def test_a_misspelt_option_of_a_skill_is_refused(how, said):
    with pytest.raises(InputError, match=said):

        @skill(**how)
        async def carry(self, call: SkillCall) -> Done:
            return Done()


def test_advice_for_a_thread_without_a_loop_names_the_queue():
    with robot() as one, ThreadPoolExecutor(1) as pool:
        with pytest.raises(InputError, match=r"`robot\.goals\.put` or `asyncio\.run_coroutine_threadsafe`"):
            pool.submit(one.start, "(on a)").result()
        with pytest.raises(InputError, match="a listener is a function of a record, not 5"):
            one.listen(5)


def test_a_misspelt_observation_has_the_nearest_name():
    with pytest.raises(UnknownNameError, match="no attribute 'observd'; did you mean 'observed'"):
        Done(observd=Delta())  # type: ignore[call-arg]
