"""The timed jobs of a run: engine, queue, sequencer and store, alone or inside each other."""

from __future__ import annotations

import asyncio
import sqlite3
from collections.abc import Awaitable, Callable
from itertools import count
from pathlib import Path
from time import perf_counter
from typing import Any

from timing import Job

from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.engine.steps import Start
from dsc.events import Event
from dsc.model.plot import ActionPlot
from dsc.outcomes import Outcome
from dsc.runs.store import RunStore
from dsc.sequencer.clock import LoopClock, run_real
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from knowledge_base import KnowledgeBase, Schema
from knowledge_base.journal.file import Durability

SCHEMA = Schema.parse("(define (domain bench))")
PING, LAST, STOP = Event("ping"), Event("last"), Event("stop")
EVENTS = ActionPlot.model_validate({
    "plot": "events", "receives": {"ping": None, "last": None, "stop": None}, "parameters": {"n": "number"},
    "states": {
        "a": {"on": {"ping": "b", "last": "c", "stop": "e"}}, "b": {"on": {"ping": "a", "last": "c", "stop": "e"}},
        "c": {"on": {"stop": "e"}}, "e": {"final": True},
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
ENGINE, HOP, NO_STORE = "engine alone", "queue hop", "no store"
ONE, MANY, ANSWER = "an event, one at a time", "events that wait together", "a skill's answer and the next skill"
CASES = (ONE, MANY, ANSWER)
ROW = "x" * 400
"""About as much as a macrostep writes."""


class Did(Outcome):
    """The event `did`."""


class Robot(Component):
    """Finishes its work immediately.

    Attributes:
        called: the times of its calls.
    """

    name = "robot"

    def __init__(self) -> None:
        super().__init__()
        self.called: list[float] = []

    @skill(after_crash="repeat")
    async def work(self, call: SkillCall) -> Did:  # noqa: ARG002
        self.called.append(perf_counter())
        return Did()


def bare(durability: Durability) -> str:
    """Return the column of one bare commit."""
    return f"bare commit, {durability}"


class Bench:
    """The jobs; each prepared job makes a new file in `folder`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._numbers = count()

    def jobs(self, case: str) -> dict[str, Job]:
        """Return the jobs of a case, by column."""
        jobs = {ENGINE: Job(_answered if case == ANSWER else _moved), HOP: Job(_hops), NO_STORE: self._run(case, None)}
        for durability in DURABILITIES:
            jobs[durability] = self._run(case, durability)
            jobs[bare(durability)] = Job(_commits, prepare=lambda n, d=durability: (n, self._bare(d)), timed=True)
        return jobs

    def _run(self, case: str, durability: Durability | None) -> Job:
        def prepare(times: int) -> Any:
            if durability is None:
                return times, KnowledgeBase(SCHEMA), None
            path = self._file()
            kb = KnowledgeBase.open(SCHEMA, path, durability)
            return times, kb, RunStore(kb, path)

        def run(prepared: Any) -> float:
            times, kb, store = prepared

            async def main() -> float:
                robot = Robot()
                sequencer = Sequencer(LIBRARY, kb, [robot], LoopClock(), store=store, open_ended=case != ANSWER)
                plot = ANSWERS if case == ANSWER else EVENTS
                running = asyncio.get_running_loop().create_task(sequencer.run(plot.name, {"n": times + 1}))
                seconds = await DRIVERS[case](sequencer, times) if case in DRIVERS else 0.0
                end = await running
                assert end.finished, end
                return seconds or robot.called[-1] - robot.called[0]

            seconds = run_real(main())
            kb.close()
            return seconds

        return Job(run, prepare=prepare, timed=True)

    def _bare(self, durability: Durability) -> sqlite3.Connection:
        connection = sqlite3.connect(self._file(), isolation_level=None)
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute(f"PRAGMA synchronous = {'FULL' if durability == 'power' else 'NORMAL'}")
        connection.execute("CREATE TABLE rows (number INTEGER PRIMARY KEY, text TEXT)")
        return connection

    def _file(self) -> Path:
        return self._folder / f"{next(self._numbers)}.kb"


async def _one_at_a_time(sequencer: Sequencer, times: int) -> float:
    """Post each event after the macrostep of the one before: there and back, which is two hops."""
    done: asyncio.Queue[None] = asyncio.Queue()
    sequencer.listen(lambda _: done.put_nowait(None))
    await done.get()  # the start
    start = perf_counter()
    for _ in range(times):
        sequencer.post(PING)
        await done.get()
    seconds = perf_counter() - start
    sequencer.post(STOP)
    return seconds


async def _all_at_once(sequencer: Sequencer, times: int) -> float:
    """Post all events before the sequencer takes the first; a last event marks the end."""
    await _until(lambda: sequencer.machine.state.root is not None)
    start = perf_counter()
    for _ in range(times):
        sequencer.post(PING)
    sequencer.post(LAST)
    await _until(lambda: sequencer.machine.state.configuration() == ("c",))
    seconds = perf_counter() - start
    sequencer.post(STOP)
    return seconds


async def _until(holds: Callable[[], bool]) -> None:
    while not holds():  # noqa: ASYNC110  a listener would be called for every macrostep, and its time would count
        await asyncio.sleep(0)


DRIVERS: dict[str, Callable[[Sequencer, int], Awaitable[float]]] = {ONE: _one_at_a_time, MANY: _all_at_once}
"""Post the events of a case and return their seconds, without start and end; the robot's answers need none."""


def _moved(times: int) -> None:
    kb, machine = KnowledgeBase(SCHEMA), Machine(LIBRARY)
    machine.start(EVENTS.name, {"n": times}, KnowledgeSituation(kb, LIBRARY))
    for _ in range(times):
        machine.send(PING, KnowledgeSituation(kb, LIBRARY))


def _answered(times: int) -> None:
    kb, machine = KnowledgeBase(SCHEMA), Machine(LIBRARY)
    step = machine.start(ANSWERS.name, {"n": times + 1}, KnowledgeSituation(kb, LIBRARY))
    for _ in range(times):
        start = next(one for one in step.output if isinstance(one, Start))
        step = machine.send(Event("did", to=start.activation), KnowledgeSituation(kb, LIBRARY))


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


def _commits(prepared: tuple[int, sqlite3.Connection]) -> float:
    times, connection = prepared
    start = perf_counter()
    for _ in range(times):
        connection.execute("BEGIN IMMEDIATE")
        connection.execute("INSERT INTO rows (text) VALUES (?)", (ROW,))
        connection.execute("COMMIT")
    seconds = perf_counter() - start
    connection.close()
    return seconds
