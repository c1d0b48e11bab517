"""Plans of goals: kept until a text or file changes, shared by several questions, and limited in time."""

from __future__ import annotations

import asyncio
import os
import sys
from pathlib import Path

import pytest

from dsc.editing.goals import Goal, goals_of, unknown_values
from dsc.editing.plans import Plans
from dsc.editing.projects import Project
from dsc.editing.workspace import Workspace

GOAL = Goal(0, 1, "(done)")
COUNT = """
import json, pathlib, sys
log = pathlib.Path("log.txt")
log.write_text((log.read_text() if log.exists() else "") + "x")
print(json.dumps({"outcome": sys.argv[3].strip("()"), "steps": [], "text": log.read_text()}))
"""


@pytest.fixture
def home(tmp_path) -> Project:
    (tmp_path / "robot.py").write_text("")
    return Project(tmp_path, tmp_path / "robot.py", str(tmp_path))


def counting() -> Plans:
    return Plans([sys.executable, "-c", COUNT])


def test_a_plan_is_kept_until_a_text_or_a_file_changes(home):
    async def work() -> list[str]:
        plans, file = counting(), home.root / "a.yaml"

        async def ask(texts: dict[Path, str]) -> str:
            answer: str = (await plans.plan(file, GOAL, home, texts))["text"]
            return answer

        found = [await ask(texts) for texts in ({}, {}, {file: "a"}, {file: "a"}, {file: "b"})]
        os.utime(home.main, ns=(1, 1))
        return [*found, await ask({file: "b"})]

    assert asyncio.run(work()) == ["x", "x", "xx", "xx", "xxx", "xxxx"]


def test_two_questions_about_one_goal_share_a_process_and_one_may_be_cancelled(home):
    async def work() -> str:
        plans = counting()
        first = asyncio.ensure_future(plans.plan(home.main, GOAL, home, {}))
        second = asyncio.ensure_future(plans.plan(home.main, GOAL, home, {}))
        await asyncio.sleep(0)
        first.cancel()
        answer: str = (await second)["text"]
        return answer

    assert asyncio.run(work()) == "x"


def test_a_search_that_was_too_slow_is_repeated(home):
    async def work() -> str:
        plans, slow = counting(), Goal(0, 1, "(timed_out)")
        await plans.plan(home.main, slow, home, {})
        answer: str = (await plans.plan(home.main, slow, home, {}))["text"]
        return answer

    assert asyncio.run(work()) == "xx"


def test_a_process_that_fails_is_the_reason(home):
    plans = Plans([sys.executable, "-c", "raise SystemExit('no good')"])
    answer = asyncio.run(plans.plan(home.main, GOAL, home, {}))
    assert answer == {"outcome": "not_planned", "steps": [], "text": "planning failed: no good"}


def test_the_end_of_the_server_ends_a_search(home):
    async def work() -> bool:
        plans = Plans([sys.executable, "-c", "while True: pass"])
        asked = asyncio.ensure_future(plans.plan(home.main, GOAL, home, {}))
        await asyncio.sleep(0)
        await plans.stop()
        await asyncio.wait([asked])
        return asked.cancelled()

    assert asyncio.run(work())


@pytest.mark.parametrize(
    ("name", "text", "spans"),
    [
        ("a.yaml", "plot: a\nstates:\n  go: {goal: (b)}\n  on: {states: {goal: {final: true}}}\n", ["goal: (b)"]),
        ("a.yaml", "plot: a\nstates:\n  go:\n    goal: >\n      (b)\n  go: {goal: (b", []),
        (
            "a.pddl",
            "; (:goal (a))\n(define (problem p) (:goal ; )\n (and (a) (b)))\n)",
            ["(:goal ; )\n (and (a) (b)))"],
        ),
        ("a.pddl", "(define (problem p) (:goal (and (a", []),
        ("a.txt", "goal: (b)", []),
    ],
)
def test_the_goals_of_a_text(name, text, spans):
    page = Workspace().page(Path("/x") / name, text)
    assert [text[one.begin : one.end] for one in goals_of(page)] == spans


def test_the_values_that_a_goal_needs():
    assert "?item, ?to," in unknown_values("(and (at ?item ?to) (forall (?x - room) (clean ?x ?item)))")
    assert unknown_values("(exists (?x - room) (clean ?x))") == unknown_values("(half") == ""
