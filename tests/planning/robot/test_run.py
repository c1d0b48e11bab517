"""The handle of a run: awaited, watched, steered, cancelled, suspended and resumed by a program with its own loop."""

from __future__ import annotations

import asyncio
import logging

import pytest
from obedient_robot import ObedientRobot, plots

from dsc import (
    BlockingCall,
    Component,
    Event,
    Outcome,
    Record,
    RunFilter,
    is_unfinished,
    parse_plot,
    primitive_plot,
    replay,
    skill,
)
from dsc.sequencer.clock import run_real, run_simulated
from dsc.sequencer.run_end import SUSPENDED
from knowledge_base import Delta, InputError, StoreError, UnknownNameError, fact
from planning import PlanningDomain, Robot, Task

DOMAIN = PlanningDomain.parse("""(define (domain trip) (:types place)
  (:predicates (at ?p - place) (road ?a ?b - place) (closed))
  (:action drive :parameters (?a ?b - place) :precondition (and (at ?a) (road ?a ?b) (not (closed)))
    :effect (and (not (at ?a)) (at ?b))))""")
WORLD = Delta(
    nodes=dict.fromkeys("abc", "place"), added=(fact("at", "a"), fact("road", "a", "b"), fact("road", "b", "c"))
)
WAIT = parse_plot("""
plot: wait
receives: {order: {place: place}}
variables: {where: {type: place, initial: a}}
outputs: {went: {type: text, initial: nowhere}}
states:
  idle: {on: {order: {to: go, assign: {where: ?event.place}}}}
  go: {after: {seconds: 2, to: over, assign: {went: ?where}}}
  over: {final: true}
""")


def robot(store=None, seconds=1.0, clock=None):
    device = ObedientRobot(DOMAIN, seconds=seconds)
    made = Robot(DOMAIN, [*plots(DOMAIN), WAIT], [device], store=store, clock=clock)
    device.knowledge = made.knowledge
    if not made.knowledge.nodes():
        made.knowledge.apply(WORLD, "me")
    return made


def simulated(main, **how):
    """Run a coroutine function with an open robot in simulated time."""

    async def opened():
        async with robot(**how) as one:
            return await main(one)

    return run_simulated(opened())


def done(one):
    return one.components[0].done


# -- starting and awaiting -----------------------------------------------------------------------------------


def test_a_goal_and_a_plot_are_started_and_awaited():
    async def main(one):
        assert (await one.start("(at b)")).reached
        assert (await one.achieving("(at c)")).reached
        run = one.start("wait")
        run.post("order", {"place": "b"})
        end = await run
        return end.outputs, done(one)

    assert simulated(main) == ({"went": "b"}, ["(drive a b)", "(drive b c)"])


def test_several_runs_without_a_store_share_the_robot():
    async def main(one):
        runs = one.start("(at b)"), one.start("wait", open_ended=True)
        runs[1].post("order", {"place": "c"}, after=5)
        return [bool(end) for end in await asyncio.gather(*runs)]

    assert simulated(main) == [True, True]


@pytest.mark.parametrize(
    ("start", "error", "said"),
    [
        (lambda one: one.start("wiat"), UnknownNameError, "did you mean 'wait'"),
        (lambda one: one.start("(att b)"), InputError, "did you mean 'at'"),
        (lambda one: one.run("wait"), InputError, "await robot.start"),
        (lambda one: one.achieve("(at b)"), InputError, "await robot.achieving"),
        (lambda one: one.resume(), InputError, "await robot.resuming"),
        (lambda one: one.resume_or_start("wait"), StoreError, "give the robot a store"),
        (lambda one: one.discard(), StoreError, "only a run with a store"),
    ],
)
def test_an_impossible_start_is_refused_before_it_starts(start, error, said):
    async def main(one):
        with pytest.raises(error, match=said):
            start(one)

    simulated(main)


def test_a_run_is_not_started_without_a_loop():
    with robot() as one, pytest.raises(InputError, match=r"call `robot\.run"):
        one.start("wait")


