"""The run of the memory benchmark: a robot on watch, for 24 simulated hours."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.dynamic.library import Library
from dsc.engine.steps import Step
from dsc.model.plot import ActionPlot
from dsc.outcomes import Outcome
from dsc.runs.store import RunStore
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import primitive_plot, skill
from dsc.trace import Trace, write_to
from knowledge_base import KnowledgeBase, Schema
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta, fact

WAYS = ("plain", "trace", "store")
"""Without records, with a trace file, and with a store."""
SECONDS = 24 * 3600.0
REPORTS = 6
A_CYCLE = REPORTS + 4
"""Events of one cycle: reports, two answers, two periods."""
SCHEMA = Schema.parse("""
    (define (domain watch)
      (:types thing place)
      (:predicates (at ?t - thing ?p - place) (moved)))
""")
WATCH = ActionPlot.model_validate({
    "plot": "watch",
    "parameters": {"cycle": "number"},
    "variables": {"n": {"type": "number", "initial": 0}, "k": {"type": "number", "initial": 0}},
    "states": {
        "work": {
            "regions": {
                "looking": {
                    "states": {
                        "look": {
                            "entry": [{"trigger": "robot.look", "with": {"seconds": "?cycle"}, "within": SECONDS}],
                            "after": {"seconds": 1e6, "to": "look"},
                            "on": {"step": {"assign": {"n": "?event.n"}}, "looked": "grasp"},
                        },
                        "grasp": {"use": "grasp", "on": {"done": "look"}},
                    }
                },
                "counting": {
                    "states": {"count": {"every": {"seconds": "(/ ?cycle 2)", "assign": {"k": "(+ ?k 1)"}}}},
                },
            },
        },
    },
    "rules": [{"on": "slipped", "do": {"then": "retry"}}, {"on": "slipped", "do": {"then": "continue"}}],
})  # fmt: skip


ENOUGH = "the wanted number of events is reached"


class Looked(Outcome):
    """The event `looked`."""


class LookStep(Outcome, event="step"):
    """The event `step`."""

    n: float


class Slipped(Outcome):
    """The event `slipped`."""


class Grasped(Outcome):
    """The event `grasped`."""


class Robot(Component):
    """Looks, reports moving objects, and slips periodically."""

    name = "robot"

    def __init__(self) -> None:
        super().__init__()
        self._grasps = 0

    @skill
    async def look(self, call: SkillCall[LookStep], seconds: float) -> Looked:
        for n in range(REPORTS):
            await call.clock.sleep(seconds / REPORTS)
            call.report(LookStep(n=n))
        place = ("here", "there")[self._grasps % 2]
        return Looked(observed=Delta(replaced=(fact("at", "cup", place),)))

    @skill
    async def grasp(self, call: SkillCall) -> Grasped | Slipped:  # noqa: ARG002
        self._grasps += 1
        return Slipped() if self._grasps % 100 == 0 else Grasped()


LIBRARY = Library([WATCH, primitive_plot(Robot().skills()["grasp"], done="grasped")])


class Watch:
    """One run; after each macrostep it calls `sample` with the number of events and the run time in seconds."""

    def __init__(self, way: str, events: int, folder: Path, sample: Callable[[int, float], None]) -> None:
        self._way = way
        self._events = events
        self._folder = folder
        self._sample = sample

    def run(self) -> None:
        """Run it."""
        path = self._folder / "run.db"
        knowledge = KnowledgeBase.open(SCHEMA, path) if self._way == "store" else KnowledgeBase(SCHEMA)
        knowledge.apply(Delta(nodes={"cup": "thing", "here": "place", "there": "place"}), "watch")
        with (self._folder / "trace.jsonl").open("w", encoding="utf-8") as file:
            run_simulated(self._watched(knowledge, path, file))
        knowledge.close()

    async def _watched(self, knowledge: KnowledgeBase, path: Path, file: Any) -> None:
        clock = LoopClock()
        trace = Trace(clock.now)
        if self._way == "trace":
            trace.listen(write_to(file))
        store = RunStore(knowledge, path) if self._way == "store" else None
        sequencer = Sequencer(LIBRARY, knowledge, [Robot()], clock, trace, store=store)
        taken = 0

        def count(_: Step) -> None:
            nonlocal taken
            taken += 1
            self._sample(taken, clock.now())
            if taken == self._events:
                raise InputError(ENOUGH)  # ends the run

        sequencer.listen(count)
        end = await sequencer.run("watch", {"cycle": SECONDS * A_CYCLE / self._events})
        if end.problem != ENOUGH:
            raise RuntimeError(f"the run ended early: {end.reason}")
