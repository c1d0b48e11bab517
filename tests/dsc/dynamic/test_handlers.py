"""Event handlers: something is done about an event that may come at any time, and what went on goes on (S1.14)."""

from __future__ import annotations

import pytest
from dsc_charts import Run, plot

from dsc import Component, Outcome, Sequencer, event, skill, validate_plot
from dsc.drawing import draw
from dsc.dynamic.library import Library
from dsc.engine.steps import SetParameter
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.testing.coverage import Coverage
from dsc.text.plot_files import parse_plot, plot_to_yaml
from knowledge_base import KnowledgeBase
from knowledge_base.facts import Fact
from knowledge_base.world.schema import Schema

SAY = """
    plot: say
    parameters: {text: {type: text, default: hm}, level: {type: number, default: 0}, loud: {type: boolean, default: false}}
    emits: {unheard: }
    states:
      saying: {entry: [{set: voice.says, to: ?text}, {set: voice.level, to: ?level}], on: {said: over, deaf: {to: over, emit: unheard}}}
      over: {final: true}
"""
STEP = """
    plot: step
    emits: {failed: }
    states: {work: {on: {ok: over, bad: {to: over, emit: failed}}}, over: {final: true}}
"""
HOLDER = """
    plot: p
    parameters: {who: {type: text, default: Ann}}
    receives: {low: {level: number}, go: }
    emits: {good: {who: text}, poor: }
    states:
      one: {use: step, on: {done: two, failed: {to: ended, emit: poor}}}
      two: {states: {a: {on: {go: b}}, b: {on: {go: c}}, c: {final: true}}, on: {done: ended_well}}
      ended: {final: true}
      ended_well: {final: true, emit: good, with: {who: ?who}}
    handlers:
"""


def plots_of(*handlers, text=HOLDER):
    return [plot(text + "".join(f"      - {handler}\n" for handler in handlers)), plot(SAY), plot(STEP)]


def run_of(*handlers, text=HOLDER, facts=()):
    run = Run(*plots_of(*handlers, text=text), facts=facts)
    run.start()
    return run


def innermost(run):
    return [path for path in run.active if not any(other.startswith(path + "/") for other in run.active)]


BESIDE = "{on: low, do: {tell: (low), use: say, on: {unheard: resume}, with: {level: ?event.level}}}"
INTERRUPT = (
    "{on: low, interrupt: true, do: {tell: (low), use: say, on: {unheard: resume}, with: {level: ?event.level}}}"
)


# -- beside ------------------------------------------------------------------------------------------------


def test_a_handler_runs_a_plot_beside_what_goes_on():
    run = run_of(BESIDE)
    before = run.serial("one")
    step = run.send("low", level=7)
    assert SetParameter("voice", "level", 7) in step.output
    assert step.knowledge.added == (Fact("low"),)
    assert run.machine.state.is_active("saying")
    assert run.serial("one") == before
    run.send("ok")
    assert {"a", "saying"} <= {path.split("/")[-1] for path in run.active}
    run.send("deaf")
    assert not run.machine.state.is_active("saying")
    run.send("low", level=5)
    assert run.machine.state.is_active("saying")


def test_a_handler_may_only_tell_something():
    run = run_of("{on: low, when: (< ?event.level 5), do: {tell: (low)}}")
    assert run.send("low", level=7).knowledge.added == ()
    assert run.send("low", level=3).knowledge.added == (Fact("low"),)
    assert run.machine.state.is_active("work")


def test_the_first_handler_whose_condition_holds_answers():
    run = run_of("{on: low, when: (p), do: {tell: (first)}}", "{on: low, do: {tell: (second)}}")
    assert run.send("low", level=1).knowledge.added == (Fact("second"),)
    run.facts.add(Fact("p"))
    assert run.send("low", level=1).knowledge.added == (Fact("first"),)


def test_the_plot_ends_as_it_would_whatever_its_handlers_do():
    for busy in (False, True):
        run = run_of(BESIDE)
        if busy:
            run.send("low", level=1)
        run.send("ok")
        run.send("go")
        step = run.send("go")
        assert run.machine.state.finished
        assert [(e.name, dict(e.attributes)) for e in step.emitted] == [("good", {"who": "Ann"})]
        run = run_of(BESIDE)
        assert [e.name for e in run.send("bad").emitted] == ["poor"]
        assert run.machine.state.finished


# -- interrupting ------------------------------------------------------------------------------------------


def test_an_interrupting_handler_leaves_what_goes_on_and_comes_back_to_it():
    run = run_of(INTERRUPT)
    before = run.serial("one")
    step = run.send("low", level=7)
    assert SetParameter("voice", "level", 7) in step.output
    assert [path.split("/")[-1] for path in run.active][-1] == "saying"
    assert not run.machine.state.is_active("work")
    run.send("deaf")
    assert run.active == ["one", "one/work"]
    assert run.serial("one") > before
    run.send("ok")
    run.send("go")
    run.send("low", level=6)
    run.send("said")
    assert innermost(run) == ["b"] or run.active == ["two", "b"]


