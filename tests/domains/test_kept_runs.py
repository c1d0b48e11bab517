"""The table in a store: broken off at boundaries, refused when something changed, looked at from the command line."""

from __future__ import annotations

import json
import os
import shutil
import sqlite3
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from kept_lives import SCENARIO, told

from domains.clean_up_table.bringup import HOME, bundle, deploy, world_of
from domains.clean_up_table.durable_world import KIND, DurableWorld
from domains.clean_up_table.scenario import Scenario
from dsc.dynamic.library import Library
from dsc.runs.store import RunStore
from dsc.sequencer.replay import replay
from dsc.text.profiles import find_profile
from knowledge_base import KnowledgeBase, Schema
from knowledge_base.errors import InputError, StoreError
from planning import resume

DSC = Path(sys.executable).with_name("dsc")
EVERY = 12
"""Of the boundaries of a run, one in so many is lived on from: 50 would take a minute."""


def copied(folder: Path, to: Path) -> Path:
    to.mkdir()
    for file in folder.iterdir():
        if not file.name.endswith(("-lock", "-shm")):
            shutil.copy(file, to)
    return to / "run.kb"


@pytest.fixture(scope="module")
def whole(planner, tmp_path_factory):
    """A run that was never broken off, with its report, its world, and copies of the files from its boundaries."""
    folder = tmp_path_factory.mktemp("kept")
    (alive := folder / "alive").mkdir()
    boundaries: list[int] = []
    copies: list[Path] = []

    def boundary(_):
        boundaries.append(1)
        if len(boundaries) % EVERY == 0:
            copies.append(copied(alive, folder / f"copy{len(copies)}"))

    class CopiedWorld(DurableWorld):
        def executed(self, action_id, result):
            super().executed(action_id, result)
            boundary(action_id)

    with deploy(Scenario.parse(SCENARIO), 3, 0.2, planner, store=alive / "run.kb") as table:
        world_of(table).__class__ = CopiedWorld
        report = table.report(prepare=lambda run: run.listen(boundary))
        return alive / "run.kb", replace(report, wall_s=0), world_of(table).state(), copies


def test_wherever_it_is_broken_off_it_ends_with_the_same_report(whole, planner, tmp_path):
    path, report, world, copies = whole
    assert len(copies) > 5
    for number, kept in enumerate(copies):
        copy = copied(kept.parent, tmp_path / str(number))
        with resume(bundle(), copy, planner=planner) as table:
            assert replace(table.report(), wall_s=0) == report
            assert world_of(table).state() == world
        assert told(copy) == told(path)


def test_a_store_changes_nothing_about_the_run(whole, planner):
    _, report, world, _ = whole
    table = deploy(Scenario.parse(SCENARIO), 3, 0.2, planner)
    assert replace(table.report(), wall_s=0) == report
    assert world_of(table).state() == world


def test_the_replay_of_a_run_with_plans_and_faults_comes_to_the_same(whole):
    path = whole[0]
    done = replay(path)
    assert done.divergence is None
    assert done.steps == len(told(path)[1])


def test_a_world_in_a_file_is_the_world_with_all_it_has_done(tmp_path):
    world = DurableWorld.from_state(Scenario.parse(SCENARIO).world(1, 0.5).state())
    world.create(tmp_path / "world")
    for action_id, to in (("a", "table"), ("b", "sink"), ("a", "nowhere")):
        world.drive(action_id, to)
    world.close()
    again = DurableWorld.open(tmp_path / "world")
    assert again.state() == world.state()
    assert again.drive("b", "sink") == world.done["b"]
    assert again.place_before("b") == "table"
    again.close()


def test_a_world_that_is_not_there_or_none_is_said_so(tmp_path):
    with pytest.raises(StoreError, match="the world of the run is missing"):
        DurableWorld.open(tmp_path / "none")
    (tmp_path / "text").write_text("this is no database, and long enough to be seen as none" * 20)
    with pytest.raises(StoreError, match="cannot read the world"):
        DurableWorld.open(tmp_path / "text")
    with pytest.raises(StoreError, match="there is no folder"):
        DurableWorld.from_state(Scenario.default().world().state()).create(tmp_path / "no" / "folder")


def _database(path: Path, *statements: str) -> None:
    with sqlite3.connect(path) as connection:
        for statement in ("CREATE TABLE world (state TEXT)", "CREATE TABLE done (action_id TEXT)", *statements):
            connection.execute(statement)
    connection.close()


def _link(path: Path) -> None:
    _database(path.with_name("mine"))
    path.symlink_to("mine")


STRANGERS = {
    "text": (lambda path: path.write_text("my notes\n"), "file is not a database"),
    "empty": (lambda path: path.touch(), "is empty"),
    "database": (_database, "this is a database, but no simulated world"),
    "link": (_link, "is a link"),
    "pipe": (os.mkfifo, "is a pipe"),
    "log": (lambda path: path.with_name(path.name + "-wal").write_text("mine"), "run.kb-world-wal"),
    "later": (lambda path: _database(path, f"PRAGMA application_id = {KIND.application_id}", "PRAGMA user_version = 9"),
              "the world has format 9, this program reads format 2"),
}  # fmt: skip