# -- watching ------------------------------------------------------------------------------------------------


def test_the_state_of_a_run_names_its_states_plans_and_skills():
    async def main(one):
        run = one.start("(at c)")
        await asyncio.sleep(0.5)
        now = run.state
        end = await run
        return now, run.state.over, end.reached

    now, over, reached = simulated(main)
    assert (over, reached, now.over) == (True, True, False)
    assert now.plans == {"(at c)": ("(drive a b)", "(drive b c)")}
    acting = next(one for one in now.waiting if one.skill == "robot.act")
    assert acting.waits_for == ""
    assert acting.since == pytest.approx(now.time - 0.5, abs=0.4)
    assert any(path.endswith("step_1") for path in now.active)


def test_the_records_of_a_run_end_with_it_for_each_reader():
    async def main(one):
        run = one.start("(at b)")
        first, second = run.records(), run.records()
        seen = [record.type async for record in first]
        return seen, [record.type async for record in second], [record async for record in first], run.task.done()

    first, second, again, over = simulated(main)
    assert first == second
    assert (first[-1], again, over) == ("end", [], True)
    assert "plan.found" in first


def test_a_listener_can_be_removed():
    async def main(one):
        seen: list[Record] = []
        run = one.start("(at c)")
        ignore = run.listen(seen.append)
        await asyncio.sleep(0.5)
        ignore()
        before = len(seen)
        await run
        return before, len(seen)

    before, after = simulated(main)
    assert before == after > 0


def test_a_listener_of_the_robot_receives_records_of_the_runs_in_progress_until_it_is_removed():
    async def main(one):
        seen: list[Record] = []
        run = one.start("(at c)")
        await asyncio.sleep(0.5)
        ignore = one.listen(seen.append)
        await asyncio.sleep(1.0)
        ignore()
        before = [record.type for record in seen]
        await run
        return before, len(seen)

    before, after = simulated(main)
    assert "action" in before
    assert after == len(before)


# -- steering ------------------------------------------------------------------------------------------------


def test_a_change_from_outside_reaches_the_run():
    async def main(one):
        run = one.start("(at c)", replans=0)
        run.change(Delta(added=(fact("closed"),)), "police", after=0.5)
        return await run

    end = simulated(main)
    assert not end.reached


def test_a_cancelled_run_ends_with_the_reason_after_its_exit_actions():
    async def main(one):
        run = one.start("(at c)")
        await asyncio.sleep(0.5)
        end = await run.cancel("the customer has left")
        again = await one.start("(at b)")
        with pytest.raises(InputError, match="has ended"):
            run.post("order")
        return end, again

    end, again = simulated(main)
    assert (end.problem, end.reached, again.reached) == ("the customer has left", False, True)


# -- with a store --------------------------------------------------------------------------------------------


def test_a_suspended_run_is_resumed_with_its_id(tmp_path):
    store = tmp_path / "run.kb"

    async def first(one):
        run = one.resume_or_start("(at c)")
        await asyncio.sleep(1.5)
        end = await run.suspend()
        return run.id, end.problem, done(one)

    async def second(one):
        with pytest.raises(StoreError, match="unfinished run"):
            await one.start("(at b)")
        run = one.resume_or_start("(at c)")
        return run.id, (await run).reached, done(one)

    number, problem, before = simulated(first, store=store)
    assert (problem, before) == ("the run is suspended and can be resumed", ["(drive a b)"])
    assert is_unfinished(store)
    resumed, reached, after = simulated(second, store=store)
    assert (resumed, reached, after) == (number, True, ["(drive b c)"])


@pytest.mark.parametrize("how", ["cancel the task", "leave the block", "close"])
def test_a_program_that_ends_suspends_its_run(tmp_path, how):
    async def main():
        async with robot(tmp_path / "run.kb") as one:
            run = one.start("(at c)")
            await asyncio.sleep(0.5)
            if how == "cancel the task":
                run.task.cancel()
            elif how == "close":
                one.close()
            if how != "leave the block":
                with pytest.raises(asyncio.CancelledError):
                    await run
        return run.task.done()

    assert run_simulated(main())
    assert is_unfinished(tmp_path / "run.kb")


