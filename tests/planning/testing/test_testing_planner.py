"""A planner that fails, hangs, dies and lies: the executive believes nothing of it, and says what was wrong."""

from __future__ import annotations

import asyncio

import pytest
from test_testing_with_plans import DOMAIN, LIGHT_UP, PLOTS, Lamps, OnePlan

from dsc.testing import Answer, Fault, Faults, ScriptedSkills, world
from dsc.trace import Record
from planning import Robot
from planning.execution.planner_call import PATIENCE
from planning.testing import FaultyPlanner

PLANNER = [Fault.PLANNER_FAILS, Fault.PLANNER_HANGS, Fault.PLANNER_DIES, Fault.PLANNER_LIES]


def run(faults, *reached):
    knowledge = world(DOMAIN.schema, "a b - lamp")
    records: list[Record] = []
    skills = ScriptedSkills(knowledge, {"lamps.light": Answer("lit", observed="(on ?lamp)")}, like=[Lamps()])
    robot = Robot(
        DOMAIN, PLOTS, skills.components, knowledge, FaultyPlanner(OnePlan(), faults, *reached), clock="simulated"
    )
    robot.listen(records.append)
    with robot:
        end = robot.run(LIGHT_UP.name)
    return end, [record.data["reason"] for record in records if record.type == "plan.none"], skills.calls


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        (Fault.PLANNER_FAILS, "faulty: it was to fail"),
        (Fault.PLANNER_HANGS, "no plan within"),
        (Fault.PLANNER_DIES, "InjectedError: it was to die"),
        (Fault.PLANNER_LIES, "the plan found does not lead to the goal"),
    ],
)
def test_a_planner_fault_ends_the_run_with_its_reason(fault, why):
    faults = Faults(1, 1.0, {fault})
    end, reasons, calls = run(faults)
    assert end.finished
    assert reasons
    assert all(why in reason for reason in reasons)
    assert calls == []
    assert faults.counts() == {fault: 1}  # the same problem is hit in the same way


def test_nothing_hits_a_planner_without_faults():
    _, reasons, calls = run(Faults(1, 0.0, PLANNER))
    assert reasons == []
    assert {call.arguments["lamp"] for call in calls} == {"a", "b"}


def test_somebody_is_told_that_it_is_asked():
    heard = []

    async def reached(boundary):
        await asyncio.sleep(0)
        heard.append(boundary)

    run(Faults(1, 0.0), reached)
    assert set(heard) == {"while planning"}


def test_one_that_hangs_is_given_up_at_its_deadline_in_simulated_time():
    knowledge, ends = world(DOMAIN.schema, "a b - lamp"), []
    skills = ScriptedSkills(knowledge, {}, like=[Lamps()])
    planner = FaultyPlanner(OnePlan(), Faults(1, 1.0, {Fault.PLANNER_HANGS}))
    with Robot(DOMAIN, PLOTS, skills.components, knowledge, planner, clock="simulated") as robot:
        robot.listen(lambda record: ends.append(record.t) if record.type == "end" else None)
        robot.achieve("(forall (?l - lamp) (on ?l))", seconds=7)
    assert ends == [7 + PATIENCE]
