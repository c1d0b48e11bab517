"""A live run in the hands of who watches it: held still, stepped, told things; only when that was allowed."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from dsc.sequencer.run_end import RunEnd

pytest.importorskip("starlette", reason="the extra `viewer` is not installed")

from domains.clean_up_table.bringup import deploy
from domains.clean_up_table.scenario import Scenario
from dsc import parse_plot
from dsc.dynamic.library import Library
from dsc.events import Event
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from dsc.trace import Trace
from dsc.viewer.control import Control
from dsc.viewer.records import RecordLog
from knowledge_base import InputError, KnowledgeBase, Schema


class Watched:
    """A run in a thread of its own that stands still at its first event."""

    def __init__(self, breakpoint_: dict[str, Any] | None = None) -> None:
        self.log = RecordLog(live=True)
        self._changed = threading.Condition()
        self.control = Control(self._change)
        self.report = None
        table = deploy(
            Scenario.parse("table: {cups: 2, cans: 1, crisp_cans: [small]}"), 1, 0.0, listener=self.log.receive
        )

        def attach(sequencer) -> None:
            self.control.attach(sequencer)
            self.control._steps = 0

        def run() -> None:
            with table:
                self.report = table.report(prepare=attach)
            self._change()

        self.thread = threading.Thread(target=run, daemon=True)
        self.thread.start()
        self.until(lambda: self.control.paused)

    def _change(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def until(self, met) -> None:
        with self._changed:
            assert self._changed.wait_for(met, timeout=60)

    def to_the_end(self):
        self.control.obey({"do": "resume"})
        self.until(lambda: self.report is not None)
        self.thread.join()
        return self.report

    def types(self) -> list[str]:
        return [self.log.record(seq)["type"] for seq in range(1, len(self.log) + 1)]


def test_a_run_that_is_held_still_and_stepped_ends_like_any_other() -> None:
    watched = Watched()
    seen = watched.types()
    assert seen.count("step") == 1  # the start; the first event waits
    watched.control.obey({"do": "step"})
    watched.until(lambda: watched.control.paused and watched.types().count("step") > 1)
    assert watched.types().count("event") == 1
    report = watched.to_the_end()
    assert report.goal_reached
    undisturbed = deploy(Scenario.parse("table: {cups: 2, cans: 1, crisp_cans: [small]}"), 1, 0.0)
    with undisturbed:
        assert undisturbed.report().simulated_s == report.simulated_s  # simulated time stood still, too


@pytest.mark.parametrize(
    ("on", "record"),
    [
        ({"state": "clear/execute"}, lambda r: any("clear/execute" in m["entered"] for m in r.get("microsteps", ()))),
        ({"event": "plan_found"}, lambda r: r.get("name") == "plan_found"),
        ({"condition": "(exists (?i - item) (holding ?i))"}, lambda r: "holding" in str(r.get("added"))),
        ({"plan_step": "(pick-up can1 table)"}, lambda r: "clear/execute/step_1" in str(r.get("microsteps"))),
    ],
)
def test_a_breakpoint_holds_the_run_where_it_says(on, record) -> None:
    watched = Watched()
    watched.control.obey({"do": "break", "on": on})
    watched.control.obey({"do": "resume"})
    watched.until(lambda: watched.control.paused)
    assert next(iter(on.values())) in (watched.control.paused or "")
    met = [seq for seq in range(1, len(watched.log) + 1) if record(watched.log.record(seq))]
    assert met
    watched.control.obey({"do": "unbreak", "number": 1})
    assert watched.to_the_end().goal_reached


def test_a_step_of_a_plan_is_found_in_any_of_its_regions() -> None:
    """Two robots: each has a region of the plan's plot."""
    held: list[str] = []

    def changed() -> None:
        if control.paused and not held:
            held.append(control.paused)
            threading.Thread(target=control.obey, args=({"do": "resume"},)).start()  # as a page does: not in the run

    control = Control(changed)

    async def main(knowledge: KnowledgeBase) -> RunEnd:
        clock = LoopClock()
        plan = parse_plot(PLAN).model_copy(update={"generated": True})
        sequencer = Sequencer(Library([plan]), knowledge, [], clock, Trace(clock.now))
        control.attach(sequencer)
        sequencer.post(Event("go"), after=1.0)
        sequencer.post(Event("go"), after=2.0)
        return await sequencer.run("plan")

    control.obey({"do": "break", "on": {"plan_step": "(drive bert)"}})
    with KnowledgeBase.open(Schema.parse("(define (domain d))")) as knowledge:
        assert run_simulated(main(knowledge)).finished
    assert held == ["plan step (drive bert)"]


PLAN = """
plot: plan
receives: {go: }
states:
  work:
    regions:
      anna: {states: {step_1: {about: (drive anna), on: {go: over_1}}, over_1: {final: true}}}
      bert:
        states:
          start: {on: {go: step_2}}
          step_2: {about: (drive bert), on: {go: over_2}}
          over_2: {final: true}
    on: {done: over}
  over: {final: true}
"""


def test_events_and_facts_are_handed_in() -> None:
    watched = Watched()
    watched.control.obey({"do": "tell", "statements": ["(cup spare)", "(seen spare)"]})
    watched.control.obey({"do": "event", "name": "stop"})
    watched.to_the_end()
    events = [watched.log.record(n) for n in range(1, len(watched.log) + 1)]
    assert [e["source"] for e in events if e.get("name") == "stop"] == ["outside"]
    assert [e["nodes"] for e in events if e.get("author") == "viewer"] == [{"spare": "cup"}]


def test_a_parameter_is_set_within_what_is_left_to_operators() -> None:
    watched = Watched()
    watched.control.obey({"do": "set", "owner": "wait", "name": "seconds", "value": 5})
    watched.to_the_end()
    records = [watched.log.record(n) for n in range(1, len(watched.log) + 1)]
    assert [r["value"] for r in records if r.get("port") == "wait.seconds"] == [5]


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (
            {"do": "set", "owner": "base", "name": "sped", "value": 1},
            "component 'base' has no parameter 'sped'; did you mean 'speed'",
        ),
        (
            {"do": "set", "owner": "wait", "name": "seconds", "value": "long"},
            "'wait.seconds' is a number; found the text long",
        ),
        ({"do": "stepp"}, "there is nothing to do called 'stepp'; did you mean 'step'"),
        ({"do": "break", "on": {"stat": "clear"}}, "a breakpoint is on one of"),
        ({"do": "break", "on": {"condition": "(holdin cup1)"}}, "did you mean 'holding'"),
        ({"do": "unbreak", "number": 9}, "there is no breakpoint 9"),
        ({"do": "tell", "statements": ["(onn a b)"]}, "there is no predicate 'onn'"),
        ({"do": "tell", "statements": "(on a b)"}, "'statements' is a list of texts"),
        ({"do": "event", "name": "done"}, "is fired by the executive itself"),
    ],
)
def test_an_invalid_command_is_refused_and_the_run_reaches_its_goal(command, message) -> None:
    watched = Watched()
    with pytest.raises(InputError, match=message.replace("(", r"\(")):
        watched.control.obey(command)
    assert watched.to_the_end().goal_reached
    with pytest.raises(InputError, match="the run is over"):
        watched.control.obey({"do": "pause"})
