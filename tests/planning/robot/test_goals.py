"""The queue of a robot's goals: order, deadlines, replacement, bad goals, and its life in a store."""

from __future__ import annotations

import asyncio

import pytest
from obedient_robot import ObedientRobot, plots

from dsc import parse_plot
from dsc.sequencer.clock import run_simulated
from knowledge_base import Delta, InputError, UnknownNameError, fact
from planning import PlanningDomain, Robot
from planning.execution.goals import MOST_ENDED, GoalQueue

DOMAIN = PlanningDomain.parse("""(define (domain lamps) (:types lamp)
  (:predicates (on ?l - lamp) (broken ?l - lamp))
  (:action light :parameters (?l - lamp) :precondition (not (broken ?l)) :effect (on ?l)))""")
WORLD = Delta(nodes=dict.fromkeys("abcd", "lamp"), added=(fact("broken", "d"),))


def robot(store=None, more=()):
    device = ObedientRobot(DOMAIN)
    made = Robot(DOMAIN, [*plots(DOMAIN), *more], [device], store=store)
    device.knowledge = made.knowledge
    if not made.knowledge.nodes():
        made.knowledge.apply(WORLD, "me")
    return made


@pytest.fixture(params=["method", "plot"], autouse=True)
def way(request, monkeypatch):
    """Each test serves the queue by the method, and once more by the shipped plot."""

    async def by_plot(one, *, until_empty=False):
        run = (
            one.resume_or_start("serve_goals", open_ended=True)
            if one.store
            else one.start("serve_goals", open_ended=True)
        )
        try:
            while not run.task.done() and not (until_empty and not one.goals.list()):  # noqa: ASYNC110
                await asyncio.sleep(0.1)
        finally:
            if one.store is None or until_empty:
                run.cancel("the queue is empty")
            elif not run.task.done():
                run.suspend()
        await run

    if request.param == "plot":
        monkeypatch.setattr(Robot, "serve", by_plot)


def served(*goals, store=None, meanwhile=None):
    """Put goals, serve them until the queue is empty, and return the goals and what the robot did."""

    async def main():
        async with robot(store) as one:
            for goal, how in goals:
                one.goals.put(goal, **how)
            busy = asyncio.ensure_future(meanwhile(one)) if meanwhile else None
            await one.serve(until_empty=True)
            if busy is not None:
                await busy
            every = one.goals.list("waiting", "running", "reached", "failed", "withdrawn")
            return {queued.id: (queued.state, queued.reason) for queued in every}, one.components[0].done

    return run_simulated(main())


def test_goals_are_served_by_priority_and_then_in_their_order():
    ends, done = served(("(on a)", {}), ("(on b)", {"priority": 5}), ("(on c)", {"priority": 5}))
    assert done == ["(light b)", "(light c)", "(light a)"]
    assert {state for state, _ in ends.values()} == {"reached"}


def test_a_goal_that_cannot_be_reached_fails_with_the_reason_and_the_next_follows():
    ends, done = served(("(on d)", {}), ("(on a)", {}))
    assert ends[1][0] == "failed"
    assert "needs (not (broken d))" in ends[1][1]
    assert (ends[2], done) == (("reached", "reached"), ["(light a)"])


@pytest.mark.parametrize(
    ("put", "said"),
    [
        (lambda goals: goals.put("(onn a)"), "did you mean 'on'"),
        (lambda goals: goals.put("(on"), "goal"),
        (lambda goals: goals.put("(on a)", priority=float("nan")), "`priority` is a number"),
        (lambda goals: goals.put("(on a)", replaces=7), "no goal 7"),
        (lambda goals: goals.withdraw(7), "no goal 7"),
    ],
)
def test_a_bad_goal_is_answered_when_it_is_put(put, said):
    with robot() as one, pytest.raises((InputError, UnknownNameError), match=said):
        put(one.goals)


def test_a_running_goal_is_replaced():
    async def replace(one):
        await asyncio.sleep(0.5)
        one.goals.put("(on b)", replaces=1)

    ends, done = served(("(and (on a) (on c))", {}), meanwhile=replace)
    assert ends == {1: ("withdrawn", "replaced by another goal"), 2: ("reached", "reached")}
    assert done == ["(light b)"]