def test_a_second_run_in_one_store_is_refused_by_the_name_of_the_store(tmp_path):
    async def main(one):
        run = one.start("(at b)")
        await asyncio.sleep(0.1)
        with pytest.raises(InputError, match=r"already has a run in 'run\.kb'"):
            one.start("(at c)")
        return (await run).reached, (await one.start("(at c)")).reached

    assert simulated(main, store=tmp_path / "run.kb") == (True, True)


def test_a_discarded_run_lets_the_next_one_start(tmp_path):
    async def first(one):
        run = one.start("(at c)")
        await asyncio.sleep(0.5)
        await run.suspend()

    async def second(one):
        one.discard("the customer has left")
        return (await one.start("(at b)")).reached

    simulated(first, store=tmp_path / "run.kb")
    assert simulated(second, store=tmp_path / "run.kb")
    assert not is_unfinished(tmp_path / "run.kb")


def test_a_closed_robot_starts_nothing(tmp_path):
    one = robot(tmp_path / "run.kb")
    one.close()
    for start in (lambda: one.run("wait"), lambda: one.achieve("(at b)"), one.resume, one.discard):
        with pytest.raises((InputError, StoreError), match="closed"):
            start()


def test_runs_in_real_time_have_different_ids():
    async def main():
        async with robot(seconds=0.0) as one:
            runs = [one.start("wait") for _ in range(2)]
            for run in runs:
                run.cancel("enough")
            await asyncio.gather(*runs)
            return {run.id for run in runs}

    assert len(run_real(main())) == 2


def test_an_event_that_no_plot_receives_is_refused_with_the_nearest():
    async def main(one):
        run = one.start("wait")
        with pytest.raises(UnknownNameError, match="did you mean 'order'"):
            run.post(Event("odrer"))
        return await run.cancel("enough")

    simulated(main)


class Noting(ObedientRobot):
    keys: asyncio.Queue[str]

    async def execute(self, skill_name, call, arguments):
        self.keys.put_nowait(call.key)
        return await super().execute(skill_name, call, arguments)


def keyed(store, keys):
    device = Noting(DOMAIN)
    device.keys = keys
    made = Robot(DOMAIN, plots(DOMAIN), [device], store=store)
    device.knowledge = made.knowledge
    if not made.knowledge.nodes():
        made.knowledge.apply(WORLD, "me")
    return made


def test_the_key_of_a_call_is_unique_in_real_time_and_begins_with_the_id_of_the_run(tmp_path):
    async def life(store, begin):
        keys: asyncio.Queue[str] = asyncio.Queue()
        async with keyed(tmp_path / store, keys) as one:
            run = begin(one)
            key = await keys.get()
            await run.suspend()
        return run.id, key

    async def main():
        return [
            await life("a.kb", lambda one: one.start("(at c)")),
            await life("b.kb", lambda one: one.start("(at c)")),
        ]

    (first, key), (second, other) = run_real(main())
    assert [key.split("/")[0], other.split("/")[0]] == [first, second]
    assert key != other


def test_the_key_of_a_call_is_equal_in_equal_runs_in_simulated_time():
    async def main():
        keys: asyncio.Queue[str] = asyncio.Queue()
        async with keyed(None, keys) as one:
            await one.start("(at b)")
            await one.start("(at c)")
        return [keys.get_nowait(), keys.get_nowait()]

    first = run_simulated(main())
    assert first == run_simulated(main())
    assert len({*first}) == len(first) == 2


@pytest.mark.parametrize("method", ["run", "achieve", "report"])
def test_a_robot_without_a_clock_asks_for_the_kind_of_time(method):
    made = robot()
    task = {"run": "wait", "achieve": "(at b)", "report": Task(goal="(at b)")}[method]
    with pytest.raises(InputError, match='clock="real" for devices, or clock="simulated" for tests'):
        getattr(made, method)(task)


