"""What people see of a run."""

import io

import pytest
from rich.console import Console

from dsc.trace import Record
from planning.robot.progress import LiveProgress, PlainProgress
from planning.robot.tally import Tally


def record(seq, type_, **data):
    return Record(seq, float(seq), type_, None, data)


def step(entered=(), taken=()):
    return {"microsteps": [{"event": None, "taken": list(taken), "exited": [], "entered": list(entered)}]}


PLOT = {
    "plot": "main",
    "states": {
        "group": {
            "states": {"look": {"use": "search"}, "decide": {}},
            "on": {"slipped": {"to": "retried", "rule": "slipped: pick, retry"}},
        },
        "retried": {"use": "pick", "about": "slipped: pick, retry"},
        "end": {"final": True},
    },
}
PLAN = {
    "plot": "plan_1", "generated": True,
    "states": {"step_1": {"about": "(pick cup)", "dynamic": ["pick"]}, "step_1_slipped_0_retry": {"about": "rule", "use": "x"}},
}  # fmt: skip
RECORDS = [
    record(1, "plot", plot=PLOT),
    record(2, "step", **step(["group", "group/decide", "look"])),
    record(3, "plan.found", plot="plan_1", steps=["(pick cup)"], engine="fake"),
    record(4, "plot", plot=PLAN),
    record(5, "step", **step(["clear/execute/step_1", "clear/execute/step_1/pick", "retried"])),
    record(6, "rule", rule="slipped: pick, retry", state="clear/execute/step_1"),
    record(7, "plan.none", kind="timed_out", reason="no plan within 5 s"),
    record(8, "plan.broken", reason="(on cup) is false", author="somebody", step=1),
    record(8, "plan.failed", plot="plan_1", steps=["(pick cup)"], why="no_path"),
    record(9, "plan.resumed", plot="plan_2", after="plan_1", step="(pick cup)", why="no_path"),
    record(10, "plan.skipped", plot="plan_3", steps=["(pick cup)", "(put cup)"], why="the goal holds"),
    record(11, "plan.excluded", step="(pick cup)", seconds=120.0, why="no_path"),
    record(12, "plan.readmitted", steps=["(pick cup)"]),
    record(13, "plan.rejected", step="(pick cup)", reason="(pick cup) ends in gone: gone", engine="fake"),
    record(14, "plan.gave_up", plot="plan_3", reason="the budget of 2 new plans is used up: no_path"),
    record(15, "end", finished=False, problem="nobody handles 'x'"),
]
LINES = [
    "look", "plan with 1 step (fake)", "rule  slipped: pick, retry  at (pick cup)", "step   1  (pick cup)",
    "no plan, timed_out: no plan within 5 s", "the plan no longer holds: (on cup) is false", "failed: (pick cup): no_path",
    "the plan resumes at (pick cup): no_path", "skipped (pick cup), (put cup): the goal holds",
    "(pick cup) is excluded for 120 s: no_path", "(pick cup) may be planned again: there is no plan without",
    "a plan fails in the simulation: (pick cup) ends in gone: gone",
    "gave up: the budget of 2 new plans is used up: no_path",
    "ended early: nobody handles 'x'",
]  # fmt: skip


def test_plain_lines_say_what_is_worth_knowing():
    lines: list[str] = []
    progress = PlainProgress(lines.append)
    for one in RECORDS:
        progress(one)
    assert [line.split(" s  ", 1)[1] for line in lines] == LINES


@pytest.mark.parametrize("skill", ["arm.grasp", "planner.plan"])
def test_on_a_terminal_a_status_line_stands_below_the_same_lines(skill):
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=100)
    tally = Tally()
    with LiveProgress(console, lambda: 4, tally) as progress:
        for one in [*RECORDS, record(16, "action", action="start", id="a1", skill=skill, arguments={"item": "[cup]"})]:
            tally(one)
            progress(one)
    shown = screen.getvalue()
    assert all(line in shown for line in LINES)
    assert "left 4  plans 1" in shown
    assert ("arm.grasp([cup])" in shown) == (skill == "arm.grasp")


def test_steps_that_stand_side_by_side_are_told_as_well():
    lane = {"states": {"before_2": {}, "step_2": {"about": "(throw can)", "dynamic": ["throw"]}}}
    plan = {"plot": "plan_2", "generated": True, "states": {"work": {"regions": {"anna": lane}}}}
    lines: list[str] = []
    progress = PlainProgress(lines.append)
    progress(record(1, "plot", plot=plan))
    progress(record(2, "step", **step(["clear/execute/work", "clear/execute/before_2", "clear/execute/step_2"])))
    progress(record(3, "end", finished=True, problem=None))
    assert [line.split(" s  ", 1)[1] for line in lines] == ["step   2  (throw can)"]
