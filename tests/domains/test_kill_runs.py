"""`kill -9` of a run at whatever moment, again and again: it ends as the run that was never killed.

Four kills here; `make kill-runs` makes more (`KILLS` in the environment).
"""

from __future__ import annotations

import multiprocessing
import os
from pathlib import Path
from random import Random

import kept_lives
import pytest

from domains.clean_up_table.bringup import deploy, world_of
from domains.clean_up_table.durable_world import DurableWorld, beside
from domains.clean_up_table.scenario import Scenario

KILLS = int(os.environ.get("KILLS", "4"))
SEED, FAULTS = 3, 0.2
A_LIFE = 120
"""Records until the kill, at most; a whole run makes some 300."""


@pytest.fixture(scope="module")
def processes():
    """Makes processes that have everything imported already."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["kept_lives"])
    return context


def lived(processes, path: Path, seed: int, records: int) -> bool:
    """One life, killed when it has made so many records (or a few more: it goes on); whether it ended before that."""
    receive, say = processes.Pipe(duplex=False)
    process = processes.Process(target=kept_lives.live, args=(str(path), seed, FAULTS, say))
    process.start()
    say.close()
    heard = None
    try:
        for _ in range(records):
            heard = receive.recv()
        process.kill()
        while True:
            heard = receive.recv()
    except EOFError:
        receive.close()
    process.join()
    process.close()
    return heard == "end"


def test_a_run_that_is_killed_again_and_again_ends_like_one_that_never_was(processes, planner, tmp_path):
    random, kills, seed = Random(SEED), 0, SEED  # noqa: S311
    while kills < KILLS:
        whole, killed = tmp_path / f"whole{seed}.kb", tmp_path / f"killed{seed}.kb"
        with deploy(Scenario.parse(kept_lives.SCENARIO), seed, FAULTS, planner, store=whole) as table:
            table.report()
            world = world_of(table).state()
        while not lived(processes, killed, seed, random.randrange(1, A_LIFE) if kills < KILLS else A_LIFE * 100):
            kills += 1
        assert kept_lives.told(killed) == kept_lives.told(whole)
        reopened = DurableWorld.open(beside(killed))
        assert reopened.state() == world
        reopened.close()
        seed += 1
