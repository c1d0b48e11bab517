"""Dialect `scxml`: borders crossed, history, events by prefix, actions in entry and exit; dialect `dsc` refuses them."""

from __future__ import annotations

import json
from itertools import permutations

import pytest
from dsc_charts import Run, plot
from dsc_runs import Ran

from dsc.dynamic.library import Library
from dsc.engine.idle_state import IdleState
from dsc.engine.machine_forms import read_state
from dsc.engine.steps import Note, SendLater
from dsc.engine.transition_selection import matches
from dsc.events import Event
from dsc.model.plot import ActionPlot
from dsc.sequencer.clock import LoopClock, SimulatedEventLoop
from dsc.sequencer.sequencer import Sequencer
from dsc.testing import DryRun
from dsc.trace import Trace
from dsc.validation import validate_plot
from knowledge_base.errors import InputError
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema


def chart(states, **keys):
    return ActionPlot.model_validate({"plot": "c", "dialect": "scxml", "states": states, **keys})


def test_a_transition_may_cross_borders_and_leaves_everything_up_to_the_common_composite():
    states = {
        "a": {"states": {"a1": {"on": {"go": "b2"}}}},
        "b": {"states": {"b1": {}, "b2": {}}},
    }
    run = Run(chart(states))
    run.start()
    step = run.send("go")
    assert step.microsteps[0].exited == ("a1", "a")
    assert run.active == ["b", "b2"]


def test_an_internal_transition_does_not_leave_its_source():
    inner: dict[str, dict[str, object]] = {"a1": {}, "a2": {}}
    for internal, exited in ((True, ("a1",)), (False, ("a1", "a"))):
        run = Run(chart({"a": {"states": inner, "on": {"go": {"to": "a2", "internal": internal}}}}))
        run.start()
        assert run.send("go").microsteps[0].exited == exited


@pytest.mark.parametrize(("depth", "restored"), [("shallow", ["p", "q", "q1"]), ("deep", ["p", "q", "q2"])])
def test_history_restores_what_was_left(depth, restored):
    states = {
        "p": {
            "on": {"out": "away"},
            "states": {
                "o": {"on": {"next": "q"}},
                "q": {"states": {"q1": {"on": {"next": "q2"}}, "q2": {}}},
                "h": {"history": depth, "to": "o"},
            },
        },
        "away": {"on": {"back": "h"}},
    }
    run = Run(chart(states, initial="away"))
    run.start()
    run.send("back")
    assert run.active == ["p", "o"]
    for event in ("next", "next", "out"):
        run.send(event)
    run.machine.state = read_state(run.machine.state.to_json(), run.library)
    run.send("back")
    assert run.active == restored


def test_deep_history_of_an_orthogonal_state_remembers_every_region():
    def region(name):
        return {"states": {f"{name}1": {"on": {"next": f"{name}2"}}, f"{name}2": {}}}

    states = {
        "o": {"on": {"out": "away"}, "regions": {"r": region("r"), "s": region("s")},
              "connectors": {"h": {"history": "deep", "to": "r1"}}},
        "away": {"on": {"back": "h"}},
    }  # fmt: skip
    run = Run(chart(states))
    for event in ("next", "out", "back"):
        run.send(event) if run.machine.state.root else (run.start(), run.send(event))
    assert run.active == ["o", "r2", "s2"]


def test_entry_may_assign_branch_and_log():
    states = {"a": {"entry": [{"assign": {"x": 2}}, {"if": "(> ?x 1)", "then": [{"log": ["x is ", "?x"]}]}]}}
    run = Run(chart(states, variables={"x": "number"}))
    assert run.start().output == (Note("", "x is 2"),)


def test_a_delayed_event_leaves_the_machine_with_its_delay():
    step = Run(chart({"a": {"entry": {"emit": "e", "delay": 0.5}}})).start()
    [sent] = step.output
    assert isinstance(sent, SendLater)
    assert (sent.event.name, sent.seconds) == ("e", 0.5)


