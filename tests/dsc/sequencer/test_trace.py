"""The record of a run: numbered, caused, one line of JSON each."""

from __future__ import annotations

import io
import json

from dsc_charts import plot

from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.engine.steps import Cancel, Start
from dsc.events import Event
from dsc.sequencer.step_tracing import StepTracer
from dsc.trace import FORMAT, VERSION, Record, Trace, header, write_to
from knowledge_base.facts import Change, Delta, fact
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema


def test_a_record_is_one_line_with_the_head_first():
    line = Record(3, 1.23456789, "event", 2, {"name": "käse", "attributes": {"a": 1}}).to_line()
    assert line == '{"seq": 3, "t": 1.234568, "type": "event", "cause": 2, "name":"käse","attributes":{"a":1}}'


def test_records_are_numbered_timed_and_caused():
    times = iter([0.0, 1.5])
    trace = Trace(lambda: next(times))
    heard: list[Record] = []
    trace.listen(heard.append)
    first = trace.record("event", name="a")
    trace.cause = first
    trace.record("scene", items=[])
    assert heard == [Record(1, 0.0, "event", None, {"name": "a"}), Record(2, 1.5, "scene", 1, {"items": []})]


def test_all_listeners_hear_the_same_from_when_they_listen_on():
    trace = Trace(lambda: 0.0)
    early: list[Record] = []
    late: list[Record] = []
    trace.listen(early.append)
    trace.record("event")
    trace.listen(late.append)
    trace.record("end")
    assert [r.type for r in early] == ["event", "end"]
    assert [r.type for r in late] == ["end"]


def test_a_file_has_a_header_and_a_line_for_each_record():
    stream = io.StringIO()
    stream.write(header(seed=4) + "\n")
    trace = Trace(lambda: 0.0)
    trace.listen(write_to(stream))
    trace.record("end", finished=True)
    head, record = map(json.loads, stream.getvalue().splitlines())
    assert head == {"format": FORMAT, "version": VERSION, "seed": 4}
    assert record == {"seq": 1, "t": 0.0, "type": "end", "cause": None, "finished": True}


# -- steps as records --------------------------------------------------------------------------------------

PLOTS = """
    plot: p
    states:
      a: {on: {go: {to: h, tell: (p)}}}
      h: {dynamic: [q], entry: [{trigger: c.s, with: {x: 1}}, {set: c.y, to: 2}, {switch: c, to: up}], on: {done: a}}
"""
INNER = "{plot: q, when: (p), states: {s: {after: {seconds: 1, to: e}}, e: {final: true}}}"


def traced():
    kb = KnowledgeBase(Schema.parse("(define (domain d) (:predicates (p)))"))
    library = Library([plot(PLOTS), plot(INNER)])
    trace = Trace(lambda: 0.0)
    heard: list[Record] = []
    trace.listen(heard.append)
    tracer, machine = StepTracer(trace), Machine(library)
    for step in (
        machine.start("p", {}, KnowledgeSituation(kb, library)),
        machine.send(Event("nothing"), KnowledgeSituation(kb, library)),
        machine.send(Event("go"), KnowledgeSituation(kb, library)),
    ):
        tracer.step(step)
        tracer.decisions(step)
        for output in step.output:
            if isinstance(output, Start):
                tracer.started(output)
            elif isinstance(output, Cancel):
                tracer.cancelled(output.activation)
            else:
                tracer.told(output)
    return heard, tracer


def test_a_step_is_told_with_what_was_taken_left_and_entered():
    heard, _ = traced()
    steps = [r.data["microsteps"] for r in heard if r.type == "step"]
    bound = [{"state": "", "plot": "p", "hash": plot(PLOTS).digest}]
    assert steps[0] == [{"event": None, "taken": [], "exited": [], "entered": ["a"], "bound": bound}]
    taken = [{"from": "a", "on": "go", "to": "h"}]
    bound = [{"state": "h", "plot": "q", "hash": plot(INNER).digest}]
    assert steps[1] == [{"event": "go", "taken": taken, "exited": ["a"], "entered": ["h", "h/s"], "bound": bound}]
    assert len(steps) == 2  # nothing is said about an event nobody took


def test_a_decision_is_told_with_its_reasons():
    heard, _ = traced()
    (decision,) = [r.data for r in heard if r.type == "decision"]
    assert (decision["state"], decision["chosen"], decision["satisfied"]) == ("h", "q", False)
    assert "by" not in decision  # of a choice by order
    assert decision["candidates"] == [
        {"plot": "q", "fits": True, "reason": "(p) is true", "condition": {"text": "(p)", "truth": True}}
    ]


