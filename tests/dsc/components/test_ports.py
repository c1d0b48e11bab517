"""Events, queries and messages of components, as charts use them."""

from __future__ import annotations

import asyncio

import pytest
from dsc_charts import plot
from dsc_runs import Ran

from dsc.components.component import Component
from dsc.components.ports import event, query, takes
from dsc.dynamic.library import Library
from dsc.outcomes import Outcome
from dsc.sequencer.clock import run_simulated
from dsc.skills import skill
from dsc.validation import validate_plot
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.world.schema import Schema


class Low(Outcome):
    level: float


class Lasts(Outcome):
    seconds: float


class Ponders(Outcome):
    seconds: float


class RunRan(Outcome, event="ran"): ...


class Battery(Component):
    """Discharges by one percent a second while somebody has it `run`."""

    name = "battery"

    def __init__(self):
        super().__init__()
        self.level = 30.0
        self.told = []

    @event
    def low(self, level: float, below: float = 20.0) -> Low | None:
        return Low(level=level) if level < below else None

    @query
    async def lasts(self, until: float = 0.0) -> Lasts:
        return Lasts(seconds=self.level - until)

    @query
    async def ponders(self) -> Ponders:  # type: ignore[return]
        await asyncio.sleep(1e6)

    @takes
    async def label(self, text, size: int = 1):
        if text == "unprintable":
            raise RuntimeError("no ink")
        self.told.append((text, size))

    @skill
    async def run(self, call, levels=(25, 15, 14, 40, 10)) -> RunRan:
        for level in levels:
            await call.clock.sleep(1)
            self.update("low", level)
        return RunRan()


def ran(text, battery=None, **more):
    return Ran(text, arm=battery or Battery(), **more)


LOW = """
    plot: p
    variables: {n: {type: number, initial: 0}}
    emits: {counted: {n: number}}
    states:
      a:
        entry: [{trigger: battery.low, with: {below: BELOW}, as: {low: low_bat}}, {trigger: battery.run}]
        on:
          low_bat: {assign: {n: (+ ?n 1)}}
          ran: {to: e, emit: counted, with: {n: ?n}}
      e: {final: true}
"""


@pytest.mark.parametrize(("below", "times"), [(20, 2), (5, 0), (100, 1), (14.5, 2)])
def test_an_event_comes_each_time_its_test_begins_to_hold(below, times):
    end = ran(LOW.replace("BELOW", str(below))).end
    assert end.emitted[0].attributes == {"n": times}


def test_an_event_ends_with_the_state_that_activated_it():
    done = ran("""
        plot: p
        states:
          a: {entry: {trigger: battery.low}, after: {seconds: 1, to: b}, on: {low: wrong}}
          b: {entry: {trigger: battery.run}, on: {ran: e}}
          wrong: {final: true}
          e: {final: true}
    """)
    assert done.end.finished
    assert [one["name"] for one in done.of_type("event")] == ["after", "ran"]


def test_an_event_in_the_states_inside_the_one_that_activated_it():
    done = ran("""
        plot: p
        states:
          work:
            entry: {trigger: battery.low}
            regions:
              drain: {states: {use: {entry: {trigger: battery.run}, on: {low: saved}}, saved: {final: true}}}
            on: {done: e}
          e: {final: true}
    """)
    assert done.end.finished
    assert done.of_type("event")[0]["name"] == "low"


def test_a_value_said_before_counts_for_who_comes_later():
    battery = Battery()
    battery.update("low", 3.0)
    text = "{plot: p, states: {a: {entry: {trigger: battery.low, within: 5}, on: {low: e, timed_out: x}}, x: {}, e: {final: true}}}"
    assert ran(text, battery).end.finished