def test_a_states_own_way_comes_before_an_interruption():
    text = HOLDER.replace("on: {done: two,", "on: {low: two, done: two,")
    run = run_of(INTERRUPT, text=text)
    run.send("low", level=1)
    assert run.machine.state.is_active("a")


def test_a_recovery_is_interrupted_too_and_keeps_its_arguments():
    text = """
    plot: p
    receives: {low: {level: number}}
    states:
      one: {use: fetch, on: {done: ended}}
      ended: {final: true}
    rules: [{on: lost, do: {use: say, with: {text: ?event.what}, then: retry}}]
    handlers:
      - {on: low, interrupt: true, do: {use: step}}
"""
    fetch = "plot: fetch\nemits: {lost: {what: text}}\nstates: {f: {on: {bad: {to: e, emit: lost, with: {what: keys}}}}, e: {final: true}}"
    run = Run(plot(text), plot(fetch), plot(SAY), plot(STEP))
    run.start()
    run.send("bad")
    run.send("low", level=1)
    assert run.machine.state.is_active("work")
    assert SetParameter("voice", "says", "keys") in run.send("ok").output


def test_coming_back_leads_through_what_is_inserted_before_a_step():
    text = HOLDER.replace("    handlers:", "    rules: [{before: one, when: (p), do: {use: say}}]\n    handlers:")
    run = run_of("{on: low, interrupt: true, do: {use: say, on: {unheard: resume}}}", text=text)
    run.send("low", level=1)
    run.facts.add(Fact("p"))
    step = run.send("said")
    assert step.entered("saying")
    run.send("said")
    assert run.active == ["one", "one/work"]


# -- outcomes of the handlers' plots -----------------------------------------------------------------------


@pytest.mark.parametrize("handler", [BESIDE, INTERRUPT])
def test_an_outcome_of_a_handlers_plot_leads_to_the_named_state(handler):
    for deep in (False, True):
        run = run_of(handler.replace("unheard: resume", "unheard: ended_well"))
        run.send("ok" if deep else "other")
        run.send("low", level=7)
        step = run.send("deaf")
        assert [each.name for each in step.emitted] == ["good"]
        assert run.machine.state.finished
        assert not any(map(step.entered, ("one", "two", "a", "b", "work")))  # what was interrupted stays so


@pytest.mark.parametrize("handler", [BESIDE, INTERRUPT])
def test_an_outcome_of_a_handlers_plot_leads_through_what_is_inserted_before_the_named_state(handler):
    text = HOLDER.replace(
        "    handlers:", "    rules: [{before: one, when: (p), do: {use: step, then: two}}]\n    handlers:"
    )
    run = run_of(handler.replace("unheard: resume", "unheard: one"), text=text)
    run.send("low", level=7)
    run.facts.add(Fact("p"))
    run.send("deaf")
    run.send("ok")
    assert run.machine.state.is_active("two")


@pytest.mark.parametrize("handler", [BESIDE, INTERRUPT])
def test_an_outcome_of_a_handlers_plot_that_nothing_handles_is_an_error(handler):
    unhandled = handler.replace(", on: {unheard: resume}", "")
    run = run_of(unhandled)
    run.send("low", level=7)
    (error,) = run.send("deaf").errors
    assert "does not handle 'unheard' of plot 'say'" in error
    (finding,) = findings_of(unhandled)
    assert "nothing handles the outcome 'unheard' of plot 'say'" in finding
    assert "add `on: {unheard: resume}` here" in finding


# -- events of components ----------------------------------------------------------------------------------


class Low(Outcome):
    level: float


class Empty(Outcome): ...


class Said(Outcome): ...


class Battery(Component):
    name = "battery"
    level = 30.0

    @event
    def low(self, level, below=20.0) -> Low | None:
        return Low(level=level) if level < below else None

    @skill
    async def drain(self, call) -> Empty:
        while self.level > 0:
            await call.clock.sleep(1.0)
            self.level -= 10
            self.update("low", self.level)
        return Empty()


class Voice(Component):
    name = "voice"

    def __init__(self):
        super().__init__()
        self.said = []

    @skill
    async def say(self, call, text) -> Said:
        await call.clock.sleep(0.1)
        self.said.append(text)
        return Said()


WATCH = """
    plot: watch
    states:
      work: {entry: {trigger: battery.drain}, on: {empty: over}}
      over: {final: true}
    handlers:
      - on: weak
        listen: {trigger: battery.low, with: {below: 25}, as: {low: weak}}
        INTERRUPT
        do: {use: warn, with: {level: ?event.level}}
"""
WARN = """
    plot: warn
    parameters: {level: number}
    states:
      say: {entry: {trigger: voice.say, with: {text: ?level}}, on: {said: over}}
      over: {final: true}
"""


@pytest.mark.parametrize(("interrupt", "warned"), [("", [20.0]), ("        interrupt: true\n", [20.0])])
def test_a_handler_listens_to_a_component_as_long_as_the_plot_is_active(interrupt, warned):
    """The event comes once, when its condition begins to hold: coming back to what went on is no new beginning."""

    async def main():
        battery, voice = Battery(), Voice()
        library = Library([plot(WATCH.replace("        INTERRUPT\n", interrupt)), plot(WARN)])
        sequencer = Sequencer(library, KnowledgeBase(Schema()), [battery, voice], LoopClock())
        return await sequencer.run("watch"), voice.said

    end, said = run_simulated(main())
    assert end.finished
    assert said == warned
    assert end.problem is None