def test_actions_are_told_and_timers_are_not():
    heard, _ = traced()
    actions = [r.data for r in heard if r.type == "action"]
    assert [a["action"] for a in actions] == ["start", "set", "switch"]
    assert actions[0]["skill"] == "c.s"
    assert actions[0]["arguments"] == {"x": 1}
    assert actions[1]["port"] == "c.y"
    assert actions[2] == {"action": "switch", "component": "c", "mode": "up"}


def test_a_skill_that_is_cancelled_is_told_once_and_one_that_ended_is_not():
    trace = Trace(lambda: 0.0)
    heard: list[Record] = []
    trace.listen(heard.append)
    tracer = StepTracer(trace)
    starts = [Start(f"a{n}.0", n, "c", "s", {}) for n in (1, 2)]
    for start in starts:
        tracer.started(start)
    tracer.answered(starts[0])
    for _ in range(2):
        for start in starts:
            tracer.cancelled(start.activation)
    assert [r.data for r in heard[2:]] == [{"action": "cancel", "id": "a2.0", "skill": "c.s"}]


def test_every_plot_is_told_once_in_full_before_its_first_step():
    heard, _ = traced()
    assert [r.type for r in heard][:2] == ["plot", "step"]
    plots = [r.data for r in heard if r.type == "plot"]
    assert [p["name"] for p in plots] == ["p", "q"]
    assert plots[0]["hash"] == plot(PLOTS).digest
    assert plots[0]["plot"] == plot(PLOTS).to_form()


def test_a_plot_is_told_with_words_for_the_names_that_its_handlers_added():
    text = "{plot: p, receives: {low: }, states: {s: }, handlers: [{on: low, do: {tell: (p)}}]}"
    kb = KnowledgeBase(Schema.parse("(define (domain d) (:predicates (p)))"))
    library = Library([plot(text)])
    trace = Trace(lambda: 0.0)
    heard: list[Record] = []
    trace.listen(heard.append)
    StepTracer(trace).step(Machine(library).start("p", {}, KnowledgeSituation(kb, library)))
    assert heard[0].data["words"]["states"]["low_awaited"] == "waits for low"


def test_a_change_of_knowledge_is_told_whole():
    heard, tracer = traced()
    delta = Delta(
        nodes={"cup1": "cup"}, removed=(fact("p", "a"),), added=(fact("q", "b", 1),),
        values={fact("f", "a"): 2.0}, removed_nodes=("cup2",),
    )  # fmt: skip
    tracer.knowledge(Change(7, "camera", delta))
    data = heard[-1].data
    assert heard[-1].type == "knowledge"
    assert data == {
        "version": 7, "author": "camera", "nodes": {"cup1": "cup"}, "removed": [["p", "a"]],
        "added": [["q", "b", 1]], "values": [["f", "a", 2.0]], "removed_nodes": ["cup2"],
    }  # fmt: skip
    tracer.knowledge(Change(7, "camera", Delta()))
    assert heard[-1].data is data


def test_lines_can_be_read_by_any_json_reader():
    heard, _ = traced()
    for record in heard:
        assert json.loads(record.to_line())["seq"] == record.seq


def test_a_step_tells_new_and_changed_variables_by_the_state_that_holds_their_plot():
    outer = """
        plot: p
        parameters: {who: {type: text}}
        variables: {n: {type: number, initial: 0}}
        states:
          a: {on: {go: {to: h, assign: {n: (+ ?n 1)}}}}
          h: {use: q, with: {m: ?n}, on: {again: {to: h}, still: {do: [{assign: {n: ?n}}]}}}
    """
    library = Library(
        [plot(outer), plot("{plot: q, parameters: {m: {type: number}}, states: {s: {}, e: {final: true}}}")]
    )
    trace = Trace(lambda: 0.0)
    heard: list[Record] = []
    trace.listen(heard.append)
    tracer, machine = StepTracer(trace), Machine(library)
    situation = KnowledgeSituation(KnowledgeBase(Schema.parse("(define (domain d))")), library)
    tracer.step(machine.start("p", {"who": "me"}, situation))
    for name in ("go", "still", "again"):
        tracer.step(machine.send(Event(name), situation))
    told = [record.data.get("variables") for record in heard if record.type == "step"]
    assert told == [{"": {"who": "me", "n": 0}}, {"": {"n": 1}, "h": {"m": 1}}, None, {"h": {"m": 1}}]
