"""Plans that do not go on, kept in a store: wherever such a run is broken off, it is mended in the very same way."""

import asyncio
import copy
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from breadth_first import BreadthFirst
from errands import DOMAIN, HOLDER, ROOMS, ROUND
from obedient_robot import FAILED, plots

from dsc import Component, Outcome, SkillCall, parse_plot, skill
from dsc.runs.archive import archive
from dsc.trace import Record
from knowledge_base import Delta, fact
from planning import PlanStep, Robot
from planning.analysis.validation import Validation


class Failed(Outcome): ...


class Did(Outcome): ...


class LastingRobot(Component):
    """Does each action id once, and goes on when the program dies; `crash` is called when it has done something."""

    name = "robot"

    def __init__(self, script=None, concurrent=False, crash=lambda: None):
        super().__init__()
        self.concurrent = concurrent
        self.script = {step: list(answers) for step, answers in (script or {}).items()}
        self.done: list[str] = []
        self.ended: dict[str, Outcome] = {}
        self.crash = crash
        self.knowledge: Any = None

    def again(self):
        """The same robot, as the next program finds it."""
        other = LastingRobot(concurrent=self.concurrent)
        other.script, other.done, other.ended = copy.deepcopy((self.script, self.done, self.ended))
        return other

    @skill(after_crash="same_id")
    async def act(
        self, call: SkillCall, way: str, action: str, one: str = "", two: str = "", three: str = ""
    ) -> Did | Failed:
        """One planning action, done in one way."""
        await call.clock.sleep(1.0)
        if call.action_id not in self.ended:
            step = PlanStep(action, tuple(filter(None, (one, two, three))))
            self.done.append(f"{step}" if way == action else f"{way}: {step}")
            answers = self.script.get(self.done[-1], [])
            observed = answers.pop(0) if answers else DOMAIN.effects(step, self.knowledge)
            self.ended[call.action_id] = Failed() if observed == FAILED else Did(observed=observed or Delta())
            self.crash()
        return self.ended[call.action_id]  # type: ignore[return-value]


class Refuses:
    """Foresees that one step fails."""

    def __init__(self, step):
        self.step = step

    def foresee(self, plan, world):
        steps = list(map(str, plan.steps))
        if self.step not in steps:
            return Validation(valid=True)
        return Validation(valid=False, failing_step=steps.index(self.step), why="it is slippery")


def executive(robot, store, goal, ways=None, foresight=None):
    holder = parse_plot(HOLDER.replace("GOAL", goal).replace("REPLANS", "4"))
    program = Robot(
        DOMAIN,
        [holder, *plots(DOMAIN, ways)],
        [robot],
        planner=BreadthFirst(),
        foresight=foresight,
        store=store,
        clock="simulated",
    )
    robot.knowledge = program.knowledge
    return program


def told(path):
    with archive(path) as runs:
        return [replace(step, records=()) for step in runs.steps(1)], runs.run().ended


def plate(*added):
    return Delta(nodes={"plate": "thing"}, added=added)


