"""`make bench-calls`: Python calls, hops between files, and files on the five main paths of the system.

The counts are deterministic: simulated time, no store, and a planner that repeats the plans of an earlier run. Each
flow begins and ends at the public interface (an event posted, a skill called), so that it survives a redesign.

A call is one that Python's profiler reports for a function of this project; comprehensions and resumed coroutines
count. A hop is a call from one file of the project into another.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import statistics
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import set_table
from page import put
from peers.dsc import ready

from dsc import ActionPlot, Component, Outcome, SkillCall, skill
from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.events import Event
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from knowledge_base import Delta, KnowledgeBase, Schema
from knowledge_base.facts import Fact, fact
from knowledge_base.language.syntax.text import to_text
from planning import PlanStep, Robot
from planning.engines.planner import PlannerProcess
from planning.model.plan import PlanningOutcome
from planning.model.problem import Problem

ROOT = Path(__file__).resolve().parent.parent
ROOMS = tuple(str(ROOT / room) for room in ("knowledge_base", "dsc", "planning", "domains"))
BEFORE = Path(__file__).with_name("calls.json")
"""The counts that `tests/test_bench_calls.py` compares with new ones."""
ITEMS = 3
"""Number of items on the table of the planning flows."""
MOVED_TO = "shelf"
"""Place of the items after the disturbance."""
ROUNDS = 7


@dataclass(frozen=True, slots=True)
class Count:
    """The figures of a flow.

    Attributes:
        calls: calls of Python functions of the project.
        hops: calls from one file of the project to another.
        files: files of the project that were visited.
        microseconds: the median of several rounds without the profiler.
    """

    calls: int
    hops: int
    files: int
    microseconds: float


class Counter:
    """Counts calls between `start` and `stop`, in the starting thread and in each thread that begins meanwhile."""

    def __init__(self, *, profiled: bool) -> None:
        self.calls = self.hops = 0
        self.seconds = 0.0
        self._files: set[str] = set()
        self._ours: dict[CodeType, bool] = {}
        self._profiled = profiled

    @property
    def files(self) -> int:
        """Number of the project's files that were visited."""
        return len(self._files)

    def start(self) -> None:
        """Start counting."""
        self.seconds = -time.perf_counter()
        if self._profiled:
            threading.setprofile(self._receive)
            sys.setprofile(self._receive)

    def stop(self) -> None:
        """Stop counting; calls of `stop` itself do not count."""
        sys.setprofile(None)
        threading.setprofile(None)
        self.seconds += time.perf_counter()

    def _receive(self, frame: FrameType, kind: str, _: Any) -> None:
        if kind != "call" or not self._is_covered(frame.f_code):
            return
        self.calls += 1
        self._files.add(frame.f_code.co_filename)
        caller = frame.f_back
        while caller is not None and not self._is_covered(caller.f_code):  # through asyncio, pydantic, networkx
            caller = caller.f_back
        self.hops += caller is not None and caller.f_code.co_filename != frame.f_code.co_filename

    def _is_covered(self, code: CodeType) -> bool:
        known = self._ours.get(code)
        if known is None:
            known = self._ours[code] = code.co_filename.startswith((*ROOMS, "<")) and "frozen" not in code.co_filename
        return known


Flow = Callable[[Counter], None]