# -- what is checked, drawn and counted --------------------------------------------------------------------


def findings_of(*handlers, text=HOLDER, skills=None):
    made = plots_of(*handlers, text=text)
    return [str(finding) for finding in validate_plot(made[0], Library(made), skills=skills)]


@pytest.mark.parametrize("handler", [BESIDE, INTERRUPT, "{on: low, do: {tell: (low)}}"])
def test_a_right_handler_has_no_findings(handler):
    assert findings_of(handler) == []


@pytest.mark.parametrize(
    ("handler", "message"),
    [
        ("{on: lwo, do: {use: say, on: {unheard: resume}}}", "nothing here fires the event 'lwo'"),
        ("{on: low, do: {use: sya}}", "there is no plot 'sya'"),
        ("{on: low, do: {use: say, on: {unheard: resume}, with: {txt: a}}}", "has no parameter 'txt'"),
        ("{on: low, do: {use: say, on: {unheard: resume}, with: {text: ?event.lvel}}}", "no variable '?event.lvel'"),
        ("{on: low, when: (< ?event.lvel 3), do: {use: say, on: {unheard: resume}}}", "event.lvel"),
        (
            "{on: low, do: {use: say, on: {unheard: resume}, with: {text: ?event.level}}}",
            "'text' is of type text, and ?event.level is of type number",
        ),
        (
            "{on: low, do: {use: say, on: {unheard: resume}, with: {text: a, loud: 3}}}",
            "'loud' is of type boolean, and 3 is of type number",
        ),
        (
            "{on: low, do: {use: say, on: {unheard: resume, unherd: resume}}}",
            "no outcome 'unherd'; did you mean 'unheard'",
        ),
        ("{on: low, do: {use: say, on: {unheard: resum}}}", "cannot 'resum' after its plot; did you mean 'resume'"),
        ("{on: low, do: {use: say, on: {unheard: a}}}", "cannot 'a' after its plot"),
        ("{on: poor, do: {use: say, on: {unheard: resume}}}", "nothing here fires the event 'poor'"),
        ("{on: low, interrupt: true, do: {tell: (p)}}", "interrupts nothing"),
        (
            "{on: low, listen: {trigger: battery.lo}, do: {use: say, on: {unheard: resume}}}",
            "no component offers the skill or event 'battery.lo'",
        ),
        (
            "{on: weak, listen: {trigger: battery.low}, do: {use: say, on: {unheard: resume}}}",
            "does not bring the event 'weak'",
        ),
    ],
)
def test_a_wrong_handler_is_one_finding(handler, message):
    skills = list(Battery().skills().values())
    (finding,) = findings_of(handler, skills=skills)
    assert message in finding


def test_states_that_nothing_leads_to_are_found_beside_handlers():
    text = HOLDER.replace("on: {done: two,", "on: {done: ended,")
    (finding,) = [one for one in findings_of(BESIDE, text=text) if "ended_well" not in one]
    assert "nothing leads to the state 'two'" in finding


def test_handlers_are_written_drawn_and_counted():
    made = plots_of(BESIDE, INTERRUPT)
    assert parse_plot(plot_to_yaml(made[0])) == made[0]
    library = Library(made)
    assert "low_awaited" in draw(made[0], library)
    assert "low" in draw(made[0], library, rules=False)
    run = Run(*plots_of(BESIDE))
    coverage = Coverage(run.library, ["p"])
    coverage.add(run.start())
    assert "handler low: say" in coverage.report()
    coverage.add(run.send("low", level=3))
    assert coverage.count("p", "rule") == (1, 1)


def test_names_that_handlers_add_have_words_for_people():
    interrupting = "{on: low, interrupt: true, do: {use: say, on: {unheard: two}}}"
    first, *others = plots_of("{on: go, name: greet, do: {use: say, on: {unheard: resume}}}", interrupting)
    words = Library([first, *others]).expanded(first).words
    assert {words.states[name] for name in ("one_low_handled", "a_low_handled")} == {"handles low"}
    assert words.states["go_handled"] == "greet"
    assert words.states["go_awaited"] == "waits for go"
    assert words.states["active"] == "p and its handlers"
    assert (words.states["active:plot"], words.states["active:on_go"]) == ("plot", "on go")
    assert words.states["ended_well_reached"] == words.events["ended_well_reached"] == "ended_well"
    assert words.states["a_low_handled_then_two"] == words.events["then_two"] == "then two"


def test_every_added_state_has_words():
    listening = "{on: heard, listen: {trigger: ear.noise, as: {noise: heard}}, do: {tell: (low)}}"
    for plots in (plots_of(BESIDE), plots_of(INTERRUPT), plots_of(BESIDE, listening)):
        expanded = Library(plots).expanded(plots[0])
        written = {name for name, _, _ in plots[0].walk()}
        assert {name for name, _, _ in expanded.walk()} - written <= expanded.words.states.keys()