@pytest.mark.parametrize(("low", "why"), [("raise", "ZeroDivisionError"), ("text", "'low'"), ("number", "17")])
def test_a_test_of_an_event_that_goes_wrong_fails_the_activation_and_not_who_has_the_value(low, why):
    class Wrong(Battery):
        @event
        def low(self, level: float, below: float = 20.0) -> Low | None:
            return {"raise": lambda: 1 / 0, "text": lambda: "low", "number": lambda: 17}[low]()  # type: ignore[return-value]

    done = ran("""
        plot: p
        variables: {why: text}
        emits: {because: {why: text}}
        states:
          o:
            regions:
              r1: {states: {x: {entry: {trigger: battery.low}, on: {low: {}, programming_error: {to: y, assign: {why: ?event.reason}}}}, y: {final: true}}}
              r2: {states: {z: {entry: {trigger: battery.run}, on: {ran: e}}, e: {final: true}}}
            on: {done: {to: f, emit: because, with: {why: ?why}}}
          f: {final: true}
    """, Wrong())  # fmt: skip
    (event_,) = done.end.emitted
    assert event_.attributes["why"].startswith("battery.low: ")
    assert why in event_.attributes["why"]
    assert done.at == pytest.approx(5)


def test_an_event_may_never_come_and_does_not_keep_the_run():
    text = "{plot: p, states: {a: {entry: {trigger: battery.low}, on: {low: e}}, e: {final: true}}}"
    end = ran(text).end
    assert not end.finished
    assert "no skill, timer or event is pending" in end.problem


def test_an_event_is_waited_for_within_a_bound():
    done = ran("""
        plot: p
        states:
          a: {entry: {trigger: battery.low, within: 1000}, on: {low: wrong, timed_out: e}}
          wrong:
          e: {final: true}
    """)
    assert done.end.finished
    assert done.at == pytest.approx(1000)


def test_a_query_is_answered_in_an_event():
    done = ran("""
        plot: p
        emits: {told: {seconds: number}}
        states:
          a: {entry: {trigger: battery.lasts, with: {until: 10}}, on: {answered: {to: e, emit: told, with: {seconds: ?event.seconds}}}}
          e: {final: true}
    """)
    assert done.end.emitted[0].attributes == {"seconds": 20}


def test_a_query_has_a_timeout():
    text = "{plot: p, states: {a: {entry: {trigger: battery.ponders, within: 2}, on: {answered: x, timed_out: e}}, x: {}, e: {final: true}}}"
    done = ran(text)
    assert done.end.finished
    assert done.at == pytest.approx(2)


SAY = """
    plot: p
    states:
      a: {entry: [{send: battery.label, with: {text: TEXT}}, {send: battery.label, with: {text: two, size: 2}}], after: {seconds: 1, to: e}}
      e: {final: true}
"""


def test_messages_are_taken_in_order_and_traced():
    done = ran(SAY.replace("TEXT", "one"))
    assert done.end.problem is None
    assert done.arm.told == [("one", 1), ("two", 2)]
    sent = [one for one in done.of_type("action") if one["action"] == "send"]
    assert sent[0] == {"action": "send", "port": "battery.label", "arguments": {"text": "one"}}


def test_a_message_that_cannot_be_taken_is_told():
    end = ran(SAY.replace("TEXT", "unprintable")).end
    assert not end.finished
    assert "no ink" in end.problem


def test_a_component_refuses_unknown_names_and_missing_parameters():
    battery = Battery()
    with pytest.raises(UnknownNameError, match="did you mean 'label'"):
        asyncio.run(battery.receive("labl", {}))
    with pytest.raises(InputError, match="needs its parameter 'text'"):
        asyncio.run(battery.receive("label", {}))
    with pytest.raises(UnknownNameError, match="did you mean 'low'"):
        battery.update("lov", 1)