def main() -> None:
    """Print the table; `--json` prints plain data, `--write` updates the docs and the kept counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="timed runs of each flow; 0: only count")
    chosen = parser.parse_args()
    if os.environ.get("PYTHONHASHSEED") != "0":  # the order of sets decides some loops
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, "PYTHONHASHSEED": "0"})  # noqa: S606
    found = counts(chosen.rounds)
    if chosen.json:
        print(json.dumps({name: asdict(one) for name, one in found.items()}, indent=2))
        return
    print(table(found))
    if chosen.write:
        BEFORE.write_text(json.dumps({name: one.calls for name, one in found.items()}, indent=2) + "\n", "utf-8")
        put(table(found), "calls")


def counts(rounds: int = ROUNDS) -> dict[str, Count]:
    """Return the figures of every flow by its name."""
    return {name: _count(flow(), rounds) for name, flow in FLOWS.items()}


def table(found: dict[str, Count]) -> str:
    """Return a Markdown table."""
    lines = ["| flow | calls | hops between files | files | µs |", "| --- | --- | --- | --- | --- |"]
    lines += [f"| {name} | {one.calls:,} | {one.hops:,} | {one.files} | {one.microseconds:,.1f} |"
              for name, one in found.items()]  # fmt: skip
    return "\n".join(lines)


def _count(flow: Flow, rounds: int) -> Count:
    for _ in range(2):  # fills tables and caches
        flow(Counter(profiled=False))
    counter = Counter(profiled=True)
    flow(counter)
    timed = [Counter(profiled=False) for _ in range(rounds)]
    for one in timed:
        flow(one)
    microseconds = 1e6 * statistics.median(one.seconds for one in timed) if timed else 0.0
    return Count(counter.calls, counter.hops, counter.files, microseconds)


def event() -> Flow:
    """Return a flow with an event to a warm machine: a guard, an assignment, exit, and an entry action."""
    states = {
        one: {
            "entry": [{"set": "robot.speed", "to": 1}],
            "on": {"ping": {"to": other, "when": "(> ?n 0)", "assign": {"n": "(+ ?n 1)"}}},
        }
        for one, other in ("ab", "ba")
    }
    variables = {"n": {"type": "number", "initial": 1}}
    at = ready({"plot": "bench", "variables": variables, "receives": {"ping": None}, "states": states})
    machine, ping = Machine(at.library), Event("ping")
    machine.start(at.plot, {}, at.situation)

    def flow(counter: Counter) -> None:
        counter.start()
        machine.send(ping, at.situation)
        counter.stop()

    return flow


def skill_and_back() -> Flow:
    """Return a flow from a posted event to the skill it starts, its outcome, and the next state's skill."""
    plot = ActionPlot.model_validate({
        "plot": "worker", "receives": {"ping": None},
        "states": {
            "rest": {"on": {"ping": "work"}},
            "work": {"entry": [{"trigger": "robot.work"}], "on": {"did": "next"}},
            "next": {"entry": [{"trigger": "robot.halt"}], "on": {"stopped": "rest"}},
        },
    })  # fmt: skip
    return lambda counter: run_simulated(_worked(plot, counter))


async def _worked(plot: ActionPlot, counter: Counter) -> None:
    robot = _Worker(counter)
    knowledge = KnowledgeBase(Schema.parse("(define (domain bench))"))
    sequencer = Sequencer(Library([plot]), knowledge, [robot], LoopClock(), open_ended=True)
    running = asyncio.create_task(sequencer.run("worker"))
    for turn in range(4):
        await asyncio.sleep(1)
        robot.counting = turn == 3
        if robot.counting:
            counter.start()
        sequencer.post(Event("ping"))
    await asyncio.sleep(1)
    running.cancel()
    await asyncio.wait([running])


class Did(Outcome):
    """The event `did`."""


class Stopped(Outcome):
    """The event `stopped`."""


class Begun(Outcome):
    """The event `begun`."""


class _Worker(Component):
    name = "robot"

    def __init__(self, counter: Counter) -> None:
        super().__init__()
        self.counting = False
        self._counter = counter

    @skill
    async def work(self, call: SkillCall) -> Did:  # noqa: ARG002
        return Did()

    @skill
    async def halt(self, call: SkillCall) -> Stopped:  # noqa: ARG002
        if self.counting:
            self._counter.stop()
        return Stopped()


def fired() -> Flow:
    """Return a flow from an asserted fact to the notification of an installed condition."""
    schema = Schema.parse("(define (domain bench) (:types cup table) (:predicates (on ?c - cup ?t - table)))")
    knowledge = KnowledgeBase(schema)
    with knowledge.transaction(author="bench") as world:
        world.add_node("cup1", "cup")
        world.add_node("table1", "table")
    present: list[Counter] = []
    condition = knowledge.install("(exists (?c - cup) (on ?c table1))")
    condition.subscribe(lambda _: present.pop().stop())

    def flow(counter: Counter) -> None:
        present.append(counter)
        counter.start()
        with knowledge.transaction(author="bench") as world:
            world.tell("on", "cup1", "table1")
        assert not present, "the condition has not fired"
        with knowledge.transaction(author="bench") as world:
            world.retract("on", "cup1", "table1")

    return flow


def planned() -> Flow:
    """Return a flow from an outcome to a decision to plan, a bound plan, and the call of its first skill."""
    return _Table(replanned=False).flow


def replanned() -> Flow:
    """Return a flow from an external change that breaks the plan to the new plan and its first skill."""
    return _Table(replanned=True).flow