@pytest.mark.parametrize(
    ("clock", "runs", "other"), [("real", run_simulated, "simulated"), ("simulated", run_real, "real")]
)
def test_a_clock_that_is_not_that_of_the_loop_is_refused(clock, runs, other):
    made = robot(clock=clock)

    async def start():
        await made.start("wait")

    with pytest.raises(InputError, match=f'event loop is {other}, and the robot has clock="{clock}"'):
        runs(start())


def test_a_speed_needs_simulated_time():
    made = robot(clock="real")
    with pytest.raises(InputError, match="a speed of 10 needs simulated time"):
        made.run("wait", speed=10)


class Said(Outcome): ...


def test_log_records_name_the_robot_and_the_run(caplog):
    class Talker(Component):
        name = "talker"

        @skill(blocking="thread")
        def says(self, call: BlockingCall) -> Said:
            logging.getLogger("mine").warning("hello")
            return Said()

    talker = Talker()
    says = primitive_plot(talker.skills()["says"], done="said")
    made = Robot(DOMAIN, [says], [talker])

    async def main():
        runs = [made.start(says.name) for _ in range(2)]
        for run in runs:
            assert await run
        return [run.id for run in runs]

    caplog.handler.addFilter(added := RunFilter())
    ids = run_real(main())
    caplog.handler.removeFilter(added)
    assert [(record.robot, record.run) for record in caplog.records] == [("robot", one) for one in ids]


@pytest.mark.parametrize("steps", range(12))
def test_a_run_that_is_suspended_at_any_record_is_resumed(steps, tmp_path):
    """The first case is the suspension before the first step."""

    async def first():
        async with robot(tmp_path / "run.kb") as one:
            run = one.start("(at c)")
            seen = [0]

            def count(_):
                seen[0] += 1
                if seen[0] == steps:
                    run.suspend()

            run.listen(count)
            if steps == 0:
                run.suspend()
            assert (await run).problem == SUSPENDED

    async def then():
        async with robot(tmp_path / "run.kb") as one:
            return await one.resume_or_start("(at c)"), done(one)

    run_simulated(first())
    end, _ = run_simulated(then())
    assert end.reached, end.reason


def test_action_ids_in_real_time_are_unique_and_contain_the_run():
    async def ids():
        found = []
        for _ in range(2):
            async with robot(seconds=0.01) as one:
                one.listen(lambda record: found.append(record.data["id"]) if is_start(record) else None)
                for goal in ("(at b)", "(at c)"):
                    run = one.start(goal)
                    assert await run
                    assert any(str(seen).startswith(f"{run.id}/a") for seen in found)
        return found

    found = run_real(ids())
    assert len(found) == len(set(found))


def test_action_ids_in_simulated_time_are_without_the_run():
    found = []
    made = robot(clock="simulated")
    made.listen(lambda record: found.append(record.data["id"]) if is_start(record) else None)
    assert made.achieve("(at c)")
    assert found
    assert all("/" not in one for one in found)


def is_start(record):
    return record.type == "action" and record.data["action"] == "start"


def test_a_run_in_real_time_is_kept_resumed_and_replayed_with_its_ids(tmp_path):
    async def first():
        async with robot(tmp_path / "run.kb", seconds=0.02) as one:
            run = one.start("(at c)")
            async for record in run.records():
                if record.type == "action":
                    return run.id
        raise AssertionError

    async def then():
        async with robot(tmp_path / "run.kb", seconds=0.02) as one:
            run = one.resume_or_start("(at c)")
            assert (await run).reached
            return run.id

    assert run_real(first()) == run_real(then())
    assert replay(tmp_path / "run.kb").divergence is None


def test_the_first_record_names_robot_and_run_in_real_time_only():
    async def first():
        async with robot() as one:
            seen: list[Record] = []
            one.listen(seen.append)
            run = one.start("wait")
            run.cancel("seen")
            await run
            return run.id, seen[0]

    run, record = run_real(first())
    assert (record.data["robot"], record.data["run"]) == ("robot", run)
    _, record = run_simulated(first())
    assert not {"robot", "run"} & record.data.keys()
