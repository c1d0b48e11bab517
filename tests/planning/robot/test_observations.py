"""Monitoring profiles of robots: their observations become records of each run, and change nothing else (S1.19, S2.20)."""

from __future__ import annotations

import asyncio
import re

import pytest

from dsc import Component, Outcome, Push, SkillCall, parse_plot, skill
from dsc.monitoring.profile import parse_monitoring
from dsc.runs.archive import records_of
from dsc.sequencer.clock import run_simulated
from dsc.trace import Record
from knowledge_base import UnknownNameError
from planning import Robot, deploy
from planning.robot import observations
from planning.robot.bundles import installed

DOMAIN = "(define (domain d) (:predicates (p)))"


class Heated(Outcome): ...


class Oven(Component):
    name = "oven"
    heat = Push({"celsius": "number"})

    @skill
    async def warm(self, call: SkillCall, seconds: float) -> Heated:
        for celsius in range(int(seconds)):
            self.heat.put(celsius=celsius)
            await call.clock.sleep(1.0)
        return Heated()

    @skill(unlimited=True)
    async def guard(self, call: SkillCall) -> Heated:
        await asyncio.Event().wait()
        return Heated()


WARM = """
plot: warm
states:
  warm: {entry: {trigger: oven.warm, with: {seconds: 10}}, on: {heated: over}}
  over: {final: true}
"""
WATCH = (
    "{plot: watch, receives: {enough: }, states: {watch: {entry: {trigger: oven.guard},"
    " on: {heated: over, enough: over}}, over: {final: true}}}"
)
PROFILE = "{monitor: m, sample: 2, components: {oven: {diagnose: {life: 5}, streams: {heat: 3}}}}"


def robot_of(text: str, profile: str | None = PROFILE, **how):
    robot = Robot(DOMAIN, [parse_plot(text)], [Oven()], **{"clock": "simulated", **how})
    records: list[Record] = []
    robot.listen(records.append)
    if profile is not None:
        robot.monitor(parse_monitoring(profile, "m.yaml"))
    return robot, records


def observed(records):
    return [(one.t, one.data["entry"], one.data["value"]) for one in records if one.type == "observation"]


def test_observations_are_records_of_the_run_and_are_kept(tmp_path):
    robot, records = robot_of(WARM, store=tmp_path / "oven.db")
    with robot:
        assert robot.run("warm").reached
        _, kept = records_of(tmp_path / "oven.db")
    heats = [(t, value["celsius"]) for t, entry, value in observed(records) if entry == "heat"]
    assert heats == [(0.0, 0), (3.0, 3), (6.0, 6), (9.0, 9)]
    assert [t for t, entry, _ in observed(records) if entry == "life"] == [0.0, 6.0]
    assert {one.cause for one in records if one.type == "observation"} == {None}
    assert observed(kept) == observed(records)


@pytest.mark.parametrize("plot", [WARM, WATCH])
def test_a_run_ends_as_without_a_monitor(plot):
    ends = []
    for profile in (PROFILE, None):
        robot, records = robot_of(plot, profile)
        with robot:
            end = robot.run(parse_plot(plot).name)
        ends.append((end.finished, end.problem, records[-1].t))
    assert ends[0] == ends[1]


def test_time_of_an_idle_open_ended_run_stands_still():
    robot, records = robot_of(WATCH)

    async def main():
        run = robot.start("watch", open_ended=True)
        for _ in range(1_000):
            await asyncio.sleep(0)
        run.post("enough", after=5.0)
        return await run

    with robot:
        assert run_simulated(main()).finished
    assert max(one.t for one in records) == 5.0


def test_names_that_do_not_exist_are_refused():
    for profile in (PROFILE.replace("oven", "ofen"), PROFILE.replace("heat", "heap")):
        with pytest.raises(UnknownNameError, match=r"did you mean '(oven|heat)'"):
            robot_of(WARM, profile)


def test_an_entry_that_the_diagnosis_lacks_is_the_last_observation():
    robot, records = robot_of(WARM, PROFILE.replace("life", "live"))
    with robot:
        assert robot.run("warm").reached
    ((_, entry, value),) = [one for one in observed(records) if one[1] != "heat"]
    assert entry == "problem"
    assert "did you mean 'life'" in value


def test_an_idle_run_omits_observations_beyond_a_limit(monkeypatch, caplog):
    monkeypatch.setattr(observations, "MOST_BETWEEN_STEPS", 3)
    robot, records = robot_of(WARM, PROFILE.replace("heat: 3", "heat: change"))
    with robot:
        assert robot.run("warm").reached
    assert len(observed(records)) == 3
    assert re.search("omits observations until its next step", caplog.text)


def test_a_robot_that_plans_is_observed():
    robot = deploy(installed()["clean-up-table"], seed=1)
    records: list[Record] = []
    robot.listen(records.append)
    with robot:
        robot.monitor(parse_monitoring("{monitor: m, components: {arm: {diagnose: {life: change, mode: change}}}}"))
        assert robot.report().goal_reached
    assert next(value for _, entry, value in observed(records) if entry == "life") in {"init", "alive"}
