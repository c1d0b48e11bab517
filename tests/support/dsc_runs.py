"""An arm whose skills end in every way there is, and whole runs with it in simulated time."""

from __future__ import annotations

import asyncio
import sys
import threading
from typing import Annotated

from dsc_charts import plot

from dsc import SkillCall
from dsc.blocking import StoppedError
from dsc.components.component import Component
from dsc.dynamic.library import Library
from dsc.outcomes import Outcome
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from dsc.trace import Record, Trace
from knowledge_base.facts import Delta, Fact, fact
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema

SCHEMA = Schema.parse("""
    (define (domain kitchen)
      (:types item - object)
      (:predicates (seen ?i - item) (p) (q) (told)))
""")

SLOW = 1000.0


Item = Annotated[str, "item"]


class Grasped(Outcome): ...


class Slipped(Outcome):
    item: Item


class Found(Outcome):
    item: Item


class Glimpse(Outcome):
    n: float


class Ok(Outcome): ...


class Made(Outcome):
    thing: object


class Arm(Component):
    """Skills that end in every way there is; `log` is what happened, in order, with the time."""

    name = "arm"

    def __init__(self, name=None, slow_to_configure=0.0, *, concurrent=False):
        super().__init__(name)
        self.concurrent = self.concurrent or concurrent
        self.log = []
        self.clock = None
        self.slow = slow_to_configure

    def note(self, text):
        self.log.append(text)

    async def configure(self, parameter, value):
        if self.slow:
            await asyncio.sleep(self.slow)
        if value == "impossible":
            raise RuntimeError("cannot be set")
        await super().configure(parameter, value)
        self.note(f"{parameter}={value}")

    async def switch(self, mode):
        if self.slow:
            await asyncio.sleep(self.slow)
        await super().switch(mode)
        self.note(f"mode {mode}")

    @skill
    async def grasp(self, call, item: Item = "cup1", seconds=2.0, ends="grasped") -> Grasped | Slipped:
        self.note(f"grasp {item}")
        try:
            await call.clock.sleep(seconds)
        except asyncio.CancelledError:
            self.note("cancelled")
            raise
        return Outcome(ends, {"item": item} if ends == "slipped" else {})  # type: ignore[return-value]

    @skill
    async def look(self, call: SkillCall[Glimpse], glimpses=0, seconds=1.0) -> Found:
        for n in range(glimpses):
            await call.clock.sleep(seconds)
            call.report(Glimpse(n=n, observed=Delta(added=(Fact("p"),))))
        await call.clock.sleep(seconds)
        return Found(item="cup1", observed=Delta(nodes={"cup1": "item"}, added=(fact("seen", "cup1"),)))

    @skill
    async def breaks(self, call, how="raise") -> Ok | Made:
        await call.clock.sleep(1)
        if how == "raise":
            raise RuntimeError("the gripper is stuck")
        if how == "timeout":
            raise TimeoutError("the bus does not answer")
        if how == "exit":
            sys.exit("the driver says no")
        if how == "base":
            raise StoppedError("of no usual kind")
        if how == "cancel":
            raise asyncio.CancelledError
        if how == "undeclared":
            return Outcome("splendid")  # type: ignore[return-value]
        if how == "nothing":
            return None  # type: ignore[return-value]
        if how == "no_data":
            return Made(thing=object())
        return Ok(observed=Delta(added=(fact("nonsense", "x"),)))

    @skill
    async def waits_for_a_thread(self, call) -> Ok:
        with call.clock.hold():
            await asyncio.to_thread(threading.Event().wait, 0.02)
        return Ok()


class Ran:
    """A whole run: how it ended, when, what was traced and what is known then."""

    def __init__(self, text, *inner, arm=None, prepare=None, facts=(), things=(), open_ended=False, arguments=None):
        self.kb = KnowledgeBase(SCHEMA)
        self.kb.apply(Delta(nodes=dict.fromkeys(things, "item"), added=tuple(facts)), "test")
        self.arm = arm or Arm()
        self.records: list[Record] = []
        library = Library([plot(text), *map(plot, inner)])

        async def main():
            clock = LoopClock()
            trace = Trace(clock.now)
            trace.listen(self.records.append)
            sequencer = Sequencer(library, self.kb, [self.arm], clock, trace, open_ended=open_ended)
            self.sequencer = sequencer
            if prepare is not None:
                prepare(sequencer)
            self.end = await sequencer.run(library_first, arguments or {})
            self.at = clock.now()

        library_first = next(iter(library)).name
        run_simulated(main())

    def of_type(self, type_):
        return [record.data for record in self.records if record.type == type_]

    @property
    def lines(self):
        return [record.to_line() for record in self.records]


def ran(text, *components, meanwhile=None, prepare=None):
    """How the plot `p` ended with these components while something else went on, and when."""

    async def main():
        clock = LoopClock()
        sequencer = Sequencer(Library([plot(text)]), KnowledgeBase(Schema()), components, clock)
        if prepare is not None:
            prepare(sequencer)
        busy = asyncio.ensure_future(meanwhile(sequencer)) if meanwhile else None
        end = await sequencer.run("p")
        if busy is not None:
            await busy
        return end, clock.now()

    return run_simulated(main())
