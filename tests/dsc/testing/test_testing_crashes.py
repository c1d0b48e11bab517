"""Runs that are killed at boundaries, find the disk full or are overtaken, and come to the same end all the same."""

from __future__ import annotations

import re
from collections import Counter
from typing import Any

import pytest
from dsc_charts import plot
from dsc_runs import SCHEMA

from dsc import Component, Library, Outcome, Sequencer, skill
from dsc.runs.archive import has_run, is_unfinished
from dsc.runs.store import RunStore
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.testing import Crashes, comes_to_an_end, executed_once, one_history, replays, violations
from dsc.trace import Trace
from knowledge_base import Delta, KnowledgeBase, StoreError
from knowledge_base.facts import Fact

CHART = plot("""
plot: chart
variables: {n: {type: number, initial: 0}}
states:
  work:
    entry: {trigger: robot.work}
    on:
      did:
        - {to: work, when: (< ?n 11), assign: {n: (+ ?n 1)}}
        - over
  over: {final: true}
""")


class Did(Outcome): ...


class Robot(Component):
    """Remembers in a file what it has done, each id once."""

    name = "robot"

    def __init__(self, folder):
        super().__init__()
        self._file = folder / "done"

    @property
    def done(self):
        return self._file.read_text().split() if self._file.exists() else []

    @skill(after_crash="same_id")
    async def work(self, call) -> Did:
        await call.clock.sleep(2)
        if call.action_id not in self.done:
            with self._file.open("a") as file:
                file.write(f"{call.action_id}\n")
        return Did(observed=Delta(added=(Fact("p"),)))


class Forgetful(Robot):
    """Says that it does each id once, and does it whenever it is asked to."""

    @skill(after_crash="same_id")
    async def work(self, call) -> Did:
        await call.clock.sleep(2)
        with self._file.open("a") as file:
            file.write(f"{call.action_id}\n")
        return Did(observed=Delta(added=(Fact("p"),)))


class Lives:
    """A run of the chart that lives on in folders."""

    def __init__(self, folder, seed, chance, most=3, robot=Robot):
        self.robot = robot
        self.crashes: Crashes[Any] = Crashes(folder, seed, chance, most)
        self.begun = 0

    def live(self, folder):
        self.begun += 1
        store, robot = folder / "run.kb", self.crashes.inject(self.robot(folder))
        continues = is_unfinished(store)
        if has_run(store) and not continues:
            return None
        with KnowledgeBase.open(SCHEMA, store) as kb:
            run_store = RunStore(kb, store)
            kept = run_store.load_unfinished(Library([CHART])) if continues else None

            async def main():
                clock = LoopClock(kept.time if kept else 0.0)
                trace = Trace(clock.now, kept.last_record if kept else 0)
                sequencer = Sequencer(Library([CHART]), kb, [robot], clock, trace, store=run_store)
                self.crashes.watch(sequencer)
                return await (sequencer.resume(kept) if kept else sequencer.run("chart")), clock.now()

            return run_simulated(main(), kept.time if kept else 0.0)

    def judged(self):
        folder = self.crashes.folder
        invariants = [
            comes_to_an_end(1000),
            executed_once(Robot(folder).done),
            one_history,
            replays(Library([CHART])),
        ]
        return violations(folder / "run.kb", invariants)


def test_wherever_a_run_is_killed_it_comes_to_the_same_end(tmp_path):
    fired: Counter[str] = Counter()
    for seed in range(25):
        (folder := tmp_path / str(seed)).mkdir()
        lives = Lives(folder, seed, 0.1)
        result = lives.crashes.survive(lives.live)
        if result is not None:
            end, seconds = result
            assert (end.finished, end.problem, seconds) == (True, None, 24.0)
        assert lives.judged() == []
        assert len(Robot(lives.crashes.folder).done) == 12
        assert lives.crashes.problems == []
        overtaken = sum(times for what, times in lives.crashes.fired.items() if what.startswith("overtaken"))
        assert lives.begun == lives.crashes.life + 1 + overtaken
        fired += lives.crashes.fired
    assert set(fired) == {
        "killed before commit", "killed after commit", "killed after an action", "disk full after commit",
        "overtaken after commit", "overtaken after an action",
    }  # fmt: skip


def test_an_action_that_a_robot_does_again_is_seen(tmp_path):
    wrong = []
    for seed in range(25):
        (folder := tmp_path / str(seed)).mkdir()
        lives = Lives(folder, seed, 0.1, robot=Forgetful)
        lives.crashes.survive(lives.live)
        wrong += lives.judged()
    assert wrong
    assert all(re.search(r"was executed [2-9] times", one) for one in wrong)


def test_without_a_chance_nothing_happens(tmp_path):
    lives = Lives(tmp_path, 1, 0.0)
    end, _ = lives.crashes.survive(lives.live)
    assert end.finished
    assert (lives.crashes.life, lives.crashes.fired) == (0, Counter())
    assert [one.name for one in tmp_path.iterdir()] == ["life0"]


def test_crashes_are_a_matter_of_the_seed(tmp_path):
    fired = []
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        (tmp_path / name).mkdir()
        lives = Lives(tmp_path / name, seed, 0.2)
        lives.crashes.survive(lives.live)
        fired.append((lives.crashes.fired, lives.crashes.life))
    assert fired[0] == fired[1] != fired[2]


def test_there_are_no_more_crashes_than_wanted(tmp_path):
    lives = Lives(tmp_path, 1, 1.0, most=5)
    lives.crashes.survive(lives.live)
    assert lives.crashes.life == sum(lives.crashes.fired.values()) == 5


def test_an_error_of_the_store_that_is_none_of_ours_is_raised(tmp_path):
    crashes: Crashes[Any] = Crashes(tmp_path, 1, 1.0)

    def live(folder):
        raise StoreError("a disk is broken")

    with pytest.raises(StoreError, match="a disk is broken"):
        crashes.survive(live)


def test_writes_after_a_crash_are_absent_from_the_copy_for_the_next_life(tmp_path):
    """It is torn down inside this process, and writes in vain: the copy was made before."""
    lives = Lives(tmp_path, 5, 0.3, most=1)
    lives.crashes.survive(lives.live)
    assert lives.crashes.life == 1
    assert not is_unfinished(lives.crashes.folder / "run.kb")
    assert lives.judged() == []