def test_ports_are_checked_before_the_run():
    battery = Battery()

    def findings(entry, on="low_bat: {}"):
        text = f"{{plot: p, states: {{a: {{entry: {entry}, on: {{{on}}}, after: {{seconds: 1, to: e}}}}, e: {{final: true}}}}}}"
        parsed = plot(text)
        return [str(f) for f in validate_plot(parsed, Library([parsed]), None, battery.skills().values(), {"battery"})]

    assert findings("{trigger: battery.low, with: {below: 10}, as: {low: low_bat}}") == []
    (below,) = findings("{trigger: battery.low, with: {belo: 10}, as: {low: low_bat}}")
    assert "did you mean 'below'" in below
    assert any("outcome 'low_bat'" in one or "'low_bat'" in one for one in findings("{send: battery.label}"))
    (unknown,) = findings("[{send: batery.label}, {trigger: battery.lasts}]", "answered: e")
    assert "did you mean 'battery'" in unknown


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("{send: battery.labl}", "did you mean 'label'"),
        ("{send: battery.label}", "message 'battery.label' needs its parameter 'text'"),
        ("{send: battery.label, with: {text: a, sise: 2}}", "did you mean 'size'"),
        ("{send: battery.calibrate, with: {full: high}}", "'full' is of type number, and high is of type text"),
        ("{send: battery.calibrate, with: {full: (geometry 1 2)}}", "(geometry 1 2) is of type geometry"),
        ("{send: battery.calibrate, with: {full: 2}}", None),
        ("{switch: battery, to: restng}", "did you mean 'resting'"),
        ("{switch: battery, to: init}", None),
        ("{switch: battery, to: neutral}", None),
    ],
)
def test_messages_and_modes_are_checked_before_the_run(entry, said):
    class Careful(Battery):
        modes = ("resting",)

        @takes
        async def calibrate(self, full: float): ...

    made = plot(f"{{plot: p, states: {{a: {{entry: {entry}, after: {{seconds: 1, to: e}}}}, e: {{final: true}}}}}}")
    battery = Careful()
    found = validate_plot(made, Library([made]), Schema(), battery.skills().values(), {"battery": battery.interface()})
    assert [one for one in map(str, found) if said is None or said not in one] == []
    assert len(found) == (said is not None)


def test_a_component_says_how_it_is():
    battery = Battery()
    said = asyncio.run(battery.diagnose())
    assert said["life"] == "init"
    assert said["skills"] == ["lasts", "low", "ponders", "run"]


def test_the_sequencer_says_how_the_run_is_going():
    said = []

    def prepare(sequencer):
        async def ask():
            said.append(sequencer.diagnose())

        said.append(sequencer.diagnose())
        sequencer.wait_before_events(ask)

    done = ran(LOW.replace("BELOW", "20"), prepare=prepare)
    assert said[0]["active"] == []
    assert said[1]["active"] == ["a"]
    assert said[1]["working"] == ["battery.low", "battery.run"]
    assert said[1]["in_use"] == ["battery"]
    assert done.sequencer.diagnose()["finished"]


class Heavy(Outcome): ...


class Scale(Component):
    name = "scale"

    def __init__(self):
        super().__init__()
        self.heard = []

    @event
    def heavy(self, grams: float, things: list[str], above: float = 10.0) -> Heavy | None:
        return Heavy() if grams > above and things else None

    @takes
    async def show(self, text: str, lines: list[int]):
        self.heard.append((text, lines))


def test_a_port_whose_method_has_the_wrong_form_is_refused_at_its_declaration():
    with pytest.raises(SchemaError, match=r"query 'Slow\.lasts' is not a coroutine: write `async def`") as refused:

        class Slow:
            @query  # type: ignore[type-var]
            def lasts(self) -> Lasts: ...  # type: ignore[empty-body]

    assert str(refused.value.place).startswith(__file__)
    with pytest.raises(SchemaError, match=r"'Slow\.show' with `@takes` is not a coroutine: write `async def`"):

        class Slow:  # type: ignore[no-redef]
            @takes
            def show(self, text: str) -> None: ...

    with pytest.raises(SchemaError, match=r"event 'Slow\.low' is a coroutine, and its test is a plain function"):

        class Slow:  # type: ignore[no-redef]
            @event  # type: ignore[type-var]
            async def low(self, level: float) -> Low | None: ...


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (("much", []), "the value 'grams' of event 'scale.heavy' is a finite number, not 'much'"),
        ((1.0, [3]), "the value 'things' of event 'scale.heavy' at 0 is text, not 3"),
        ((1.0,), "event 'scale.heavy' has the values (grams, things); found 1"),
    ],
)
def test_updated_values_have_the_types_of_the_test(values, said):
    with pytest.raises(InputError) as refused:
        Scale().update("heavy", *values)
    assert said in str(refused.value)


def test_the_parts_of_a_message_have_their_types():
    async def main():
        scale = Scale()
        await scale.receive("show", {"text": "hi", "lines": [1, 2]})
        with pytest.raises(InputError, match=r"the part 'lines' of the message scale.show at 1 is an integer, not 'x'"):
            await scale.receive("show", {"text": "hi", "lines": [1, "x"]})
        return scale.heard

    assert run_simulated(main()) == [("hi", [1, 2])]
