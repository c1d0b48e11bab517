"""Each failed `set`, `switch` and `send` is an event of the state that sent it, of all plots, or in the end (S0.20)."""

from __future__ import annotations

import asyncio
import re

import pytest
from dsc_charts import plot
from dsc_runs import Ran, ran

from dsc import Component, Library, LoopClock, Outcome, Sequencer, SkillCall, skill, takes, validate_plot
from dsc.components.life_cycle import Life
from dsc.sequencer.clock import run_simulated
from knowledge_base import KnowledgeBase, Schema


class Gone(Outcome): ...


class Drive(Component):
    """A drive whose hooks fail with the value 99, the mode `bad` and the text `bad`, after `seconds`."""

    name = "drive"
    device_errors = (OSError,)

    def __init__(self, name="drive", seconds=0.0):
        super().__init__(name)
        self.seconds = seconds
        self.log = []

    async def take(self, what, bad):
        await asyncio.sleep(self.seconds)
        self.log.append(what)
        if bad:
            raise OSError(f"cannot take {what}")

    async def configure(self, parameter, value):
        await self.take(f"{parameter} {value}", value == 99)
        await super().configure(parameter, value)

    async def switch(self, mode):
        await self.take(mode, mode == "bad")
        await super().switch(mode)

    @takes
    async def say(self, text: str):
        await self.take(text, text == "bad")

    @skill
    async def go(self, call: SkillCall) -> Gone:
        self.log.append("go")
        return Gone()


COMMANDS = {
    "{set: drive.speed, to: 99}": ("drive.speed", "set drive.speed: OSError: cannot take speed 99"),
    "{switch: drive, to: bad}": ("drive.switch", "switch drive to 'bad': OSError: cannot take bad"),
    "{send: drive.say, with: {text: bad}}": ("drive.say", "send drive.say: OSError: cannot take bad"),
}
ASKED = """
    plot: p
    emits: {heard: {by: text, skill: text, why: text}}
    states:
      a:
        entry: [COMMAND]
        on:
          skill_error: {to: e, emit: heard, with: {by: '"a"', skill: ?event.skill, why: ?event.reason}}
        after: {seconds: 50, to: e}
      e: {final: true}
"""


@pytest.mark.parametrize("seconds", [0, 3])
@pytest.mark.parametrize("command", COMMANDS)
def test_a_failed_command_is_an_event_of_the_state_that_sent_it(command, seconds):
    end, at = ran(ASKED.replace("COMMAND", command), Drive(seconds=seconds))
    skill_name, why = COMMANDS[command]
    assert (end.finished, at) == (True, seconds)
    assert [one.attributes for one in end.emitted] == [{"by": "a", "skill": skill_name, "why": why}]


@pytest.mark.parametrize("command", COMMANDS)
def test_a_state_without_anything_else_to_wait_for_hears_it(command):
    text = ASKED.replace("COMMAND", command).replace("after: {seconds: 50, to: e}", "")
    end, at = ran(text, Drive(seconds=3))
    assert (end.finished, at) == (True, 3)


@pytest.mark.parametrize("command", COMMANDS)
def test_an_unhandled_failure_ends_the_run_with_its_reason(command):
    text = "{plot: p, states: {a: {entry: [COMMAND], after: {seconds: 50, to: e}}, e: {final: true}}}"
    end, at = ran(text.replace("COMMAND", command), Drive())
    assert (end.finished, at) == (False, 0)
    assert (
        end.problem
        == f"no transition handles 'skill_error': {COMMANDS[command][1]}; the caller is state 'a' of plot 'p'"
    )


@pytest.mark.parametrize("command", COMMANDS)
def test_a_state_around_the_plot_hears_it(command):
    inner = "{plot: inner, states: {a: {entry: [COMMAND], after: {seconds: 9, to: e}}, e: {final: true}}}"
    outer = "{plot: p, states: {use: {use: inner, on: {done: x, skill_error: e}}, x: , e: {final: true}}}"
    assert Ran(outer, inner.replace("COMMAND", command), arm=Drive()).end.finished


@pytest.mark.parametrize("command", COMMANDS)
def test_other_states_see_no_failure_of_a_command(command):
    text = """
        plot: p
        emits: {heard: }
        states:
          both:
            regions:
              one: {states: {a: {entry: [COMMAND], on: {skill_error: ok}}, ok: {final: true}}}
              other: {states: {b: {on: {skill_error: {to: c, emit: heard}}, after: {seconds: 5, to: c}}, c: {final: true}}}
            on: {done: e}
          e: {final: true}
    """
    end, _ = ran(text.replace("COMMAND", command), Drive())
    assert (end.finished, end.emitted) == (True, ())


