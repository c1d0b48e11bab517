"""Runs that are kept, broken off at every boundary there is, and resumed.

A crash is what `kill -9` leaves: the files as they are at that moment. They are copied, here, before each macrostep
is committed and whenever the robot has done something; each copy can be resumed. (Real kills: `test_kill_runs`.)
"""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from dsc_charts import plot
from dsc_runs import SCHEMA

from dsc import SkillCall
from dsc.components.component import Component
from dsc.dynamic.library import Library
from dsc.outcomes import Outcome
from dsc.runs.archive import archive
from dsc.runs.store import RunStore
from dsc.runs.tables import CHAIN
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from dsc.trace import Record, Trace
from knowledge_base.facts import Delta, Fact, fact
from knowledge_base.journal.integrity import Tip, link, put_ends
from knowledge_base.store import KnowledgeBase

Plot = Annotated[str, "plot"]


class Did(Outcome):
    n: float


class Progress(Outcome):
    n: float


class Planned(Outcome):
    plot: Plot


class Robot(Component):
    """Does each action id once, and remembers that whatever becomes of the sequencer.

    Attributes:
        done: what was done, by action id, with how often it was asked for.
        told: parameters and modes, in the order in which they came.
    """

    name = "robot"

    def __init__(self, done=(), crash=lambda: None):
        super().__init__()
        self.done = dict(done)
        self.told = []
        self.crash = crash

    async def configure(self, parameter, value):
        self.told.append((parameter, value))
        await super().configure(parameter, value)

    async def switch(self, mode):
        self.told.append(("mode", mode))
        await super().switch(mode)

    @skill(after_crash="same_id")
    async def work(self, call: SkillCall[Progress], seconds=2.0, reports=0, observes="p", sees=False) -> Did:
        for n in range(reports):
            await call.clock.sleep(seconds)
            if sees:
                call.observe(Delta(added=(Fact("q"),)))
                continue
            call.report(Progress(n=n))
        await call.clock.sleep(seconds)
        if call.action_id not in self.done:
            self.done[call.action_id] = len(self.done) + 1
            self.crash()
        return Did(n=self.done[call.action_id], observed=Delta(added=(Fact(observes),)))

    @skill(after_crash="repeat")
    async def plan(self, call) -> Planned:
        await call.clock.sleep(1)
        form = {
            "plot": "made",
            "states": {
                "m": {"entry": [{"trigger": "robot.work", "with": {"seconds": 3}}], "on": {"did": "n"}},
                "n": {"final": True},
            },
        }
        return Planned(plot=form, observed=Delta(nodes={"cup": "item"}, added=(fact("seen", "cup"),)))  # type: ignore[arg-type]


class Run:
    """One life of a run, kept in `folder`; at each boundary `crash` is called with a word for it."""

    def __init__(
        self,
        folder: Path,
        plots,
        *,
        robot=None,
        done=(),
        prepare=None,
        arguments=None,
        crash=lambda _: None,
        resume=False,
    ):
        self.path = folder / "run.kb"
        self.robot = robot or Robot(done, crash=lambda: crash("done"))
        self.records: list[Record] = []
        self.library = Library(map(plot, plots))
        with KnowledgeBase.open(SCHEMA, self.path) as kb:
            store = RunStore(kb, self.path)
            kept = store.load_unfinished(self.library) if resume else None

            async def main():
                clock = LoopClock(kept.time if kept else 0.0)
                trace = Trace(clock.now, kept.last_record if kept else 0)
                trace.listen(self.records.append)
                sequencer = Sequencer(self.library, kb, [self.robot], clock, trace, store=store)
                sequencer.listen(lambda _: crash("step"))
                if prepare is not None:
                    prepare(sequencer)
                first = next(iter(self.library)).name
                self.end = await (sequencer.resume(kept) if kept else sequencer.run(first, arguments))
                self.at = clock.now()

            run_simulated(main(), kept.time if kept else 0.0)
            self.facts = {str(one) for one in kb.snapshot().facts}

    @property
    def steps(self):
        """What is in the store of every macrostep, but for the records, of which some are made anew."""
        with archive(self.path) as runs:
            return [replace(step, records=()) for step in runs.steps(runs.run().number)]

    def outcome(self):
        return self.end, self.at, self.steps, self.facts, self.robot.done


def forged(path: Path, *statements: str, **parameters: str) -> None:
    """Change the macrosteps of a store's last run as a program with an error would write them: with digests that fit."""
    with closing(sqlite3.connect(path)) as connection, connection:
        for statement in statements:
            connection.execute(statement, parameters)
        run, digest = connection.execute("SELECT run, digest FROM runs ORDER BY run DESC LIMIT 1").fetchone()
        rows = connection.execute("SELECT * FROM steps WHERE run = ? ORDER BY place", (run,)).fetchall()
        for place, *row, knowledge, _ in rows:
            digest = link(digest + knowledge, *row)
            connection.execute("UPDATE steps SET digest = ? WHERE place = ?", (digest, place))
        (ended,) = connection.execute("SELECT ended FROM runs WHERE run = ?", (run,)).fetchone()
        seal = None if ended is None else link(digest, place, ended)
        connection.execute("UPDATE runs SET seal = ?, steps = ? WHERE run = ?", (seal, seal and place, run))
        put_ends(connection, [(CHAIN, Tip(place, seal) if seal else None)])


def copied(folder: Path, to: Path) -> Path:
    to.mkdir()
    for file in folder.iterdir():
        if not file.name.endswith(("-lock", "-shm")):
            shutil.copy(file, to)
    return to


class Crashes:
    """A whole run, with a copy of its files from each boundary; `Crashes.resumed` lives on from each of them."""

    def __init__(self, folder: Path, *plots, prepare=None, arguments=None, make=Robot):
        self.plots = plots
        self._make = make
        self._prepare = prepare
        self.copies: list[tuple[str, dict[str, int], Path]] = []
        alive = folder / "alive"
        alive.mkdir()

        robot: list[Any] = []

        def crash(what):
            self.copies.append((what, dict(robot[0].done), copied(alive, folder / f"copy{len(self.copies)}")))

        def keep_hold(sequencer):
            robot.append(sequencer.dispatcher.component("robot"))
            if prepare is not None:
                prepare(sequencer)

        first = make(crash=lambda: crash("done"))
        self.whole = Run(alive, plots, robot=first, prepare=keep_hold, arguments=arguments, crash=crash)

    def resumed(self):
        """Each life after a crash; the first copy is older than the run's first commit, and is left out."""
        for what, done, folder in self.copies[1:]:
            yield what, Run(folder, self.plots, robot=self._make(done), resume=True)
