"""Pruned stores: the oldest runs are gone, and what is kept is verified, replayed, resumed and continued."""

from __future__ import annotations

import asyncio
import sqlite3
from contextlib import closing

import pytest
from days_soak import Body, robot
from typer.testing import CliRunner

from dsc import replay, run_simulated
from dsc.cli.runs import app
from dsc.runs.archive import archive, is_unfinished
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
