"""Threads of drivers post events, changes, settings and values while a run goes on (S0.6)."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import ClassVar

import pytest
from dsc_charts import plot

from dsc import Component, Event, Library, LoopClock, Outcome, Sequencer, SkillCall, run_simulated, skill
from dsc.components.ports import event
from dsc.components.streams import Push, Stream
from dsc.loop_calls import LoopCalls
from dsc.sequencer.clock import run_real
from knowledge_base import Delta, KnowledgeBase, Schema, fact

SCHEMA = Schema.parse("(define (domain d) (:predicates (seen)))")
COUNT = 50
RUNS = [run_simulated, run_real]


class Below(Outcome):
    level: float


class Read(Outcome):
    n: float


class Scanner(Component):
    """Its driver calls it back from a thread that begins with the skill."""

    name = "scanner"
    push_scan = Push({"n": "number"})

    def __init__(self, work: Callable[[Scanner], None] = lambda _: None) -> None:
        super().__init__()
        self.work = work

    @event
    def battery(self, level: float, below: float = 20.0) -> Below | None:
        return Below(level=level) if level < below else None

    @skill
    async def scan(self, call: SkillCall) -> Read:
        thread = threading.Thread(target=self.work, args=(self,))
        thread.start()
        await call.clock.sleep(0.2)
        thread.join()
        await call.clock.sleep(0.2)
        return Read(n=0)


class Reader(Component):
    name = "reader"
    scan = Stream({"n": "number"}, "scanner.push_scan")
    needs: ClassVar = {"": ("scanner",)}

    @skill
    async def newest(self, call: SkillCall) -> Read:
        while self.scan.value is None:
            await call.clock.sleep(0.05)
        return Read(n=self.scan.value["n"])


def executed(run, text, components, work):
    knowledge = KnowledgeBase(SCHEMA)
    clocks = []

    async def main():
        clock = LoopClock()
        sequencer = Sequencer(Library([plot(text)]), knowledge, components, clock)
        components[0].work = lambda scanner: work(scanner, sequencer)
        clocks.append(clock)
        return await sequencer.run("p")

    return run(main()), knowledge


SCAN = "entry: {trigger: scanner.scan}"


@pytest.mark.parametrize("run", RUNS)
def test_events_of_a_thread_arrive_in_order(run):
    text = f"""
        plot: p
        receives: {{tick: {{n: number}}}}
        emits: {{got: {{n: number}}}}
        states:
          s: {{{SCAN}, on: {{tick: {{emit: got, with: {{n: ?event.n}}}}, read: e}}}}
          e: {{final: true}}
    """

    def work(_, sequencer):
        for n in range(COUNT):
            sequencer.post(Event("tick", {"n": n}), after=0.001 if n % 10 == 9 else 0)

    end, _ = executed(run, text, [Scanner()], work)
    assert end.problem is None
    got = [one.attributes["n"] for one in end.emitted]
    assert sorted(got) == list(range(COUNT))
    at_once = [n for n in got if n % 10 != 9]
    assert at_once == sorted(at_once)


@pytest.mark.parametrize("run", RUNS)
def test_changes_of_a_thread_reach_conditions(run):
    text = f"{{plot: p, states: {{s: {{{SCAN}, always: [{{when: (seen), to: e}}], on: {{read: s2}}}}, s2: {{}}, e: {{final: true}}}}}}"

    def work(_, sequencer):
        sequencer.change(Delta(added=(fact("seen"),)), "driver")

    end, knowledge = executed(run, text, [Scanner()], work)
    assert end.problem is None
    assert knowledge.holds("seen", ())


@pytest.mark.parametrize("run", RUNS)
def test_values_of_an_event_come_from_a_thread(run):
    text = """
        plot: p
        emits: {low: {level: number}}
        states:
          s: {entry: [{trigger: scanner.battery}, {trigger: scanner.scan}],
              on: {below: {emit: low, with: {level: ?event.level}}, read: e}}
          e: {final: true}
    """

    def work(scanner, _):
        for level in (30.0, 19.0, 18.0, 25.0, 17.0):
            scanner.update("battery", level)

    end, _ = executed(run, text, [Scanner()], work)
    assert end.problem is None
    assert [one.attributes["level"] for one in end.emitted] == [19.0, 17.0]


@pytest.mark.parametrize("run", RUNS)
def test_a_thread_pushes_values_to_a_stream(run):
    text = f"""
        plot: p
        emits: {{got: {{n: number}}}}
        states:
          s:
            regions:
              r1: {{states: {{a: {{{SCAN}, on: {{read: ae}}}}, ae: {{final: true}}}}}}
              r2: {{states: {{b: {{entry: {{trigger: reader.newest}}, on: {{read: {{to: be, emit: got, with: {{n: ?event.n}}}}}}}}, be: {{final: true}}}}}}
            on: {{done: e}}
          e: {{final: true}}
    """

    def work(scanner, _):
        scanner.push_scan.put(n=7)

    end, _ = executed(run, text, [Scanner(), Reader()], work)
    assert end.problem is None
    assert [one.attributes["n"] for one in end.emitted] == [7]


def test_values_before_and_after_a_run_are_kept():
    scanner = Scanner()
    scanner.update("battery", 5.0)
    text = "{plot: p, states: {s: {entry: {trigger: scanner.battery}, on: {below: e}, after: {seconds: 1, to: late}}, late: {}, e: {final: true}}}"
    for level in (6.0, 7.0):
        end, _ = executed(run_simulated, text, [scanner], lambda *_: None)
        assert end.problem is None
        thread = threading.Thread(target=scanner.update, args=("battery", level))
        thread.start()
        thread.join()


def test_a_call_without_a_loop_may_lead_to_another():
    calls = LoopCalls()
    done: list[int] = []
    thread = threading.Thread(target=calls.call, args=(calls.call, done.append, 1), daemon=True)
    thread.start()
    thread.join(5)
    assert done == [1]