@pytest.mark.parametrize("command", COMMANDS)
def test_without_a_handler_for_it_all_plots_see_the_failure_of_the_component(command):
    text = (
        ASKED.replace("COMMAND", command)
        .replace("skill_error", "component_failed")
        .replace("?event.skill", "?event.component")
    )
    end, _ = ran(text, Drive())
    assert [one.attributes for one in end.emitted] == [{"by": "a", "skill": "drive", "why": COMMANDS[command][1]}]


LEFT = """
    plot: p
    emits: {heard: {why: text}}
    states:
      a: {exit: [COMMAND], after: {seconds: 1, to: b}}
      b: {HEARS after: {seconds: 20, to: e}}
      e: {final: true}
"""


@pytest.mark.parametrize("command", COMMANDS)
def test_all_plots_see_the_failure_of_a_command_whose_state_was_left(command):
    text = LEFT.replace("COMMAND", command)
    receiver = "on: {skill_error: {to: e}, component_failed: {to: e, emit: heard, with: {why: ?event.reason}}},"
    end, at = ran(text.replace("HEARS", receiver), Drive())
    assert (end.finished, at) == (True, 1)
    assert end.emitted[0].attributes["why"] == COMMANDS[command][1]
    end, at = ran(text.replace("HEARS", ""), Drive())
    assert (end.finished, end.problem, at) == (False, COMMANDS[command][1], 21)


def test_a_state_receives_one_failure_of_a_component_in_a_macrostep():
    text = """
        plot: p
        emits: {heard: {why: text}}
        states:
          a:
            entry: [{set: drive.speed, to: 99}, {set: drive.force, to: 99}, {set: other.speed, to: 99}]
            on: {skill_error: {emit: heard, with: {why: ?event.reason}}}
            after: {seconds: 5, to: e}
          e: {final: true}
    """
    end, _ = ran(text, Drive(), Drive("other"))
    why = [one.attributes["why"].partition(":")[0] for one in end.emitted]
    assert (end.finished, why) == (True, ["set drive.speed", "set other.speed"])


def test_the_skill_of_a_state_does_not_begin_without_its_setting():
    text = """
        plot: p
        states:
          a: {entry: [{set: drive.speed, to: 99}, {trigger: drive.go}], on: {gone: x, skill_error: b}}
          b: {entry: [{set: drive.speed, to: 5}, {trigger: drive.go}], on: {gone: e}}
          x:
          e: {final: true}
    """
    drive = Drive()
    end, _ = ran(text, drive)
    assert end.finished, end
    assert drive.log[0] == "speed 99"
    assert drive.log[1] == "speed 5"
    assert drive.log[-1] == "go"


def test_a_handled_failure_of_a_message_does_not_fail_the_next_skill():
    text = """
        plot: p
        states:
          a: {entry: {send: drive.say, with: {text: bad}}, on: {skill_error: b}}
          b: {entry: {trigger: drive.go}, on: {gone: e}}
          e: {final: true}
    """
    end, _ = ran(text, Drive())
    assert end.finished, end


class Faulty(Drive):
    """A drive that declares another error than the one its hooks raise."""

    device_errors = (ConnectionError,)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_bug_is_a_programming_error_of_the_state(command):
    end, _ = ran(ASKED.replace("COMMAND", command), Faulty())
    assert not end.finished
    assert "OSError: cannot take" in end.programming_error
    end, _ = ran(ASKED.replace("COMMAND", command).replace("skill_error", "programming_error"), Faulty())
    assert end.finished, end


@pytest.mark.parametrize("command", COMMANDS)
def test_a_component_that_cannot_start_fails_the_command_of_the_state(command):
    class Dead(Drive):
        async def start(self):
            raise OSError("no power")

    end, _ = ran(ASKED.replace("COMMAND", command), Dead())
    assert end.finished, end
    assert end.emitted[0].attributes["why"].endswith("OSError: no power")


