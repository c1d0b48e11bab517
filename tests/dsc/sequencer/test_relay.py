"""Plots that run as skills, in the trace of their caller: states, decisions, skills, their ends, and kept runs."""

from __future__ import annotations

import pytest
from dsc_charts import plot

from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.dynamic.library import Library
from dsc.errors import SkillError
from dsc.outcomes import Outcome
from dsc.runs.archive import archive, records_of
from dsc.runs.store import RunStore
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.plot_skill import PlotComponent
from dsc.sequencer.replay import replay
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from dsc.trace import Record, Trace
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema

FETCH = """
    plot: fetch
    parameters: {item: {type: text, default: cup}}
    outputs: {where: {type: text, initial: table}}
    states:
      look: {after: {seconds: 1, to: take}}
      take: {dynamic: [grasp], on: {done: over}}
      over: {final: true}
"""
GRASP = """
    plot: grasp
    states:
      reach: {entry: {trigger: arm.grab}, on: {reached: held}}
      held: {final: true}
"""


class Reached(Outcome): ...


class Arm(Component):
    name = "arm"
    breaks = False

    @skill
    async def grab(self, call: SkillCall) -> Reached:
        await call.clock.sleep(2)
        if self.breaks:
            raise SkillError("it is stuck")
        return Reached()


def helper():
    return PlotComponent("helper", Library([plot(FETCH), plot(GRASP)]), [Arm()])


def ran(text, *components):
    records: list[Record] = []

    async def main():
        trace = Trace(LoopClock().now)
        trace.listen(records.append)
        knowledge = KnowledgeBase(Schema())
        library = Library([plot(text), *(one for component in components for one in component.plots())])
        return await Sequencer(library, knowledge, components, LoopClock(), trace).run("work")

    return run_simulated(main()), records


def active_after(records):
    """Return the active states after the records, each of which was entered one time and exits one time."""
    active: list[str] = []
    for record in records:
        for micro in record.data["microsteps"] if record.type == "step" else ():
            for path in micro["exited"]:
                active.remove(path)
            assert set(micro["entered"]).isdisjoint(active)
            active += micro["entered"]
    return active


USES = """
    plot: work
    outputs: {where: {type: text, initial: unknown}}
    states:
      go: {use: helper.fetch, with: {item: can}, on: {done: {to: over, assign: {where: ?event.where}}}}
      over: {final: true}
"""


def test_a_plot_of_a_component_is_used_like_an_own_one():
    end, records = ran(USES, helper())
    assert end.finished
    assert end.outputs == {"where": "table"}
    assert [record.t for record in records if record.type == "end"] == [3.0]


def test_its_states_are_below_the_state_that_uses_it():
    _, records = ran(USES, helper())
    entered = [
        path for one in records if one.type == "step" for micro in one.data["microsteps"] for path in micro["entered"]
    ]
    inner = [path for path in entered if path.startswith("go/there/")]
    assert inner == ["go/there/look", "go/there/take", "go/there/take/reach", "go/there/take/held", "go/there/over"]
    assert active_after(records) == []
    bound = [
        one
        for record in records
        if record.type == "step"
        for micro in record.data["microsteps"]
        for one in micro.get("bound", ())
    ]
    plots = {record.data["hash"]: record.data["name"] for record in records if record.type == "plot"}
    assert [(one["state"], plots[one["hash"]]) for one in bound] == [
        ("", "work"), ("go", "helper.fetch"), ("go/there", "fetch"), ("go/there/take", "grasp")
    ]  # fmt: skip


def test_its_decisions_and_skills_are_in_the_trace_with_their_causes():
    _, records = ran(USES, helper())
    by_seq = {record.seq: record for record in records}
    (decision,) = [record for record in records if record.type == "decision"]
    assert decision.data["state"] == "go/there/take"
    assert decision.data["chosen"] == "grasp"
    outer, inner = [record for record in records if record.type == "action"]
    assert (outer.data["skill"], inner.data["skill"]) == ("helper.fetch", "arm.grab")
    assert inner.data["id"].startswith(f"{outer.data['id']}/")
    assert inner.data["of"] == outer.data["id"]
    reached = next(record for record in records if record.type == "event" and record.data["name"] == "reached")
    assert by_seq[reached.cause] is inner
    assert by_seq[by_seq[decision.cause].cause].data["name"] == "after"  # the step after the timer
    assert all(record.cause is None or record.cause < record.seq for record in records)
    assert [record.type for record in records].count("world") == 1
    assert [one.type for one in records].count("end") == 1


