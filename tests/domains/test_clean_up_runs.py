"""The main job, whole: honest over many seeds, the same twice, and through everything at once."""

import io
import json
from typing import Any

import pytest

from domains.clean_up_table import Scenario, deploy, world_of
from domains.clean_up_table.world_faults import GRASP_FAILED, ITEM_SLIPPED, Draw
from dsc import Event
from dsc.trace import header, write_to
from knowledge_base import Delta, fact


def run(planner, seed=0, faults=0.0, scenario=None, listener=None, prepare=None):
    table = deploy(scenario, seed, faults, planner, listener)
    return table, table.report(prepare=prepare)


def test_a_table_without_faults_is_cleared_in_the_fewest_trips(planner):
    table, report = run(planner)
    assert report.goal_reached
    assert (report.own["items"], report.left, report.own["trips"], report.plans, report.replans) == (9, (), 3, 1, 0)
    assert not report.skill_failures
    assert world_of(table).robot_at == "operator"


@pytest.mark.parametrize(
    ("table", "trips"),
    [
        ("{cups: 1}", 1),
        ("{cans: 2}", 2),
        ("{cans: 3, crisp_cans: [large]}", 2),
        ("{cups: 2, cans: 2, crisp_cans: [small, small]}", 3),
        ("{cups: 6, cans: 4, crisp_cans: [large, large]}", 3),
        ("{items: {red_cup: cup, pringles: {kind: crisp_can, size: large}, coke: {kind: can, behind: pringles}}}", 3),
    ],
)
def test_stacking_saves_trips(planner, table, trips):
    _, report = run(planner, scenario=Scenario.parse(f"table: {table}"))
    assert report.goal_reached
    assert report.own["trips"] == trips


def test_an_empty_table_is_reported_clear_without_a_plan(planner):
    _, report = run(planner, scenario=Scenario.parse("table: {}"))
    assert (report.goal_reached, report.own["items"], report.plans, report.own["trips"]) == (True, 0, 0, 0)


@pytest.mark.parametrize("seed", range(12))
def test_every_run_ends_with_the_truth(planner, seed):
    table, report = run(planner, seed, 0.2)
    assert report.problem is None
    assert {one.what for one in report.left} == world_of(table).touched()
    assert report.goal_reached == (not report.left) == world_of(table).goal_reached
    assert all(one.reason for one in report.left)
    if not any(fault.permanent for fault in world_of(table).fired):
        assert report.goal_reached
    disposed = {item.name for item in world_of(table).items if item.disposed}
    assert {found["item"] for found in table.knowledge.query("(disposed ?item)")} == disposed


@pytest.mark.parametrize("faults", [0.5, 0.9])
def test_however_often_things_fail_the_run_ends_with_the_truth(planner, faults):
    table, report = run(planner, 1000, faults)
    assert report.problem is None
    assert {one.what for one in report.left} == world_of(table).touched()


def traced(planner, seed):
    stream = io.StringIO()
    table = deploy(None, seed, 0.2, planner, write_to(stream))
    stream.write(header(**table.header()) + "\n")
    table.report()
    return stream.getvalue()


def test_the_same_seed_gives_the_same_trace_byte_for_byte(planner):
    first = traced(planner, 11)
    assert first == traced(planner, 11)
    assert first != traced(planner, 12)
    records = [json.loads(line) for line in first.splitlines()]
    assert records[0]["format"] == "dsc-trace"
    seqs = [record["seq"] for record in records[1:]]
    assert seqs == list(range(1, len(seqs) + 1))
    assert all(record["cause"] is None or record["cause"] < record["seq"] for record in records[1:])
    kinds = {record["type"] for record in records[1:]}
    assert {
        "plot",
        "event",
        "step",
        "decision",
        "knowledge",
        "action",
        "plan.asked",
        "plan.found",
        "scene",
        "end",
    } <= kinds
    ordered = {record["plot"]: record for record in records[1:] if record["type"] == "plan.ordered"}
    made = {record["plot"]["plot"]: record["plot"] for record in records[1:] if record["type"] == "plot"}
    assert ordered.keys() == {name for name, plot in made.items() if plot.get("generated")}
    for name, plan in ordered.items():
        steps = [state["about"] for state in made[name]["states"].values() if "dynamic" in state]
        assert (steps, bool(plan["links"])) == (plan["steps"], True)