class _Recalled:
    """A planner that repeats pyperplan's outcomes of the first run: the same calls, without its process."""

    def __init__(self) -> None:
        self._planner = PlannerProcess()
        self._answers: list[PlanningOutcome] = []
        self._next = 0

    def rewind(self) -> None:
        """Start again with the first outcome."""
        self._next = 0

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        """Return the outcome of the first run."""
        if self._next == len(self._answers):
            self._answers.append(await self._planner.solve(problem, seconds))
        self._next += 1
        return self._answers[self._next - 1]


CLEAR = ActionPlot.model_validate({
    "plot": "clear",
    "states": {
        "begin": {"entry": [{"trigger": "robot.begin"}], "on": {"begun": "tidy"}},
        "tidy": {
            "dynamic": [], "goal": to_text(set_table.GOAL),
            "on": {"done": "ended", "no_plan": "lost", "gave_up": "lost"},
        },
        "ended": {"final": True}, "lost": {"final": True},
    },
})  # fmt: skip


class _Table:
    """A table of `ITEMS` items; during the first step an external change moves the items of later steps."""

    def __init__(self, *, replanned: bool) -> None:
        self._domain = set_table.domain()
        self._plots = [_plot(action) for action in self._domain.actions.values()]
        self._library = Library([CLEAR, *self._plots])
        self._planner = _Recalled()
        self._replanned = replanned

    def flow(self, counter: Counter) -> None:
        """Run once; the robot starts and stops the counter."""
        world = set_table.world(ITEMS)
        self._planner.rewind()
        robot = _TableRobot(self._domain, world, counter, disturbed=self._replanned)
        with Robot(self._domain, self._library, [robot], world, planner=self._planner, clock="simulated") as program:
            end = program.run("clear")
        assert end.finished
        assert robot.counted


class _TableRobot(Component):
    """Finishes each step immediately; counts up to the first step, or from a disturbance to the next step."""

    name = "robot"

    def __init__(self, domain: Any, world: KnowledgeBase, counter: Counter, *, disturbed: bool) -> None:
        super().__init__()
        self._domain, self._world, self._counter = domain, world, counter
        self._disturbed = disturbed
        self._steps = 0
        self.counted = False

    @skill
    async def begin(self, call: SkillCall) -> Begun:  # noqa: ARG002
        if not self._disturbed:
            self._counter.start()
        return Begun()

    @skill
    async def act(
        self, call: SkillCall, action: str, a: str = "", b: str = "", c: str = "", d: str = "", e: str = ""
    ) -> Did:
        self._steps += 1
        if not self.counted and self._steps == (2 if self._disturbed else 1):
            self._counter.stop()
            self.counted = True
            assert not self._disturbed or b == MOVED_TO, "no new plan was bound"
        step = PlanStep(action, tuple(filter(None, (a, b, c, d, e))))
        if self._disturbed and self._steps == 1:
            await call.clock.sleep(1)
            self._counter.start()
            _disturb(self._world)
            await call.clock.sleep(1)
        return Did(observed=self._domain.effects(step, self._world))


def _disturb(world: KnowledgeBase) -> None:
    """Move every item to another place, so that the plan fails at its next step."""
    lying = [one for one in world.facts() if isinstance(one, Fact) and one.predicate == "lies-at"]
    moved = tuple(fact("lies-at", one.args[0], MOVED_TO) for one in lying)
    world.apply(Delta(removed=tuple(lying), added=moved), author="somebody")


def _plot(action: Any) -> ActionPlot:
    """Return the action's plot, with one call of the robot's skill."""
    given = dict(zip("abcde", (f"?{parameter.name}" for parameter in action.parameters), strict=False))
    act = {"entry": {"trigger": "robot.act", "with": {"action": action.name, **given}}, "on": {"did": "done"}}
    return ActionPlot.model_validate({
        "plot": action.name, "implements": action.name,
        "parameters": {parameter.name: (parameter.types or ("object",))[0] for parameter in action.parameters},
        "states": {"act": act, "done": {"final": True}},
    })  # fmt: skip


FLOWS: dict[str, Callable[[], Flow]] = {
    "an event, warm, in the engine": event,
    "an event to a skill, its outcome, the next state's skill": skill_and_back,
    "a told fact to a fired condition": fired,
    "a decision to plan to the first step's skill": planned,
    "an external change to the first step's skill of the new plan": replanned,
}

if __name__ == "__main__":
    main()
