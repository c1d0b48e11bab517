"""Pruned stores: the oldest runs or all runs are gone, and what is kept is verified, replayed, resumed and continued."""

from __future__ import annotations

import asyncio
import sqlite3
from contextlib import closing

import pytest
from days_soak import Body, robot
from typer.testing import CliRunner

from dsc import replay, run_simulated
from dsc.cli.runs import app
from dsc.runs.archive import archive, has_run, is_unfinished
from dsc.runs.pruning import forget_runs, prune
from knowledge_base import DamagedStoreError, InputError, KnowledgeBase, StoreError

GOALS = ("(in cup d)", "(in book a)", "(in cup a)", "(in book d)", "(at c)", "(in cup c)")


def served(store, goals=GOALS):
    """Reach the goals, each in a run; return the keys of the executed actions."""
    body = Body()
    with robot(store, body) as one:
        assert all(one.achieve(goal).reached for goal in goals)
    return set(body.executed)


def interrupted(store, goal):
    """Suspend a run in its third action."""

    async def life():
        async with robot(store, Body()) as one:
            one.start(goal)
            await asyncio.sleep(9.0)

    run_simulated(life())


@pytest.fixture
def store(tmp_path):
    served(tmp_path / "robot.kb")
    return tmp_path / "robot.kb"


def pruned(store, keep):
    with robot(store, Body()) as one:
        return one.prune(keep)


def numbers(store):
    with archive(store) as runs:
        return [run.number for run in runs.require_all()]


@pytest.mark.parametrize("keep", [1, 2, 5])
def test_the_latest_runs_are_kept_and_can_be_verified_and_replayed(store, keep):
    assert pruned(store, keep) == len(GOALS) - keep
    assert numbers(store) == [*range(len(GOALS) - keep + 1, len(GOALS) + 1)]
    for number in numbers(store):
        assert replay(store, number).divergence is None
    assert pruned(store, keep) == 0


def test_a_pruned_store_is_smaller(store):
    served(store, GOALS * 5)
    before = store.stat().st_size
    pruned(store, 1)
    assert store.stat().st_size < before / 2


def test_action_ids_stay_unique_after_a_prune(store):
    """Action ids contain serial numbers, which continue after the deleted runs."""
    with archive(store) as runs:
        before = runs.last(runs.run().number).serials
    pruned(store, 1)
    served(store, ["(in cup d)"])
    pruned(store, 1)
    assert replay(store).divergence is None
    served(store, ["(in cup a)"])
    with archive(store) as runs:
        assert next(runs.steps(runs.run().number)).serials > before


def test_an_unfinished_run_is_kept_and_resumed(store):
    interrupted(store, "(in cup b)")
    assert pruned(store, 1) == len(GOALS)
    assert is_unfinished(store)
    with robot(store, Body()) as one:
        assert one.resume().reached
    assert numbers(store) == [len(GOALS) + 1]


def test_a_robot_prunes_during_a_run(store):
    async def life():
        async with robot(store, Body()) as one:
            run = one.start("(in cup b)")
            await asyncio.sleep(9.0)
            assert one.prune(1) == len(GOALS)
            assert (await run).reached
            assert (await one.achieving("(in cup d)")).reached

    run_simulated(life())
    assert numbers(store) == [len(GOALS) + 1, len(GOALS) + 2]


@pytest.mark.parametrize("statement", [
    "DELETE FROM runs WHERE run = 4",
    "DELETE FROM steps WHERE place = (SELECT min(place) FROM steps)",
    "DELETE FROM ends WHERE chain = 'pruned run'",
    "UPDATE ends SET count = count + 1 WHERE chain = 'pruned step'",
    "UPDATE runs SET plot = 'other' WHERE run = 4",
])  # fmt: skip
def test_damage_of_a_pruned_store_is_detected(store, statement):
    pruned(store, 3)
    with closing(sqlite3.connect(store)) as connection, connection:
        connection.execute(statement)
    with pytest.raises(DamagedStoreError):
        numbers(store)


def test_the_command_says_what_is_gone(store):
    done = CliRunner().invoke(app, ["prune", str(store), "--keep", "2"])
    assert (done.exit_code, done.output.split(":")[0]) == (0, "4 runs deleted")
    assert numbers(store) == [5, 6]


