"""What a macrostep costs a running chart, without a store and with one, as ratios.

`python benchmarks/run_store.py [--quick] [--folder F] [--write]` times, in turn, the engine alone, a hop through an
`asyncio.Queue`, the sequencer without a store, with one at each durability, and one bare SQLite commit of a row at
each. Two charts: an event from outside that leads from one state to the other, and a skill's answer that leads to the
next skill. The last columns are what the sequencer adds to the engine, as a ratio to the hop, and what the store adds
to the macrostep, as a ratio to the bare commit. Then 1, 100 and 1,000 plots at once, see `many_plots`. `--write` puts
all that into docs/speed.md.
"""

from __future__ import annotations

import argparse
import asyncio
import sqlite3
import statistics
import tempfile
from collections.abc import Iterable
from itertools import count
from pathlib import Path
from typing import Any

import page
from many_plots import Crowd, crowd
from many_plots import table as crowded
from timing import Figures, Job, Pace, measure, ratio

from dsc.calls import Outcome, SkillCall
from dsc.components.component import Component
from dsc.dynamic.library import Library
from dsc.dynamic.situation import KnowledgeSituation
from dsc.engine.machine import Machine
from dsc.events import Event
from dsc.model.plot import ActionPlot
from dsc.sequencer.clock import LoopClock, run_real
from dsc.sequencer.run_store import RunStore
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from knowledge_base import KnowledgeBase, Schema
from knowledge_base.journal.file import Durability

SCHEMA = Schema.parse("(define (domain bench))")
PING = Event("ping")
EVENTS = ActionPlot.model_validate({
    "plot": "events", "receives": {"ping": None, "stop": None}, "parameters": {"n": "number"},
    "states": {
        "a": {"on": {"ping": "b", "stop": "e"}}, "b": {"on": {"ping": "a", "stop": "e"}}, "e": {"final": True},
    },
})  # fmt: skip
ANSWERS = ActionPlot.model_validate({
    "plot": "answers", "parameters": {"n": "number"}, "variables": {"k": {"type": "number", "initial": 1}},
    "states": {
        "a": {
            "entry": [{"trigger": "robot.work"}],
            "on": {"did": [{"to": "a", "when": "(< ?k ?n)", "assign": {"k": "(+ ?k 1)"}}, "e"]},
        },
        "e": {"final": True},
    },
})  # fmt: skip
LIBRARY = Library([EVENTS, ANSWERS])
DURABILITIES: tuple[Durability, ...] = ("process", "power")
ENGINE, HOP, SHELL = "the engine alone", "one asyncio.Queue hop", "without a store"
ROW = "x" * 400
"""About as much as a macrostep writes."""


class Robot(Component):
    """Its work is done at once."""

    name = "robot"

    @skill(outcomes={"did": {}}, after_crash="repeat")
    async def work(self, call: SkillCall) -> Outcome:  # noqa: ARG002
        return Outcome("did")