WITHDRAWN = """
    plot: p
    dialect: scxml
    variables: {made: {type: symbol, initial: none}}
    states:
      a:
        entry:
          - {emit: first, delay: 1, id: one}
          - {emit: second, delay: 2, into: made}
          - {emit: third, delay: 3, id: one}
          - {emit: last, delay: 4}
        on:
          not_one: {do: [{withdraw: one}]}
          not_made: {do: [{withdraw: ?made}]}
          first: first
          second: second
          last: last
      first: {final: true}
      second: {final: true}
      last: {final: true}
"""


@pytest.mark.parametrize(
    ("withdrawn", "ends_at"), [((), 1), (("not_one",), 2), (("not_made",), 1), (("not_made", "not_one"), 4)]
)
def test_delayed_events_can_be_withdrawn_by_their_id(withdrawn, ends_at):
    run = DryRun([plot(WITHDRAWN)], "p")
    for event in withdrawn:
        run.send(event)
    for _ in range(5):
        if not run.finished:
            run.advance(1)
    assert run.finished
    assert run.now == ends_at
    assert run.steps[-1].event.name == {1: "first", 2: "second", 4: "last"}[ends_at]


def test_the_sequencer_withdraws_delayed_events():
    text = WITHDRAWN.replace("entry:", "always: {do: [{withdraw: one}], to: b}\n        entry:", 1)
    text = text.replace(
        "      first: {final", "      b: {on: {first: first, second: second, last: last}}\n      first: {final", 1
    )
    ran = Ran(text)
    assert ran.end.finished
    assert ran.at == 2.0


def test_an_event_is_only_withdrawn_in_the_plot_that_sent_it():
    outer = "{plot: p, dialect: scxml, states: {a: {entry: {emit: e, delay: 1, id: x}, use: q, on: {e: f}}, f: {final: true}}}"
    run = DryRun([plot(outer), plot("{plot: q, dialect: scxml, states: {b: {entry: {withdraw: x}}}}")], "p")
    run.advance(1)
    assert run.finished


def test_an_event_without_delay_has_no_id():
    with pytest.raises(InputError, match="cannot be withdrawn"):
        plot("{plot: p, dialect: scxml, states: {a: {entry: {emit: e, id: x}}}}")


def test_completion_is_an_event_that_anybody_may_take():
    states = {"a": {"states": {"f": {"final": True}}}, "b": {}}
    run = Run(chart({"outer": {"on": {"done.state.a": "b"}, "states": {"a": states["a"]}}, "b": {}}))
    run.start()
    assert run.active == ["b"]


NESTED = """
    plot: p
    dialect: scxml
    states:
      outer:
        on: {done.state.outer: over}
        regions:
          inner:
            states:
              inner:
                regions:
                  a: {states: {a: {states: {a1: {on: {a: a2}}, a2: {final: true}}}}}
                  b: {states: {b: {states: {b1: {on: {b: b2}}, b2: {final: true}}}}}
          c: {states: {c: {states: {c1: {on: {c: c2}}, c2: {final: true}}}}}
      over: {}
"""


@pytest.mark.parametrize("order", [*permutations("abc")], ids="".join)
def test_a_parallel_in_a_parallel_counts_as_complete_whichever_part_of_it_is_the_last(order):
    run = Run(plot(NESTED))
    run.start()
    for event in order[:-1]:
        run.send(event)
        assert "over" not in run.active
    step = run.send(order[-1])
    assert run.active == ["over"]
    done = {"c": ["done.state.c", "done.state.outer"]}
    inner = [f"done.state.{order[-1]}", "done.state.inner", "done.state.outer"]
    assert step.entered("over")
    assert len(step.microsteps) == 2
    assert step.microsteps[-1].event.name == done.get(order[-1], inner)[-1]


def test_completions_of_parallels_in_each_other_come_from_the_inside_out():
    heard = "{done.state: {do: [{log: [heard]}]}, done.state.outer: over}"
    text = NESTED.replace("{done.state.outer: over}", heard).replace(
        "regions:\n          inner", "entry: {emit: a}\n        regions:\n          inner"
    )
    run = Run(plot(text))
    run.start()
    assert [one.event.name for one in run.send("b").microsteps[1:]] == ["done.state.b", "done.state.inner"]
    assert [one.event.name for one in run.send("c").microsteps[1:]] == ["done.state.c", "done.state.outer"]


