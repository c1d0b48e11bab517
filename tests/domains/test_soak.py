"""The first runs of the soak; `make soak` lives many more of them. And: it can fail."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

import pytest
import soak
import soak_run
from soak_judge import PROMISES
from soak_run import Outcome, Planners, Trial

FAULTS = 0.1
RUNS = 40
REPLAYED_EVERY = 3
"""`make soak` replays every run."""
SOAK = Path(soak.__file__)


@pytest.fixture(scope="module")
def planners():
    made = Planners()
    yield made
    made.close()


def lived(seed, planners, faults=FAULTS, **how):
    with tempfile.TemporaryDirectory(dir=soak.MEMORY if soak.MEMORY.is_dir() else None) as folder:
        return Trial(seed, faults, planners, Path(folder), **how).run()


def test_every_promise_holds_in_every_run(planners):
    outcomes = [lived(seed, planners, replayed=seed % REPLAYED_EVERY == 0) for seed in range(RUNS)]
    assert {one.seed: one.wrong for one in outcomes if one.wrong} == {}
    assert {one.how for one in outcomes} <= {"goal reached", "something left", "stopped", "ended early"}
    crashes: Counter[str] = sum((one.crashes for one in outcomes), Counter())
    assert {"killed before commit", "killed after commit", "killed after an action"} <= crashes.keys()
    assert sum(one.lives for one in outcomes) > RUNS


@pytest.mark.parametrize("seed", [1193, 3193, 4208])
def test_an_action_just_before_an_operator_stop_is_known_after_a_crash(seed, planners):
    assert lived(seed, planners).wrong == []


@pytest.mark.parametrize("seed", [2800, 6946])
def test_a_look_is_compared_with_what_is_known_when_its_answer_is_taken(seed, planners):
    """Somebody says where an item is while the camera looks; an operator's stop leaves nobody who compares."""
    assert lived(seed, planners, faults=0.3).wrong == []


def test_the_same_seed_is_the_same_run(planners):
    once, again = (lived(7, planners) for _ in range(2))
    assert once == again


def test_the_command_says_what_happened():
    done = subprocess.run(
        [sys.executable, SOAK, "--runs", "2", "--first", "40", "--processes", "1"],
        capture_output=True, text=True, check=True, env={**os.environ, "PYTHONPATH": str(SOAK.parent)},
    )  # fmt: skip
    assert "seeds 40 to 41, faults 0.1" in done.stdout
    assert f"broken: {', '.join(f'{promise} 0' for promise in PROMISES)}" in done.stdout


def test_a_broken_promise_is_counted_once_for_each_run():
    wrong = [("hangs", "a"), ("hangs", "b"), ("no report", "c")]
    lines = soak.summary([Outcome(1, wrong=wrong), Outcome(2, how="goal reached", lives=2)])
    assert lines[0] == "outcomes: no report 1, goal reached 1"
    assert "no report 1, hangs 1" in lines[-1]


def test_a_run_that_does_not_end_is_reported_as_a_hang(planners, tmp_path, monkeypatch):
    monkeypatch.setattr(soak_run, "MOST_STEPS", 3)
    outcome = Trial(0, FAULTS, planners, tmp_path).run()
    assert outcome.wrong == [("hangs", "more than 3 macrosteps")]
    with pytest.raises(soak_run.HangError, match="it still runs after 1 s"), soak_run.no_longer_than(1):
        for_ever()


def for_ever():
    while True:
        pass