def test_a_goal_is_not_begun_after_its_deadline_and_ends_at_it():
    goals_now = 1_000.0

    async def main():
        async with robot() as one:
            one.goals._now = lambda: goals_now
            one.goals.put("(on a)", deadline=999.0)
            one.goals.put("(and (on b) (on c))", deadline=1_001.5)
            await one.serve(until_empty=True)
            return [(queued.state, queued.reason) for queued in one.goals.list("failed")], one.components[0].done

    ends, done = run_simulated(main())
    assert ends == [("failed", "its deadline has passed")] * 2
    assert len(done) == 1


def test_a_goal_that_arrives_while_the_robot_waits_is_served():
    async def main():
        async with robot() as one:
            serving = asyncio.ensure_future(one.serve())
            await asyncio.sleep(100)
            number = one.goals.put("(on a)")
            await asyncio.sleep(10)
            serving.cancel()
            return one.goals.get(number).state

    assert run_simulated(main()) == "reached"


@pytest.mark.parametrize("how", ["suspend", "cancel"])
def test_a_queue_survives_the_end_of_its_program(tmp_path, how):
    store = tmp_path / "run.kb"

    async def first():
        async with robot(store) as one:
            one.goals.put("(and (on a) (on b))")
            one.goals.put("(on c)")
            serving = asyncio.ensure_future(one.serve())
            await asyncio.sleep(1.5)
            if how == "cancel":
                serving.cancel()
            else:
                one.runs[0].suspend()
                await serving
            return one.components[0].done

    async def second():
        async with robot(store) as one:
            before = [(queued.id, queued.state) for queued in one.goals.list()]
            await one.serve(until_empty=True)
            return before, [queued.state for queued in one.goals.list("reached")], one.components[0].done

    assert len(run_simulated(first())) == 1
    before, after, done = run_simulated(second())
    assert (before, after) == ([(1, "running"), (2, "waiting")], ["reached", "reached"])
    assert len(done) == 2


def test_a_goal_whose_run_never_began_waits_again_and_one_that_was_reached_is_not_repeated(tmp_path):
    store = tmp_path / "run.kb"
    with robot(store) as one:
        for goal in ("(on a)", "(on b)"):
            one.goals.begin(one.goals.put(goal), print)
        one.knowledge.apply(Delta(added=(fact("on", "b"),)), "me")
    ends, done = served(store=store)
    assert (ends, done) == ({1: ("reached", "reached"), 2: ("reached", "reached")}, ["(light a)"])


def test_ended_goals_are_dropped_from_a_certain_number_on(tmp_path):
    with robot(tmp_path / "run.kb") as one:
        for _ in range(MOST_ENDED + 3):
            one.goals.withdraw(one.goals.put("(on a)"))
        assert len(one.goals.list("withdrawn")) <= MOST_ENDED + 1
        again = GoalQueue(one.knowledge, kept=True)
        assert again.list("withdrawn") == one.goals.list("withdrawn")
        assert again.put("(on b)") == MOST_ENDED + 4


GUARDED = parse_plot("""
plot: guarded
receives: {alarm: , quit: }
states:
  work: {use: serve_goals, on: {quit: over}}
  over: {final: true}
handlers:
  - on: alarm
    interrupt: true
    do: {use: pause}
""")
PAUSE = parse_plot("{plot: pause, states: {pause: {after: {seconds: 0.5, to: over}}, over: {final: true}}}")


@pytest.mark.parametrize("crash", [False, True])
def test_a_plot_that_serves_goals_can_be_interrupted_and_the_goal_is_then_served_again(tmp_path, crash):
    async def life(first):
        async with robot(tmp_path / "run.kb", [GUARDED, PAUSE]) as one:
            run = one.resume_or_start("guarded", open_ended=True)
            if first:
                one.goals.put("(and (on a) (on b) (on c))")
                await asyncio.sleep(1.5)
                run.post("alarm")
                await asyncio.sleep(0.6)
                if crash:
                    return one.components[0].done
            await asyncio.sleep(10)
            run.post("quit")
            assert (await run).finished
            return one.components[0].done, [queued.reason for queued in one.goals.list("reached")]

    done = run_simulated(life(True))
    if crash:
        rest, ends = run_simulated(life(False))
        done = [*done, *rest]
    else:
        done, ends = done
    assert ends == ["reached"]
    assert set(done) == {"(light a)", "(light b)", "(light c)"}
    assert len(done) <= 4  # the interrupted action may be repeated
