"""A thousand plots at once in one process, each a run with a store of its own: how late they are, and what they take.

Each has a component whose skill ends once a second; from the moment at which it was to end until the next skill has
begun, a macrostep is made, kept and dispatched. What comes too late because others are in the way counts.
"""

from __future__ import annotations

import asyncio
import gc
import resource
import statistics
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from dsc.calls import Outcome, SkillCall
from dsc.components.component import Component
from dsc.dynamic.library import Library
from dsc.model.plot import ActionPlot
from dsc.sequencer.clock import LoopClock, run_real
from dsc.sequencer.run_store import RunStore
from dsc.sequencer.sequencer import RunEnd, Sequencer
from dsc.skills import skill
from knowledge_base import KnowledgeBase, Schema

SCHEMA = Schema.parse("(define (domain bench))")
LIBRARY = Library([
    ActionPlot.model_validate({
        "plot": "beats", "parameters": {"n": "number"}, "variables": {"k": {"type": "number", "initial": 1}},
        "states": {
            "beat": {
                "entry": [{"trigger": "heart.beat"}],
                "on": {"beaten": [{"to": "beat", "when": "(< ?k ?n)", "assign": {"k": "(+ ?k 1)"}}, "over"]},
            },
            "over": {"final": True},
        },
    }),
])  # fmt: skip
WARM_UP = 2
"""Seconds, and beats of each, that are not counted: everything is done for the first time."""


@dataclass(frozen=True, slots=True)
class Crowd:
    """How it went with so many at once.

    Attributes:
        plots: how many.
        late: seconds from when a beat was due until the next began, of each plot.
        bytes: memory for each.
        busy: share of a processor's time.
    """

    plots: int
    late: tuple[tuple[float, ...], ...]
    bytes: float
    busy: float

    @property
    def all(self) -> list[float]:
        return sorted(one for late in self.late for one in late)

    def at(self, share: float) -> float:
        """So many of all beats were not later."""
        return self.all[min(len(self.all) - 1, int(share * len(self.all)))]

    @property
    def unfairness(self) -> float:
        """How many times as late as in the middle plot a beat is in the one that is worst off, by their medians."""
        medians = sorted(map(statistics.median, self.late))
        return medians[-1] / statistics.median(medians)


class Heart(Component):
    """Beats once a second."""

    name = "heart"

    def __init__(self, first: float) -> None:
        super().__init__()
        self.due = first
        self.late: list[float] = []

    @skill(outcomes={"beaten": {}}, after_crash="repeat")
    async def beat(self, call: SkillCall) -> Outcome:  # noqa: ARG002
        loop = asyncio.get_running_loop()
        self.late.append(loop.time() - self.due)
        self.due += 1.0
        await asyncio.sleep(self.due - loop.time())
        return Outcome("beaten")


def crowd(plots: int, beats: int, folder: Path) -> Crowd:
    """So many plots, each with so many beats, spread over the second."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))  # a store has four files
    before = resident()

    def kept(number: int) -> tuple[KnowledgeBase, RunStore]:
        kb = files.enter_context(KnowledgeBase.open(SCHEMA, folder / f"crowd{number}.kb"))
        return kb, RunStore(kb, folder / f"crowd{number}.kb")

    async def main() -> tuple[list[Heart], float, float]:
        loop, stores = asyncio.get_running_loop(), [kept(number) for number in range(plots)]
        begin = loop.time() + 1.0
        hearts = [Heart(begin + number / plots) for number in range(plots)]
        runs = [loop.create_task(run(heart, *store)) for heart, store in zip(hearts, stores, strict=True)]
        await asyncio.sleep(begin + WARM_UP - loop.time())
        freeze()
        used, since, memory = process_seconds(), loop.time(), resident() - before
        for end in await asyncio.gather(*runs):
            assert end.finished, end
        return hearts, memory / plots, (process_seconds() - used) / (loop.time() - since)

    async def run(heart: Heart, kb: KnowledgeBase, store: RunStore) -> RunEnd:
        await asyncio.sleep(heart.due - asyncio.get_running_loop().time())
        sequencer = Sequencer(LIBRARY, kb, [heart], LoopClock(), store=store)
        return await sequencer.run("beats", {"n": beats + WARM_UP + 2})

    with ExitStack() as files:
        hearts, memory, busy = run_real(main())
    gc.unfreeze()
    return Crowd(plots, tuple(tuple(heart.late[WARM_UP + 2 :]) for heart in hearts), memory, busy)


def freeze() -> None:
    """What has been made until now stays: the collector need not look through all of it again and again.

    With 1,000 plots it would stop everybody for a third of a second each time.
    """
    gc.collect()
    gc.freeze()


def resident() -> int:
    """Bytes of memory in use."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize()


def process_seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def table(crowds: list[Crowd]) -> str:
    """Rows for people."""
    alone = crowds[0].at(0.5)
    lines = ["| plots | p50 ms | p99 ms | x p50 of one | worst plot x median | KB each | processor |"]
    lines += ["|---|---|---|---|---|---|---|"]
    lines += [
        f"| {one.plots} | {1e3 * one.at(0.5):.2f} | {1e3 * one.at(0.99):.2f} | {one.at(0.99) / alone:.1f} | "
        f"{one.unfairness:.1f} | {one.bytes / 1024:.0f} | {one.busy:.0%} |"
        for one in crowds
    ]
    return "\n".join(lines)
