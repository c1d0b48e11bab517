"""Components on the other side of a transport live on when the sequencer dies: nothing is done twice there, or lost."""

from __future__ import annotations

import asyncio

import pytest
from dsc_charts import plot
from dsc_crashes import copied
from dsc_runs import SCHEMA

from dsc import SkillCall
from dsc.components.component import Component
from dsc.components.ports import event
from dsc.dynamic.library import Library
from dsc.outcomes import Outcome
from dsc.runs.archive import archive
from dsc.runs.store import RunStore
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from dsc.trace import Trace
from dsc.wire.endpoint import LocalTransport
from dsc.wire.host import Host
from dsc.wire.remote import RemoteComponent
from knowledge_base.facts import Delta, Fact
from knowledge_base.store import KnowledgeBase


class Did(Outcome): ...


class Progress(Outcome):
    n: float


class Low(Outcome):
    level: float


class Robot(Component):
    """Lives in a program of its own."""

    name = "robot"

    def __init__(self):
        super().__init__()
        self.log = []

    async def start(self):
        self.log.append("alive")

    @skill
    async def work(self, call: SkillCall[Progress], name, observes="p") -> Did:
        self.log.append(name)
        try:
            for n in range(3):
                await call.clock.sleep(0.5)
                call.report(Progress(n=n))
        except BaseException:
            self.log.append(f"{name} stopped")
            raise
        return Did(observed=Delta(added=(Fact(observes),)))

    @event
    def low(self, level: float, below: float = 20.0) -> Low | None:
        return Low(level=level) if level < below else None


class Mortal:
    """One program's way to a transport; nothing leaves it, or reaches it, once it is dead."""

    def __init__(self, transport):
        self.transport = transport
        self.dead = False

    def attach(self, address, receive):
        self.transport.attach(address, lambda sender, frame: None if self.dead else receive(sender, frame))

    def watch(self, address, changed):
        return self.transport.watch(address, lambda present: None if self.dead else changed(present))

    def detach(self, address):
        self.transport.detach(address)

    def send(self, sender, to, frame):
        if not self.dead:
            self.transport.send(sender, to, frame)


CHART = """
    plot: p
    variables: {n: {type: number, initial: 0}}
    states:
      a:
        entry: [{trigger: robot.work, with: {name: one}}, {trigger: robot.low, with: {below: 18}}]
        on: {progress: {assign: {n: (+ ?n 1)}}, low: {assign: {n: (+ ?n 10)}}, did: b}
      b: {entry: [{switch: robot, to: careful}, {trigger: robot.work, with: {name: two, observes: q}}], on: {progress: {assign: {n: (+ ?n 1)}}, did: [{to: c, when: (= ?n 16)}, wrong]}}
      c: {entry: [{trigger: robot.work, with: {name: three}}], after: {seconds: 0.7, to: d}, on: {did: wrong}}
      d: {entry: [{trigger: robot.work, with: {name: four}}], on: {did: e}}
      wrong:
      e: {final: true}
"""


def lived(tmp_path, crash_at):
    """How a run ends that dies in that macrostep, before it is committed, and is resumed; with what the robot did."""

    async def main():
        transport, robot, clock = LocalTransport(), Robot(), LoopClock()
        host = Host(robot, transport, clock)
        clock.call_at(0.9, lambda: robot.update("low", 15))
        (first := tmp_path / "first").mkdir()
        mortal, died, number = Mortal(transport), asyncio.Event(), 0

        def die(_):
            nonlocal number
            number += 1
            if number == crash_at:
                copied(first, tmp_path / "second")
                mortal.dead = True
                died.set()

        alive = asyncio.create_task(life(mortal, first, clock, die))
        await asyncio.wait([alive, dying := asyncio.create_task(died.wait())], return_when="FIRST_COMPLETED")
        dying.cancel()
        if died.is_set():
            end, path = await life(Mortal(transport), tmp_path / "second", None), tmp_path / "second"
            alive.cancel()  # it has been talking to nobody
        else:
            end, path = await alive, first
        await host.close()
        return end, steps(path), sorted(robot.log)

    async def life(transport, folder, clock, listener=None):
        library = Library([plot(CHART)])
        remote = await RemoteComponent.connect("robot", transport)
        with KnowledgeBase.open(SCHEMA, folder / "run.kb") as kb:
            store = RunStore(kb, folder / "run.kb")
            kept = None if listener else store.load_unfinished(library)
            clock = clock or LoopClock(kept.time)
            trace = Trace(clock.now, kept.last_record if kept else 0)
            sequencer = Sequencer(library, kb, [remote], clock, trace, store=store)
            if listener is not None:
                sequencer.listen(listener)
                task = sequencer.run("p")
            else:
                assert kept is not None
                task = sequencer.resume(kept)
            return await task

    return run_simulated(main())


def steps(folder):
    with archive(folder / "run.kb") as runs:
        return [(step.message.get("outcome"), step.configuration) for step in runs.steps(1)]


WHOLE = 0
DONE = sorted(["alive", "one", "two", "three", "three stopped", "four"])


def test_it_does_what_it_does_without_a_crash(tmp_path):
    end, _, log = lived(tmp_path, WHOLE)
    assert end.finished
    assert log == DONE


def test_a_run_does_not_hear_of_what_another_program_has_left_there():
    async def main():
        transport, robot, clock = LocalTransport(), Robot(), LoopClock()
        host = Host(robot, transport, clock)
        for name, dies in (("one", True), ("two", False)):
            mortal = Mortal(transport)
            remote = await RemoteComponent.connect("robot", mortal)
            chart = f"{{plot: p, states: {{a: {{entry: [{{trigger: robot.work, with: {{name: {name}}}}}], on: {{did: e}}}}, e: {{final: true}}}}}}"
            running = asyncio.create_task(
                Sequencer(Library([plot(chart)]), KnowledgeBase(SCHEMA), [remote], clock).run("p")
            )
            if dies:
                await clock.sleep(1)
                mortal.dead = True
        end = await running
        await host.close()
        return end, robot.log

    end, log = run_simulated(main())
    assert end.finished
    assert log == ["alive", "one", "two"]


@pytest.mark.parametrize("crash_at", range(2, 16))
def test_wherever_the_sequencer_dies_the_robot_does_each_thing_once(tmp_path, crash_at):
    (whole := tmp_path / "whole").mkdir()
    end, took, _ = lived(whole, WHOLE)
    (killed := tmp_path / "killed").mkdir()
    resumed, took_in_all, log = lived(killed, crash_at)
    assert resumed == end
    assert log == DONE
    assert [one for one in took_in_all if one[0] != "progress"] == [one for one in took if one[0] != "progress"]
