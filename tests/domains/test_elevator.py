"""The elevator: the paper's sequence, a mishap in each phase, faults by seed, and interrupted runs."""

from __future__ import annotations

import asyncio
from collections import Counter
from itertools import groupby

import pytest

from domains.elevator import Scenario, bundle
from domains.elevator.floors import FLOORS
from domains.elevator.talk import floor_in
from dsc.sequencer.clock import SimulatedEventLoop
from dsc.trace import Record
from planning import deploy, resume

CYCLE = {"check_door", "face_person", "ask_for_floor"}


class Mishaps:
    """Mishaps of some kinds, each as often as its name is given."""

    def __init__(self, *kinds):
        self.left = Counter(kinds)

    def __call__(self, _action, *kinds):
        kind = next((one for one in kinds if self.left[one]), None)
        if kind is not None:
            self.left[kind] -= 1
        return kind


def ride(*mishaps, seed=4, **scenario):
    """Return the report, the records and the simulation of a ride with these mishaps."""
    records: list[Record] = []
    with deploy(bundle(), scenario=Scenario(**scenario), seed=seed, listener=records.append) as robot:
        robot.simulation.ride.mishap = kinds = Mishaps(*mishaps)
        report = robot.report()
        assert not any(kinds.left.values()), "the mishap has not happened"
        return report, records, robot.simulation


def steps(records):
    """Return the plots of planning actions that began."""
    return [one.data["chosen"] for one in records if one.type == "decision"]


def arcs(records, *predicates):
    added = [tuple(one) for record in records if record.type == "knowledge" for one in record.data.get("added", ())]
    return [one for one in added if one[0] in predicates]


def test_the_sequence_of_the_paper():
    """Figure by figure of section 6.2.1: the tree sets goals; three actions are repeated, and the fourth ends the ride."""
    report, records, simulation = ride()
    assert report.goal_reached
    done = steps(records)
    assert done[:2] == ["check_door", "enter_elevator"]
    assert done[-1] == "exit_elevator"
    assert set(done[2:-1]) == CYCLE
    assert simulation.ride.place == "floor3"
    question = "Excuse me, what is this floor?"
    assert arcs(records, "ask", "reply", "at-floor")[:3] == [
        ("ask", "robot", "anna", question),
        ("reply", "anna", "robot", question, "We are on floor 0."),
        ("at-floor", "robot", "floor0"),
    ]
    goals = [record.data["goal"] for record in records if record.type == "plan.asked"]
    assert [goal for goal, _ in groupby(goals)] == ["(or (inside) (arrived floor3))", "(arrived floor3)"]


@pytest.mark.parametrize(
    ("mishaps", "how"),
    [
        (["stuck"], "the door does not open"),
        (["full", "full"], "the lift is full"),
        (["hidden"], "the person turns away"),
        (["no answer", "no answer"], "no answer"),
        (["wrong floor"], "a wrong floor"),
        (["blocked"], "a person stands in the way"),
    ],
)
def test_a_mishap_in_each_phase(mishaps, how):
    report, _, simulation = ride(*mishaps)
    assert report.goal_reached, how
    assert simulation.ride.place == "floor3"


def test_a_wrong_answer_and_a_second_ride():
    class Liar(Mishaps):
        def __call__(self, _action, *kinds):
            lift = simulation.ride.lift.last_stop(simulation.ride.second)
            lie = "wrong floor" in kinds and lift.floor == "floor2" and not self.left["told"]
            self.left["told"] += lie
            return "wrong floor" if lie else None

    records: list[Record] = []
    with deploy(bundle(), seed=7, listener=records.append) as robot:
        simulation = robot.simulation
        simulation.ride.mishap = liar = Liar()
        report = robot.report()
    assert liar.left["told"] == 1
    assert report.goal_reached
    assert steps(records).count("enter_elevator") > 1


def test_another_person_after_one_who_leaves():
    report, records, _ = ride(seed=1)  # anna leaves at the next stop
    assert report.goal_reached
    assert len({person for _, _, person, _ in arcs(records, "ask")}) > 1


def test_nobody_who_could_be_asked():
    report, _, simulation = ride(persons=())
    assert not report.goal_reached
    assert report.outcome == "did_not_arrive"
    (left,) = report.left
    assert (left.what, left.where) == ("robot", "lift")
    assert "in-lift" in left.reason
    assert len(simulation.riders.said) == 0


@pytest.mark.parametrize("seed", range(1, 51))
def test_the_goal_or_an_honest_report_under_faults(seed):
    with deploy(bundle(), seed=seed, faults=0.3) as robot:
        report = robot.report()
        place = robot.simulation.ride.place
    assert report.programming_error is None
    assert report.goal_reached == (place == "floor3")
    assert report.goal_reached or report.left[0].reason


@pytest.mark.parametrize("second", [0.05, 5.0, 7.5, 10.0, 20.0, 34.5, 36.0, 71.0, 74.0])
def test_a_ride_that_a_crash_has_interrupted(tmp_path, second):
    with deploy(bundle(), seed=4, store=tmp_path / "whole.kb") as robot:
        whole = robot.report()
    killed = deploy(bundle(), seed=4, store=tmp_path / "run.kb", clock="simulated")
    kept = []  # a killed program cleans nothing up

    async def begin():
        kept.append(asyncio.ensure_future(killed.start("take_elevator", header=killed.header())))
        await asyncio.sleep(second)

    SimulatedEventLoop().run_until_complete(begin())
    killed.knowledge.close()
    with resume(bundle(), tmp_path / "run.kb") as robot:
        report = robot.report()
        assert robot.simulation.ride.place == "floor3"
    assert report.goal_reached
    assert report.simulated_s == pytest.approx(whole.simulated_s, abs=2)


@pytest.mark.parametrize(
    ("words", "floor"),
    [
        ("We are on floor 3.", "floor3"),
        ("the third floor, I think", "floor3"),
        ("3", "floor3"),
        ("This is the lobby", "floor0"),
        ("13", "none"),
        ("no idea", "none"),
    ],
)
def test_floors_in_answers(words, floor):
    assert floor_in.body(words) == floor
    assert floor == "none" or floor in FLOORS