class Script:
    """Stands in for `Faults.draw`: the given kind in the first call for which it is possible, one after another."""

    def __init__(self, *kinds):
        self.left = list(kinds)

    def __call__(self, _action_id, possible):
        if self.left and self.left[0] in possible:
            return Draw(self.left.pop(0), permanent=False)
        return None


def test_through_everything_at_once(planner, monkeypatch):
    """Somebody adds an item while the planner works, a grasp fails while a rule recovers, stop and restart."""
    seen = []
    holder: dict[str, Any] = {}

    def listener(record):
        seen.append(record)
        if record.type == "plan.asked" and "added" not in holder:
            holder["added"] = world_of(table).add_item("cup")
            # A bystander tells the robot, so that the plan being made is already wrong when it comes.
            told = Delta(
                nodes={holder["added"]: "cup"},
                added=(
                    fact("seen", holder["added"]),
                    fact("graspable", holder["added"]),
                    fact("goes-to", holder["added"], "sink"),
                    fact("lies-at", holder["added"], "table"),
                    fact("free-room", holder["added"], "one"),
                ),
            )
            holder["sequencer"].change(told, "bystander")
        if record.type == "event" and record.data["name"] == "grasp_failed" and "stopped" not in holder:
            holder["stopped"] = True
            holder["sequencer"].post(Event("stop"), after=1.0)
            holder["sequencer"].post(Event("restart"), after=100.0)

    table = deploy(None, 0, 0.0, planner, listener)
    script = Script(ITEM_SLIPPED, GRASP_FAILED)
    monkeypatch.setattr(world_of(table).faults, "draw", script)
    report = table.report(prepare=lambda sequencer: holder.update(sequencer=sequencer))

    assert script.left == []
    assert report.goal_reached
    assert report.own["items"] == 10
    assert world_of(table).items[holder["added"]].disposed
    assert report.recoveries["slipped: pick_up_from_above, replan"] == 1
    entered = [path for r in seen if r.type == "step" for m in r.data["microsteps"] for path in m["entered"]]
    assert entered.count("stopped") == 1
    stop = next(r.t for r in seen if r.type == "event" and r.data["name"] == "stop")
    restart = next(r.t for r in seen if r.type == "event" and r.data["name"] == "restart")
    between = [r for r in seen if stop < r.t < restart and r.type in {"event", "action"}]
    assert between == []  # after a stop nothing moves until the restart


def test_a_stop_is_obeyed_while_the_planner_works(planner):
    seen = []
    holder = {}

    def listener(record):
        seen.append(record)
        if record.type == "plan.asked" and "stopped" not in holder:
            holder["stopped"] = record.t
            holder["sequencer"].post(Event("stop"))
            holder["sequencer"].post(Event("restart"), after=60.0)

    table = deploy(None, 0, 0.0, planner, listener)
    report = table.report(prepare=lambda sequencer: holder.update(sequencer=sequencer))
    stops = [r for r in seen if r.type == "event" and r.data["name"] == "stop"]
    assert stops[0].t == holder["stopped"]
    found = [r.t for r in seen if r.type == "plan.found"]
    assert min(found) >= holder["stopped"] + 60.0
    assert report.goal_reached


def test_an_operator_who_never_restarts_gets_an_honest_report(planner):
    _, report = run(planner, prepare=lambda sequencer: sequencer.post(Event("stop"), after=30.0))
    assert not report.goal_reached
    assert report.problem is None
    assert all(one.reason.endswith("the operator stopped the run") for one in report.left)
    assert len(report.left) > 0