class Bench:
    """The jobs; files are made in `folder`, a new one whenever a job is prepared."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._numbers = count()

    def jobs(self, plot: str) -> dict[str, Job]:
        jobs = {ENGINE: Job(_engine), HOP: Job(_hops), SHELL: self._run(plot, None)}
        for durability in DURABILITIES:
            jobs[f"with a store, {durability}"] = self._run(plot, durability)
            jobs[f"a bare commit, {durability}"] = Job(_commits, prepare=lambda n, d=durability: (n, self._bare(d)))
        return jobs

    def _run(self, plot: str, durability: Durability | None) -> Job:
        def prepare(times: int) -> Any:
            if durability is None:
                return times, KnowledgeBase(SCHEMA), None
            path = self._file()
            kb = KnowledgeBase.open(SCHEMA, path, durability)
            return times, kb, RunStore(kb, path)

        def run(prepared: Any) -> None:
            times, kb, store = prepared

            async def main() -> None:
                sequencer = Sequencer(LIBRARY, kb, [Robot()], LoopClock(), store=store)
                if plot == EVENTS.name:
                    for _ in range(times):
                        sequencer.post(PING)
                    sequencer.post(Event("stop"))
                end = await sequencer.run(plot, {"n": times})
                assert end.finished, end

            run_real(main())
            kb.close()

        return Job(run, prepare=prepare)

    def _bare(self, durability: Durability) -> sqlite3.Connection:
        connection = sqlite3.connect(self._file(), isolation_level=None)
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute(f"PRAGMA synchronous = {'FULL' if durability == 'power' else 'NORMAL'}")
        connection.execute("CREATE TABLE rows (number INTEGER PRIMARY KEY, text TEXT)")
        return connection

    def _file(self) -> Path:
        return self._folder / f"{next(self._numbers)}.kb"


def _engine(times: int) -> None:
    kb, machine = KnowledgeBase(SCHEMA), Machine(LIBRARY)
    machine.start(EVENTS.name, {"n": times}, KnowledgeSituation(kb, LIBRARY))
    for _ in range(times):
        machine.send(PING, KnowledgeSituation(kb, LIBRARY))


def _hops(times: int) -> None:
    async def main() -> None:
        there: asyncio.Queue[int] = asyncio.Queue()
        back: asyncio.Queue[int] = asyncio.Queue()

        async def answer() -> None:
            for _ in range(times // 2 + 1):
                back.put_nowait(await there.get())

        task = asyncio.get_running_loop().create_task(answer())
        for number in range(times // 2 + 1):  # two hops each
            there.put_nowait(number)
            await back.get()
        await task

    run_real(main())


def _commits(prepared: tuple[int, sqlite3.Connection]) -> None:
    times, connection = prepared
    for _ in range(times):
        connection.execute("BEGIN IMMEDIATE")
        connection.execute("INSERT INTO rows (text) VALUES (?)", (ROW,))
        connection.execute("COMMIT")
    connection.close()


def table(figures: Figures) -> str:
    """A row for each job."""
    lines = ["| a macrostep | us | a second | x engine | its shell, x hop | its store, x bare commit |"]
    lines += ["|---|---|---|---|---|---|"]
    for name, rounds in figures.items():
        bare = name.replace("with a store", "a bare commit")
        shell = zip(rounds, figures[ENGINE], figures[HOP], strict=True)
        store = zip(rounds, figures[SHELL], figures[bare], strict=True) if bare != name else ()
        micro = 1e6 * statistics.median(rounds)
        lines.append(
            f"| {name} | {micro:.1f} | {1e6 / micro:,.0f} | {ratio(figures, name, ENGINE):.1f} | "
            f"{_more(shell) if name == SHELL else ''} | {_more(store)} |"
        )
    return "\n".join(lines)


def _more(rounds: Iterable[tuple[float, float, float]]) -> str:
    """What one adds to another, as a ratio to a third."""
    ratios = [(one - other) / unit for one, other, unit in rounds]
    return f"{statistics.median(ratios):.1f}" if ratios else ""


def targets(events: Figures, crowds: list[Crowd]) -> str:
    """What was aimed at."""
    rows = [("the shell, x a hop", 3.0, _added(events, SHELL, ENGINE, HOP))]
    for one, most in (("process", 5.0), ("power", 1.3)):
        found = _added(events, f"with a store, {one}", SHELL, f"a bare commit, {one}")
        rows.append((f"the store, x a bare commit, {one}", most, found))
    rows.append((f"p99 of {crowds[-1].plots} plots, x p50 of one", 20.0, crowds[-1].at(0.99) / crowds[0].at(0.5)))
    lines = ["| target | at most | measured | |", "|---|---|---|---|"]
    for name, most, found in rows:
        lines.append(f"| {name} | {most} | {found:.1f} | {'met' if found <= most else 'missed'} |")
    return "\n".join(lines)


def _added(figures: Figures, one: str, other: str, unit: str) -> float:
    return float(_more(zip(figures[one], figures[other], figures[unit], strict=True)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a moment for each, to see that it works")
    parser.add_argument("--folder", type=Path, default=Path(), help="where files are made: the disk matters")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/speed.md")
    options = parser.parse_args()
    pace = Pace(2, 0.02) if options.quick else Pace(9, 0.3)
    sizes, beats = ((1, 5), 2) if options.quick else ((1, 100, 1000), 20)
    crowds = []
    for size in sizes:  # first, while nothing else is in memory
        with tempfile.TemporaryDirectory(dir=options.folder) as folder:
            crowds.append(crowd(size, beats, Path(folder)))
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        bench = Bench(Path(folder))
        events, answers = (measure(bench.jobs(plot.name), pace) for plot in (EVENTS, ANSWERS))
    parts = {
        "An event from outside:": table(events), "A skill's answer, and the next skill:": table(answers),
        "Plots at once, one event a second each, each with a store (`process`):": crowded(crowds),
        "Targets, for an event from outside:": targets(events, crowds),
    }  # fmt: skip
    text = "\n\n".join(f"{title}\n\n{part}" for title, part in parts.items())
    print(text)
    if options.write:
        page.put(text, "run")


if __name__ == "__main__":
    main()