def test_a_branch_that_cannot_be_decided_is_not_taken_and_its_block_goes_on():
    branch = {
        "if": "(> ?event.n 1)",
        "then": [{"log": ["then"]}],
        "else": [{"if": "(= ?x 0)", "then": [{"log": ["else"]}]}],
    }
    states = {"a": {"on": {"e": {"do": [branch, {"log": ["after"]}]}, "error.execution": {"do": [{"log": ["error"]}]}}}}
    run = Run(chart(states, variables={"x": {"type": "number", "initial": 0}}))
    run.start()
    assert run.send("e").output == (Note("", "else"), Note("", "after"), Note("", "error"))


def test_an_error_ends_its_own_block_and_no_other():
    failing = {"assign": {"x": "?event.n"}}
    blocks = [{"block": [{"log": [1]}, failing, {"log": [2]}]}, {"block": [{"log": [3]}]}]
    states = {"a": {"entry": blocks, "exit": blocks, "on": {"e": {"to": "b", "do": [failing, {"log": [4]}]}}}, "b": {}}
    run = Run(chart({**states, "b": {"on": {"error": {"do": [{"log": ["error"]}]}}}}, variables={"x": "number"}))
    run.start()
    assert run.send("e").output == (*(Note("", text) for text in ("1", "3", "error", "error")),)


def test_an_error_that_nobody_takes_is_noted_and_the_run_goes_on():
    states = {"a": {"entry": {"assign": {"x": "?event.n"}}, "on": {"e": "f"}}, "f": {"final": True}}
    run = DryRun([chart(states, variables={"x": "number"})], "c")
    [step] = run.steps
    assert step.errors == ()
    assert [note.label for note in step.output] == ["error.execution"]
    assert "?event.n" in step.output[0].text
    run.send("e")
    assert run.finished


def test_the_sequencer_goes_on_after_an_error_of_an_scxml_chart():
    ran = Ran("""
    plot: p
    dialect: scxml
    variables: {x: number}
    states:
      a: {entry: [{block: [{emit: error}, {assign: {x: ?event.n}}]}, {emit: e, delay: 1}], on: {e: f}}
      f: {final: true}
    """)
    assert ran.end.finished
    assert ran.at == 1.0


def test_a_guard_that_fails_is_an_error_for_each_event():
    on = {"e": {"to": "b", "when": "(> ?event.n 1)"}, "error.execution": {"assign": {"x": "(+ ?x 1)"}}}
    states = {"a": {"entry": [{"emit": "e"}, {"emit": "e"}], "on": on}, "b": {}}
    run = Run(chart(states, variables={"x": {"type": "number", "initial": 0}}))
    run.start()
    assert run.active == ["a"]
    assert run.variables() == {"x": 2}


def test_a_guard_that_fails_for_its_own_error_does_not_go_round():
    run = Run(chart({"a": {"entry": {"emit": "e"}, "on": {"*": {"to": "b", "when": "(> ?event.m 1)"}}}, "b": {}}))
    assert [note.label for note in run.start().output] == ["error.execution"]


def test_guards_may_ask_which_states_are_active():
    regions = {"r": {"states": {"r1": {"on": {"go": {"to": "r2", "when": "(in-state s2)"}}}, "r2": {}}},
               "s": {"states": {"s1": {"on": {"next": "s2"}}, "s2": {}}}}  # fmt: skip
    run = Run(chart({"o": {"regions": regions}}))
    run.start()
    run.send("go")
    assert run.active == ["o", "r1", "s1"]
    run.send("next")
    run.send("go")
    assert run.active == ["o", "r2", "s2"]


@pytest.mark.parametrize(
    ("descriptors", "event", "matched"),
    [
        ("a", "a", True),
        ("a", "a.b", True),
        ("a", "ab", False),
        ("a.*", "a.b", True),
        ("b *", "a", True),
        ("a.b", "a", False),
    ],
)
def test_events_match_by_prefix(descriptors, event, matched):
    assert matches(descriptors, event) is matched


