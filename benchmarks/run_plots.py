"""Many concurrent plots in one process and event loop: memory, fairness, and the delay from an event to its action.

Each event is due at a separate second, independent of delays. Its delay runs from then until its skill begins. The
reference is one plot alone, whose delay runs from the post of the event. Only the loop's timers, with a resolution of a
millisecond, could delay it before.

The skill's answer leads back, so that an event is two macrosteps. With a store, each plot has a separate file. A random
number of past events prevents checkpoints of all files at the same time.
"""

from __future__ import annotations

import asyncio
import gc
import random
import resource
import statistics
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rows import Target, number
from run_jobs import PING, SCHEMA, STOP

from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.dynamic.library import Library
from dsc.model.plot import ActionPlot
from dsc.outcomes import Outcome
from dsc.runs.store import RunStore
from dsc.sequencer.clock import LoopClock, run_real
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from knowledge_base import KnowledgeBase
from knowledge_base.journal.write_transaction import TIDY_UP_AFTER

PLOT = ActionPlot.model_validate({
    "plot": "worker", "receives": {"ping": None, "stop": None},
    "states": {
        "rest": {"on": {"ping": "work", "stop": "end"}},
        "work": {"entry": [{"trigger": "robot.work"}], "on": {"did": "rest"}},
        "end": {"final": True},
    },
})  # fmt: skip
LIBRARY = Library([PLOT])
PAST = TIDY_UP_AFTER // 2
"""Maximum number of earlier events of a plot: the number until a checkpoint, with two commits each."""
FILES_EACH = 5
"""Number of open files of SQLite and the lock for a store."""
MOST = 20.0
"""Maximum ratio of the p99 of all plots to the p50 of one."""


class Did(Outcome):
    """The event `did`."""


class Arm(Component):
    """Records the delays of its calls."""

    name = "robot"

    def __init__(self) -> None:
        super().__init__()
        self.due = 0.0
        self.waits: list[float] = []

    @skill(after_crash="repeat")
    async def work(self, call: SkillCall) -> Did:
        self.waits.append(call.clock.now() - self.due)
        return Did()


@dataclass(frozen=True, slots=True)
class Fleet:
    """The result of a fleet of plots.

    Attributes:
        what: the kind of store.
        plots: number of plots.
        rate: events a second, of each.
        memory: KiB of a plot, by the process's resident memory.
        fewest, most: events that a plot has handled.
        p50, p99: milliseconds from an event to its action.
        longest: the longest of these.
        times: p99 as a ratio to the p50 of one.
    """

    what: str
    plots: int
    rate: float
    memory: float
    fewest: int
    most: int
    p50: float
    p99: float
    longest: float
    times: float | None = None
    targets: tuple[Target, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        return asdict(self) | {"targets": [str(one) for one in self.targets]}


def fleets(folder: Path, count: int, seconds: float) -> list[Fleet]:
    """Return the results of one plot alone and of many, without and with stores, at one event a second each."""
    _allow_files(count * FILES_EACH + 100)
    found = []
    for kept in (False, True):
        what = "a store each, process" if kept else "no store"
        alone = _fleet(what, folder / f"one{kept}" if kept else None, 1, min(seconds, 10.0), 20.0)
        many = _fleet(what, folder / f"many{kept}" if kept else None, count, seconds, 1.0)
        times = many.p99 / alone.p50
        target = (Target("x p50 of one", MOST, times),) if kept else ()
        found += [Fleet(**asdict(alone)), Fleet(**asdict(many) | {"times": times, "targets": target})]
    return found


def plots_table(found: list[Fleet]) -> str:
    """Return a Markdown table."""
    lines = [
        "| plots | 1/s each | KiB each | handled by each | p50, ms | p99, ms | longest, ms | x p50 of one | target |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for one in found:
        times = "" if one.times is None else number(one.times)
        figures = f"{number(one.p50)} | {number(one.p99)} | {number(one.longest)} | {times}"
        said = "; ".join(map(str, one.targets))
        handled = f"{one.fewest} to {one.most}"
        lines.append(
            f"| {one.plots}, {one.what} | {one.rate:g} | {number(one.memory)} | {handled} | {figures} | {said} |"
        )
    return "\n".join(lines)


def _fleet(what: str, folder: Path | None, plots: int, seconds: float, rate: float) -> Fleet:
    if folder is not None:
        folder.mkdir()
    chance = random.Random(1)  # noqa: S311  no secret depends on it
    robots = [Arm() for _ in range(plots)]
    gc.collect()
    before = _memory()
    with ExitStack() as opened:
        worlds = [opened.enter_context(_world(folder, number)) for number in range(plots)]
        stores = [None if folder is None else RunStore(kb, _path(folder, n)) for n, kb in enumerate(worlds)]

        async def main() -> float:
            clock = LoopClock()
            every = zip(worlds, robots, stores, strict=True)
            runs = [Sequencer(LIBRARY, kb, [robot], clock, store=kept, open_ended=True) for kb, robot, kept in every]
            async with asyncio.TaskGroup() as group:
                for one in runs:
                    group.create_task(one.run(PLOT.name))
                await asyncio.sleep(0.1)
                for one, robot in zip(runs, robots, strict=True):
                    await _past(one, robot, chance.randrange(PAST) if folder and plots > 1 else 10)
                gc.collect()
                gc.freeze()  # as `dsc run` does: long-lived objects need no collection
                held = (_memory() - before) / plots
                group.create_task(_events(runs, robots, clock, round(seconds * rate), rate, chance))
            return held

        try:
            held = run_real(main())
        finally:
            gc.unfreeze()
    waits = sorted(1000 * wait for robot in robots for wait in robot.waits)
    p50, *_, p99 = statistics.quantiles(waits, n=100, method="inclusive")[49:]
    handled = [len(robot.waits) for robot in robots]
    return Fleet(what, plots, rate, held, min(handled), max(handled), p50, p99, waits[-1])


async def _past(one: Sequencer, robot: Arm, events: int) -> None:
    for _ in range(events):
        begun = len(robot.waits)
        one.post(PING)
        while len(robot.waits) == begun or one.dispatcher.started():  # noqa: ASYNC110  it is a turn or two of the loop
            await asyncio.sleep(0)
    robot.waits.clear()


async def _events(
    runs: list[Sequencer], robots: list[Arm], clock: LoopClock, events: int, rate: float, chance: random.Random
) -> None:
    """Post events to each plot, at a random phase of each period.

    Each plot has one timer; timers for all events would be a hundred thousand objects for the garbage collector.
    """
    begin = clock.now() + 0.1

    def due(one: Sequencer, robot: Arm, phase: float, turn: int) -> None:
        at = phase + turn / rate
        robot.due = at if len(runs) > 1 else clock.now()
        one.post(PING)
        if turn + 1 < events:
            clock.call_at(at + 1 / rate, partial(due, one, robot, phase, turn + 1))

    for one, robot in zip(runs, robots, strict=True):
        phase = begin + chance.random() / rate
        clock.call_at(phase, partial(due, one, robot, phase, 0))
    await asyncio.sleep(0.1 + (events + 1) / rate)
    for one in runs:
        one.post(STOP)


def _world(folder: Path | None, number_: int) -> KnowledgeBase:
    return KnowledgeBase(SCHEMA) if folder is None else KnowledgeBase.open(SCHEMA, _path(folder, number_), "process")


def _path(folder: Path, number_: int) -> Path:
    return folder / f"{number_}.kb"


def _memory() -> float:
    """Return the resident memory of the process in KiB."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 1024


def _allow_files(needed: int) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft < needed:
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(needed, hard), hard))