def test_plots_hear_that_an_unused_component_fails_and_recovers():
    text = """
        plot: p
        emits: {heard: {what: text, which: text}}
        states:
          a:
            entry: {set: drive.speed, to: 5}
            on:
              component_failed: {to: b, emit: heard, with: {what: ?event.reason, which: ?event.component}}
          b:
            entry: {switch: drive, to: init}
            on: {component_recovered: {to: e, emit: heard, with: {what: '"recovered"', which: ?event.component}}}
            after: {seconds: 30, to: e}
          e: {final: true}
    """
    drive = Drive()

    async def crash(_):
        await asyncio.sleep(4)
        drive.life.become(Life.FATAL_ERROR, "cable")

    end, _ = ran(text.replace("a:\n", "a:\n            after: {seconds: 60, to: e}\n", 1), drive, meanwhile=crash)
    assert [one.attributes["what"] for one in end.emitted] == ["cable", "recovered"]
    assert {one.attributes["which"] for one in end.emitted} == {"drive"}
    assert drive.log == ["speed 5", "speed 5"]


HUNG = """
    plot: p
    emits: {late: {why: text}}
    states:
      a:
        entry: [{set: drive.speed, to: 1}, {switch: drive, to: up}, {send: drive.say, with: {text: a}}, {trigger: drive.go, within: 5}]
        on: {gone: e, timed_out: {to: e, emit: late, with: {why: ?event.reason}}}
      e: {final: true}
"""


@pytest.mark.parametrize("hook", ["start", "activate", "configure", "switch", "say"])
def test_the_reason_of_a_skill_names_the_hook_that_it_waited_for(hook):
    class Hung(Drive):
        async def hang(self, called):
            if called == hook:
                await asyncio.sleep(1e5)

        async def start(self):
            await self.hang("start")

        async def activate(self, active):
            await self.hang("activate" if active else "")

        async def configure(self, parameter, value):
            await self.hang("configure")

        async def switch(self, mode):
            await self.hang("switch")

        @takes
        async def say(self, text: str):
            await self.hang("say")

    end, _ = ran(HUNG, Hung())
    (late,) = end.emitted
    assert re.search(rf" and executes drive\.{hook} \(.*test_failed_commands\.py:\d+\)$", late.attributes["why"])


HANDLING = """
    plot: p
    emits: {heard: {what: text, which: text}}
    states:
      a: {entry: {set: drive.speed, to: 5}, after: {seconds: 60, to: e}}
      e: {final: true}
    handlers:
      - on: component_failed
        do: {use: report, with: {what: ?event.reason, which: ?event.component}, on: {reported: resume}}
      - on: component_recovered
        do: {use: report, with: {what: '"recovered"', which: ?event.component}, on: {reported: resume}}
"""
REPORT = """
    plot: report
    parameters: {what: text, which: text}
    emits: {reported: }
    states:
      s: {entry: {send: drive.say, with: {text: ?what}}, after: {seconds: 1, to: e}}
      e: {final: true, emit: reported}
"""


def test_a_handler_responds_to_the_events_of_components():
    plots = [plot(HANDLING), plot(REPORT)]
    library, drive = Library(plots), Drive()
    assert [str(one) for each in plots for one in validate_plot(each, library, Schema(), [])] == []

    async def main():
        asyncio.get_running_loop().call_later(5, drive.life.become, Life.FATAL_ERROR, "cable")
        return await Sequencer(library, KnowledgeBase(Schema()), [drive], LoopClock()).run("p")

    assert run_simulated(main()).finished
    assert [one for one in drive.log if "speed" not in one] == ["cable", "recovered"]  # the message starts the drive


def test_the_attributes_of_the_events_of_components_are_checked():
    wrong = plot(HANDLING.replace("?event.component", "?event.componnet", 1))
    found = [str(one) for one in validate_plot(wrong, Library([wrong, plot(REPORT)]), Schema(), [])]
    assert any("there is no variable '?event.componnet' here; did you mean 'event.component'?" in one for one in found)


def test_a_mode_is_left_without_a_start_of_a_component_that_has_failed():
    class Dead(Drive):
        starts = 0

        async def start(self):
            self.starts += 1
            raise OSError("no power")

    text = """
        plot: p
        states:
          a: {entry: {send: drive.say, with: {text: a}}, on: {skill_error: b}}
          b: {entry: {switch: drive, to: neutral}, after: {seconds: 5, to: e}}
          e: {final: true}
    """
    drive = Dead()
    end, _ = ran(text, drive)
    assert (end.finished, drive.starts) == (True, 1)