FOREIGN = [
    "a: {entry: {emit: e}, on: {e: b}}",
    "a: {on: {e: {to: b, internal: true}}}",
    "a: {on: {e: {to: b, do: [{log: [x]}]}}}",
    "a: {on: {e: {to: b, do: [{emit: f, delay: 1}]}}}",
    "a: {states: {h: {history: deep, to: c}, c: {}}, on: {e: b}}",
    "a: {on_break: {emit: e}, on: {e: b}}",
    "a: {on: {e: {to: b, do: [{block: [{emit: e}]}]}}}",
]


@pytest.mark.parametrize("state", FOREIGN)
def test_the_dsc_dialect_refuses_what_only_scxml_has(state):
    text = f"plot: p\nPROFILEstates:\n  {state}\n  b: {{final: true}}\nreceives: {{e: {{}}}}\n"
    refused = plot(text.replace("PROFILE", ""), "p.yaml")
    found = validate_plot(refused, Library([refused]))
    assert found[0].code == "dialect"
    assert "p.yaml:3" in str(found[0])
    admitted = plot(text.replace("PROFILE", "dialect: scxml\n"))
    assert validate_plot(admitted, Library([admitted])) == []


def test_histories_are_cleared_where_there_are_histories():
    text = "plot: p\nPROFILEstates:\n  a:\n    on: {e: {to: b, clear: a}}\n    states: {h: {history: deep, to: c}, c: {}}\n  b: {}\n"
    refused = plot(text.replace("PROFILE", ""), "p.yaml")
    assert any("p.yaml:4" in str(one) and "clears histories" in str(one) for one in validate_plot(refused, Library()))
    admitted = plot(text.replace("PROFILE", "dialect: scxml\n"))
    assert validate_plot(admitted, Library()) == []


@pytest.mark.parametrize(
    ("states", "message"),
    [
        ("p: {states: {x: {}, h: {history: deep, to: g}, g: {history: deep, to: h}}}", "does not lead to a state"),
        ("a: {on: {e: {to: b, also: [c]}}}\n  b: {}\n  c: {}", "exclude each other"),
        ("a: {on: {e: {to: b, also: [c]}}}\n  b: {states: {c: {}}}", "exclude each other"),
    ],
)
def test_targets_that_make_no_configuration_are_found(states, message):
    broken = plot(f"plot: p\ndialect: scxml\nstates:\n  {states}\n", "p.yaml")
    found = [str(finding) for finding in validate_plot(broken, Library([broken]))]
    assert any(message in one and one.startswith("p.yaml:4") for one in found)


def test_the_sequencer_delivers_delayed_events_and_writes_notes():
    lines = []

    async def played():
        clock = LoopClock()
        trace = Trace(clock.now)
        trace.listen(lambda record: lines.append(record.to_line()))
        sent = chart(
            {"a": {"entry": [{"log": ["hi"]}, {"emit": "t", "delay": 2}], "on": {"t": "f"}}, "f": {"final": True}}
        )
        knowledge = KnowledgeBase(Schema.parse("(define (domain none))"))
        end = await Sequencer(Library([sent]), knowledge, [], clock, trace).run("c")
        return end.finished, clock.now()

    loop = SimulatedEventLoop()
    try:
        assert loop.run_until_complete(played()) == (True, 2.0)
    finally:
        loop.close()
    assert [json.loads(line)["text"] for line in lines if json.loads(line)["type"] == "log"] == ["hi"]


def test_steps_on_events_of_any_name_do_not_pile_up(monkeypatch):
    monkeypatch.setattr("dsc.engine.idle_state.MOST_TRIGGERS", 8)
    run = Run(chart({"a": {"on": {"*": "b"}}, "b": {"on": {"*": "a"}}}))
    run.start()
    kept = 0
    for number in range(100):
        event = Event(f"e{number}")
        for _ in range(4):  # the first two compute the choices, the others keep steps
            run.machine.send(event, run.situation())
        assert isinstance(run.machine.state, IdleState)
        kept = max(kept, len(run.machine.state.steps))
    assert kept == 8
    assert run.machine.send(Event("e100"), run.situation()).microsteps[0].entered == ("b",)