def test_a_cancelled_plot_leaves_its_states_before_its_caller_leaves_its_own():
    limited = USES.replace("}}}\n", "}}, after: {seconds: 2, to: over}}\n", 1)
    end, records = ran(limited, helper())
    assert end.finished
    assert active_after(records) == []
    left = next(record for record in records if record.type == "step" and record.t == 2.0)
    assert left.data["microsteps"][0]["exited"] == ["go/there/take/reach", "go/there/take"]
    cancelled = [
        record.data["skill"] for record in records if record.type == "action" and record.data["action"] == "cancel"
    ]
    assert cancelled == ["arm.grab", "helper.fetch"]


def test_a_plot_that_fails_leaves_its_states():
    fails = USES.replace("on: {", "on: {skill_error: over, ", 1)
    component = helper()
    component._components[0].breaks = True
    end, records = ran(fails, component)
    assert end.finished
    assert active_after(records) == []


def test_a_plot_that_is_used_again_is_not_written_again():
    twice = USES.replace("{to: over,", "{to: again,").replace(
        "over: {", "again: {use: helper.fetch, on: {done: over}}\n      over: {", 1
    )
    _, records = ran(twice, helper())
    names = [record.data["name"] for record in records if record.type == "plot"]
    assert sorted(names) == ["fetch", "grasp", "helper.fetch", "work"]


def test_two_plots_of_one_state_do_not_mix_their_states():
    both = """
        plot: work
        states:
          go: {entry: [{trigger: helper.fetch, with: {item: can}}, {trigger: other.fetch, with: {item: can}}], on: {completed: {}}, after: {seconds: 9, to: over}}
          over: {final: true}
    """
    other = PlotComponent("other", Library([plot(FETCH), plot(GRASP)]), [Arm()])
    end, records = ran(both, helper(), other)
    assert end.finished
    assert active_after(records) == []
    steps = [record for record in records if record.type == "step" and "of" in record.data]
    assert len({record.data["of"] for record in steps}) == 1
    assert len([record for record in records if record.type == "decision"]) == 2


class Strange(Component):
    name = "helper"

    @skill
    async def fetch(self, call: SkillCall, lines: list[str]) -> Reached:
        await call.clock.sleep(1)
        call.record(lines)
        return Reached()


@pytest.mark.parametrize("line", ["", "{}", "[]", '{"seq": 1, "t": 0, "type": "step", "cause": null}', '{"seq": 1}', "null",
                                  '{"seq": 1, "t": 0, "type": "step", "cause": [], "microsteps": [3]}',
                                  '{"seq": 1, "t": 0, "type": "plot", "cause": null}',
                                  '{"seq": 1, "t": 0, "type": "action", "cause": null, "id": 3}'])  # fmt: skip
def test_a_record_that_cannot_be_read_is_left_out(line, caplog):
    text = """
        plot: work
        states:
          go: {entry: {trigger: helper.fetch, with: {lines: ?lines}}, on: {reached: over}}
          over: {final: true}
        variables: {lines: {type: list of text, initial: LINES}}
    """
    import json

    end, records = ran(text.replace("LINES", json.dumps([line])), Strange())
    assert end.finished, end.reason
    assert not any("of" in record.data for record in records)
    assert "cannot be read" in caplog.text


def test_a_kept_run_keeps_each_record_one_time_and_is_replayed(tmp_path):
    store = tmp_path / "run.kb"
    schema = Schema()
    component = helper()
    library = Library([plot(USES), *component.plots()])

    async def main():
        with KnowledgeBase.open(schema, store, "process") as knowledge:
            kept = RunStore(knowledge, store)
            return await Sequencer(library, knowledge, [component], LoopClock(), store=kept).run("work")

    assert run_simulated(main()).finished
    assert active_after(records_of(store)[1]) == []
    with archive(store) as runs:
        messages = [step.message for step in runs.steps(1)]
    relayed = [one for one in messages if one.get("outcome") == "(recorded)"]
    assert relayed
    assert all(one["attributes"] == {} for one in relayed)
    assert replay(store).divergence is None