@pytest.mark.parametrize("keep", [0, -1, True, 1.5])
def test_a_number_that_is_none_is_refused(store, keep):
    with pytest.raises(InputError, match="number of runs to keep"):
        pruned(store, keep)


def test_a_store_without_runs_is_refused(tmp_path):
    robot(tmp_path / "robot.kb", Body()).close()
    with robot(tmp_path / "robot.kb", Body()) as one, pytest.raises(StoreError, match="no run was ever kept"):
        one.prune(1)


def test_the_knowledge_before_the_first_kept_run_is_gone(store):
    pruned(store, 1)
    with archive(store) as runs, KnowledgeBase.open(None, store, None) as knowledge:
        assert knowledge.oldest == runs.run().version


# -- all runs are deleted ----------------------------------------------------------------------------------

SOME_GOALS = GOALS[:3]


@pytest.fixture
def kept(tmp_path):
    served(tmp_path / "robot.kb", SOME_GOALS)
    return tmp_path / "robot.kb"


def execute(store, *statements):
    with closing(sqlite3.connect(store)) as connection, connection:
        for statement in statements:
            connection.execute(statement)


def contents(store):
    with KnowledgeBase.open(None, store, read_only=True) as knowledge:
        return knowledge.version, knowledge.to_json()


OTHER_FORMATS = {
    "earlier": ["UPDATE fence SET format = 6"],
    "later": ["UPDATE fence SET format = 99"],
    "other columns": [
        "UPDATE fence SET format = 3", "ALTER TABLE runs ADD COLUMN more TEXT", "ALTER TABLE steps DROP COLUMN records",
    ],
    "without a number": ["DROP TABLE fence", "CREATE TABLE fence (epoch INTEGER NOT NULL)", "INSERT INTO fence VALUES (3)"],
}  # fmt: skip


@pytest.mark.parametrize("change", OTHER_FORMATS.values(), ids=OTHER_FORMATS)
@pytest.mark.parametrize("unfinished", [False, True])
def test_runs_of_another_version_are_refused_with_the_remedy_which_keeps_the_knowledge(kept, change, unfinished):
    if unfinished:
        interrupted(kept, "(in cup b)")
    execute(kept, *change)
    refused = pytest.raises(StoreError, match=f"delete all runs, but not the knowledge: `dsc runs forget {kept}`")
    with robot(kept, Body()) as one, refused:
        one.achieve("(in cup c)")
    before = contents(kept)
    assert forget_runs(kept) == len(SOME_GOALS) + unfinished
    assert contents(kept) == before
    assert not has_run(kept)
    served(kept, ["(in cup c)", "(in cup d)"])
    assert numbers(kept) == [1, 2]
    assert replay(kept).divergence is None


def test_action_ids_stay_unique_after_the_runs_are_forgotten(kept):
    with archive(kept) as runs:
        before = runs.last(runs.run().number).serials
    forget_runs(kept)
    forget_runs(kept)
    served(kept, ["(in cup c)"])
    with archive(kept) as runs:
        assert next(runs.steps(1)).serials > before
    served(kept, ["(in cup d)"])
    with KnowledgeBase.open(None, kept) as knowledge:
        assert prune(knowledge, kept, 1) == 1
    served(kept, ["(in cup a)"])
    assert numbers(kept) == [2, 3]


def test_a_robot_that_works_on_the_store_keeps_its_runs(kept):
    with robot(kept, Body()), pytest.raises(StoreError, match="another writer has it open"):
        forget_runs(kept)
    assert numbers(kept) == [1, 2, 3]


def test_a_store_without_runs_has_none_to_forget(tmp_path):
    robot(tmp_path / "robot.kb", Body()).close()
    with KnowledgeBase.open(None, tmp_path / "robot.kb"):
        pass
    with pytest.raises(StoreError, match="this store has no runs"):
        forget_runs(tmp_path / "robot.kb")


def test_the_command_tells_the_number_of_runs(kept):
    done = CliRunner().invoke(app, ["forget", str(kept)])
    assert (done.exit_code, done.output) == (0, "3 runs deleted; the knowledge is unchanged\n")