LATE = plate(fact("in", "plate", "a"))
GONE = Delta(removed=(fact("in", "cup", "a"),), added=(fact("in", "cup", "b"),))
BLOCKED = Delta(removed=(fact("way", "b", "c"),))
DROPPED = Delta(removed=(fact("at", "b"), fact("holding", "cup")), added=(fact("at", "c"), fact("in", "cup", "c")))
CASES = {
    "the plan goes on": ("(in cup c)", {"script": {"(go b c)": [FAILED]}}, "resumed"),
    "another candidate": (
        "(holding cup)",
        {"script": {"by_hand: (take cup a)": [FAILED] * 9}, "ways": {"take": ["by_hand", "with_tongs"]}},
        "resumed",
    ),
    "done without": ("(at c)", {"script": {"(go a b)": [FAILED] * 9, "(go b c)": [FAILED] * 9}}, "excluded"),
    "given up": ("(at c)", {"script": {f"(go {one})": [FAILED] * 9 for one in ROUND}}, "gave_up"),
    "mended": (
        "(and (in cup d) (clean d) (clean c))",
        {"script": {"(go b c)": [DROPPED]}, "ways_between": ("a b", "b c", "c d")},
        "replaced",
    ),
    "broken meanwhile": ("(forall (?t - thing) (in ?t b))", {"then": LATE}, "replaced"),
    "another way": ("(at c)", {"then": BLOCKED, "ways_between": ("a b", "b c", "a d", "d c")}, "replaced"),
    "hit": ("(in cup c)", {"then": GONE}, "broken"),
    "skipped": ("(and (clean a) (clean b) (clean c))", {"then": Delta(added=(fact("clean", "b"),))}, "skipped"),
    "reached": ("(clean c)", {"then": Delta(added=(fact("clean", "c"),))}, "skipped"),
    "side by side": (
        "(and (holding cup) (clean a))",
        {"script": {"(sweep a)": [FAILED]}, "concurrent": True},
        "skipped",
    ),
    "foreseen": ("(at c)", {"foresight": Refuses("(go b c)"), "script": {"(go d c)": [FAILED]}}, "rejected"),
}


class Kept:
    """A run in a store, with a copy of store and robot from each boundary."""

    def __init__(self, tmp_path, goal, how, also=lambda sequencer: None):
        self.goal, self.more = goal, {name: how[name] for name in ("ways", "foresight") if name in how}
        self.copies: list[tuple[Path, Any]] = []
        self.records: list[Record] = []
        self.robot = LastingRobot(how.get("script"), how.get("concurrent", False))
        (alive := tmp_path / "alive").mkdir()
        self.path = alive / "run.kb"

        def crash(_=None):
            to = tmp_path / f"copy{len(self.copies)}"
            shutil.copytree(alive, to, ignore=shutil.ignore_patterns("*-lock", "*-shm"))
            self.copies.append((to / "run.kb", self.robot.again()))

        def prepare(sequencer):
            nodes = {**dict.fromkeys(ROOMS, "room"), "cup": "thing"}
            ways = [fact("way", *one.split()) for one in how.get("ways_between", ROUND)]
            known = (fact("at", "a"), fact("in", "cup", "a"), *ways)
            sequencer.knowledge.apply(Delta(nodes=nodes, added=known), "test")
            if "then" in how:
                sequencer.change(how["then"], "somebody", after=0.5)
            sequencer.listen(crash)
            also(sequencer)

        self.robot.crash = crash
        with executive(self.robot, self.path, goal, **self.more) as program:
            program.listen(self.records.append)
            assert program.run("errand", prepare=prepare).finished

    def check(self, path, robot):
        """Resumed, a copy comes to the same end by the same steps."""
        with executive(robot, path, self.goal, **self.more) as program:
            assert program.resume().finished
        assert robot.done == self.robot.done
        assert told(path) == told(self.path)


@pytest.mark.parametrize(("goal", "how", "kind"), CASES.values(), ids=CASES)
def test_wherever_it_is_broken_off_it_goes_on_as_it_would_have(tmp_path, goal, how, kind):
    kept = Kept(tmp_path, goal, how)
    assert f"plan.{kind}" in {record.type for record in kept.records}
    for path, robot in kept.copies[1:]:
        kept.check(path, robot)


def test_a_pending_planner_event_is_not_lost_after_another_change(tmp_path):
    spoon = Delta(nodes={"spoon": "thing"})

    def also(sequencer):
        loop = asyncio.get_running_loop()
        heard = lambda change: change.author == "somebody" and loop.call_soon(sequencer.change, spoon, "another")  # noqa: E731
        sequencer.knowledge.subscribe(heard)

    kept = Kept(tmp_path, CASES["hit"][0], CASES["hit"][1], also)
    checked = 0
    for path, robot in kept.copies[1:]:
        with archive(path) as runs:
            memory = runs.latest_snapshot().memory.get("planner", "")
        if '"plan_invalid"' in memory:
            kept.check(path, robot)
            checked += 1
    assert checked
