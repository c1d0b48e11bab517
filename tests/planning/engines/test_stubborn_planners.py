"""Planners that go on although they are told to stop: nobody waits for them for ever, and they are named."""

import asyncio
import logging
from typing import Any

import pytest
from errands import DOMAIN, HOLDER, ROOMS, ROUND, when_asked
from obedient_robot import ObedientRobot, plots

from dsc import Event, parse_plot
from knowledge_base import Delta, fact
from planning import Plan, PlanStep, Robot
from planning.model.plan import EngineFailed, PlanFound

FOUND = PlanFound(Plan((PlanStep("go", ("a", "b")),)), "fake", 0.0, 0.1)


@pytest.fixture(autouse=True)
def _impatient(monkeypatch):
    monkeypatch.setattr("planning.execution.planner_call.PATIENCE", -4.9)  # of the five seconds that the goal has
    monkeypatch.setattr("planning.execution.planner_call.STOPPING", 0.1)


async def continues():
    """It cannot be cancelled."""
    while True:
        try:
            await asyncio.get_running_loop().create_future()
        except asyncio.CancelledError:
            continue


class Stubborn:
    def __init__(self):
        self.asked = 0

    async def solve(self, problem, seconds):
        self.asked += 1
        await continues()


class StubbornLater:
    """Answers, and then goes on: in looking for more, or in ending."""

    def __init__(self, answer, where):
        self.answer, self.where = answer, where

    async def solve(self, problem, seconds):
        return self.answer

    async def plans(self, problem, seconds):
        try:
            yield self.answer
            if self.where == "looking":
                await continues()
            elif self.where == "failing":
                raise OSError("no room left")
        finally:
            if self.where == "ending":
                await continues()


def run(planner, *, simulated=False, prepare=None):
    """The attributes of how it ended."""
    robot = ObedientRobot(DOMAIN, seconds=1.0 if simulated else 0.02)
    holder = parse_plot(HOLDER.replace("GOAL", "(at b)").replace("REPLANS", "4"))
    program = Robot(
        DOMAIN, [holder, *plots(DOMAIN)], [robot], planner=planner, clock="simulated" if simulated else "real"
    )
    robot.knowledge = program.knowledge
    told = (fact("at", "a"), *(fact("way", *one.split()) for one in ROUND))
    program.knowledge.apply(Delta(nodes=dict.fromkeys(ROOMS, "room"), added=told), "test")
    end = program.run("errand", prepare=prepare)
    assert end.finished
    return end.emitted[-1].attributes["how"]


@pytest.mark.parametrize("simulated", [True, False])
def test_a_planner_that_cannot_be_cancelled_ends_in_no_plan(simulated):
    how = run(Stubborn(), simulated=simulated)
    assert how == "Stubborn: no answer in time, and it ignores its cancellation"


@pytest.mark.parametrize("simulated", [True, False])
def test_a_stop_does_not_wait_for_a_planner_that_cannot_be_cancelled(simulated, monkeypatch, caplog):
    monkeypatch.setattr("planning.execution.planner_call.PATIENCE", 3600)
    planner = Stubborn()

    async def stop_when_it_works(sequencer):
        while not planner.asked:  # noqa: ASYNC110  it tells nobody
            await asyncio.sleep(0)
        sequencer.post(Event("stop"))

    assert run(planner, simulated=simulated, prepare=when_asked(stop_when_it_works)) == "stopped"
    assert "planner Stubborn: it ignores its cancellation" in caplog.text


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ("looking", "planner StubbornLater: it ignores its cancellation"),
        ("ending", "planner StubbornLater: it ignores its cancellation"),
        ("failing", ""),
        ("", ""),
    ],
)
def test_a_planner_that_cannot_be_closed_keeps_no_run_from_ending(where, said, caplog):
    with caplog.at_level(logging.ERROR, "asyncio"):
        assert run(StubbornLater(FOUND, where)) == "reached"
    assert said in caplog.text


def test_a_planner_without_an_answer_that_cannot_be_closed_is_named(caplog):
    with caplog.at_level(logging.ERROR, "asyncio"):
        assert run(StubbornLater(EngineFailed("fake", "killed"), "ending")) == "fake: killed"
    assert "planner StubbornLater: it ignores its cancellation" in caplog.text


class Tidy:
    """Has something to do when it is told to stop, as who ends the processes of engines."""

    def __init__(self):
        self.begun, self.tidied_up = asyncio.Event(), False

    async def solve(self, problem, seconds):
        return FOUND

    async def plans(self, problem, seconds):
        try:
            yield FOUND
            self.begun.set()
            await asyncio.get_running_loop().create_future()
        finally:
            await asyncio.sleep(0.01)
            self.tidied_up = True


def test_a_program_that_is_interrupted_ends_when_planners_have_stopped(monkeypatch, caplog):
    monkeypatch.setattr("planning.execution.planner_call.STOPPING", 5)
    planner = Tidy()

    main: asyncio.Task[Any] | None = None
    improving: list[asyncio.Task[None]] = []

    async def interrupted(sequencer):
        await planner.begun.wait()
        await asyncio.sleep(0)
        main.cancel()

    def prepare(sequencer):
        nonlocal main
        main = asyncio.current_task()
        improving.append(asyncio.get_running_loop().create_task(interrupted(sequencer)))

    with caplog.at_level(logging.ERROR, "asyncio"), pytest.raises(asyncio.CancelledError):
        run(planner, prepare=prepare)
    assert planner.tidied_up
    assert caplog.text == ""