@pytest.mark.parametrize("stranger", STRANGERS)
def test_a_foreign_file_at_the_path_of_the_world_is_refused_and_unchanged(tmp_path, planner, stranger):
    spoil, message = STRANGERS[stranger]
    spoil(tmp_path / "run.kb-world")
    before = [(path.name, path.lstat(), path.is_fifo() or path.read_bytes()) for path in sorted(tmp_path.iterdir())]
    for use in (
        lambda: deploy(None, 3, 0.2, planner, store=tmp_path / "run.kb"),
        lambda: DurableWorld.from_state(Scenario.default().world().state()).create(tmp_path / "run.kb-world"),
        lambda: DurableWorld.open(tmp_path / "run.kb-world"),
    ):
        with pytest.raises(StoreError, match=message if stranger != "log" else "run.kb-world"):
            use()
        after = [(path.name, path.lstat(), path.is_fifo() or path.read_bytes()) for path in sorted(tmp_path.iterdir())]
        assert [one[::2] for one in after] == [one[::2] for one in before]
        assert [one[1].st_ino for one in after] == [one[1].st_ino for one in before]


def test_the_world_of_a_store_that_was_deleted_makes_place_for_the_next(tmp_path):
    for seed in (1, 2):
        world = DurableWorld.from_state(Scenario.parse(SCENARIO).world(seed, 0.5).state())
        world.create(tmp_path / "run.kb-world")
        world.drive("a", "sink")
        world.close()
        again = DurableWorld.open(tmp_path / "run.kb-world")
        assert (again.state(), list(again.done)) == (world.state(), ["a"])
        again.close()
    assert [path.name for path in tmp_path.iterdir()] == ["run.kb-world"]


def test_a_store_that_has_a_run_is_not_begun_anew(whole, planner):
    with pytest.raises(InputError, match="has a run already; the run has ended: take another file"):
        deploy(None, 3, 0.2, planner, store=whole[0])


def dsc(*words):
    done = subprocess.run([DSC, *map(str, words)], check=False, capture_output=True, text=True, timeout=120)
    return done.returncode, done.stdout, done.stderr


def test_the_run_of_another_program_is_left_to_that(tmp_path):
    with KnowledgeBase.open(Schema.parse("(define (domain d))"), tmp_path / "run.kb") as kb:
        store = RunStore(kb, tmp_path / "run.kb", header={"simulated": True})
        with store.writing:
            store.begin("patrol", {}, Library())
    with pytest.raises(StoreError, match="the run of 'patrol' in this store is another program's"):
        resume(bundle(), tmp_path / "run.kb")


def test_the_command_keeps_a_run_resumes_it_and_tells_what_happened(whole, tmp_path):
    _, report, _, copies = whole
    path = copied(copies[3].parent, tmp_path / "copy")
    status, out, _ = dsc("runs", "list", path)
    assert (status, out.split()[1], out.split()[-1]) == (0, "clean_up_table", "unfinished")
    assert "under way since" in dsc("runs", "show", path)[1]
    status, out, _ = dsc("run", "--resume", path, "--json")
    assert status == 0
    assert json.loads(out) | {"wall_s": 0} == json.loads(json.dumps(report.to_json()))
    assert dsc("runs", "list", path)[1].split()[-1] == "finished"
    assert dsc("runs", "replay", path)[1].endswith("all as they were\n")
    assert dsc("run", "--resume", path) == (2, "", f"dsc: {path}: there is no unfinished run in this store\n")


def test_the_command_ends_an_unfinished_run(whole, tmp_path):
    path = copied(whole[3][3].parent, tmp_path / "copy")
    assert dsc("runs", "end", path, "--reason", "no longer wanted")[:2] == (0, "the run has ended: no longer wanted\n")
    assert "ended early: no longer wanted" in dsc("runs", "list", path)[1]
    status, _, refused = dsc("runs", "end", path)
    assert status == 2
    assert "no unfinished run" in refused


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ["run"],
            "a run needs a robot, or a store to --resume; valid: arm-skills, attention, butler, clean-up-table, dialogue, elevator, fetch-skills, line-follower, …",
        ),
        (
            ["run", "--resume", "x.kb", "--seed", "1"],
            "--resume continues a run as it began, without --seed",
        ),
        (["run", "--resume", "x.kb", "--real-time"], "as it began, without --real-time"),
        (["run", "--resume", "x.kb"], "there is no store 'x.kb'"),
        (["runs", "list", "x.kb"], "there is no store 'x.kb'"),
        (["runs", "replay", __file__], "cannot read the store: file is not a database"),
    ],
)
def test_a_mistake_is_one_line(words, message):
    status, out, error = dsc(*words)
    assert (status, out) == (2, "")
    assert message in error
    assert error.count("\n") == 1


def test_another_robot_is_the_same_one_after_the_crash(planner, tmp_path):
    (alive := tmp_path / "alive").mkdir()
    copies: list[Any] = []
    profile = find_profile("on_tracks", bundle().profiles or HOME)

    def boundary(_):
        if len(copies) < 30:
            copies.append(copied(alive, tmp_path / f"copy{len(copies)}") if len(copies) in (15, 29) else None)

    with deploy(Scenario.parse(SCENARIO), 3, 0.2, planner, store=alive / "run.kb", profile=profile) as table:
        report = replace(table.report(prepare=lambda run: run.listen(boundary)), wall_s=0)
        world = world_of(table).state()
    for path in filter(None, copies):
        with resume(bundle(), path, planner=planner) as table:
            assert table.header()["profile"] == profile.digest
            assert replace(table.report(), wall_s=0) == report
            assert world_of(table).state() == world
        assert told(path) == told(alive / "run.kb")
