"""A component is started before it receives anything, is stopped at the end, and no failure of it is silent."""

from __future__ import annotations

import asyncio

import pytest
from dsc_charts import plot
from dsc_runs import ran

from dsc import Component, Library, LoopClock, Outcome, Sequencer, SkillCall, skill, takes
from dsc.components.life_cycle import Life
from dsc.sequencer.clock import run_simulated
from dsc.sequencer.plot_skill import PlotComponent
from knowledge_base import KnowledgeBase, Schema


class Looked(Outcome): ...


class Device(Component):
    """A device that takes a second for everything, and logs what it does."""

    modes = ("bright",)
    device_errors = (OSError,)

    def __init__(self, name, log, fails=""):
        super().__init__(name)
        self.log = log
        self.fails = fails

    async def do(self, what):
        self.log.append(f"{self.name} {what}")
        await asyncio.sleep(1)
        if what == self.fails:
            raise OSError("no power")
        self.log.append(f"{self.name} {what} over")

    async def start(self):
        await self.do("start")

    async def stop(self):
        await self.do("stop")

    async def configure(self, parameter, value):
        await self.do(f"{parameter} {value}")
        await super().configure(parameter, value)

    async def switch(self, mode):
        await self.do(mode)
        await super().switch(mode)

    @takes
    async def tell(self, text: str):
        await self.do(text)

    @skill
    async def look(self, call: SkillCall) -> Looked:
        await self.do("look")
        return Looked()


ALONE = """
    plot: p
    states:
      a: {entry: [ACTION], after: {seconds: 10, to: e}}
      e: {final: true}
"""


@pytest.mark.parametrize(
    ("action", "what"),
    [
        ("{set: lamp.level, to: 3}", "level 3"),
        ("{switch: lamp, to: bright}", "bright"),
        ("{send: lamp.tell, with: {text: hello}}", "hello"),
    ],
)
def test_a_component_is_started_before_it_receives_anything_and_stopped_at_the_end(action, what):
    log: list[str] = []
    lamp = Device("lamp", log)
    end, _ = ran(ALONE.replace("ACTION", action), lamp)
    assert end.problem is None
    assert log == [f"lamp {one}{over}" for one in ("start", what, "stop") for over in ("", " over")]
    assert lamp.life.state is Life.INIT


@pytest.mark.parametrize("trigger_first", [False, True])
def test_a_skill_begins_when_all_components_have_the_configuration_of_the_entry(trigger_first):
    actions = ["{switch: lamp, to: bright}", "{trigger: camera.look}"]
    text = f"""
        plot: p
        states:
          a: {{entry: [{", ".join(reversed(actions) if trigger_first else actions)}], on: {{looked: e}}}}
          e: {{final: true}}
    """
    log: list[str] = []
    end, _ = ran(text, Device("lamp", log), Device("camera", log))
    assert end.finished
    assert log.index("lamp bright over") < log.index("camera look")


def test_a_skill_does_not_wait_for_messages_to_other_components():
    text = """
        plot: p
        states:
          a: {entry: [{send: lamp.tell, with: {text: hello}}, {trigger: camera.look}], on: {looked: e}}
          e: {final: true}
    """
    log: list[str] = []
    ran(text, Device("lamp", log), Device("camera", log))
    assert log.index("camera look") < log.index("lamp hello over") + 2


def test_a_skill_that_waits_too_long_for_a_configuration_names_the_component():
    class Slow(Device):
        async def switch(self, mode):
            await asyncio.sleep(50)

    text = """
        plot: p
        emits: {late: {why: text}}
        states:
          a:
            entry: [{switch: lamp, to: bright}, {trigger: camera.look, within: 5}]
            on: {looked: e, timed_out: {to: e, emit: late, with: {why: ?event.reason}}}
          e: {final: true}
    """
    end, _ = ran(text, Slow("lamp", []), Device("camera", []))
    assert "component 'lamp', which has not received its parameters and modes" in end.emitted[0].attributes["why"]


HEARS = """
    plot: p
    emits: {heard: {component: text, reason: text}}
    states:
      a:
        entry: {set: lamp.level, to: 3}
        after: {seconds: 20, to: e}
        on:
          component_failed:
            to: e
            emit: heard
            with: {component: ?event.component, reason: ?event.reason}
      e: {final: true}
"""


def test_a_plot_hears_of_the_failure_of_a_component_that_nobody_uses():
    lamp = Device("lamp", [])

    async def crash(_):
        await asyncio.sleep(5)
        lamp.life.become(Life.FATAL_ERROR, "burnt out")

    end, at = ran(HEARS, lamp, meanwhile=crash)
    assert at == pytest.approx(5 + 1)  # the failed lamp is closed, too
    assert end.emitted[0].attributes == {"component": "lamp", "reason": "burnt out"}


def test_a_plot_hears_that_a_component_without_a_skill_cannot_start():
    end, _ = ran(HEARS, Device("lamp", [], fails="start"))
    heard = end.emitted[0].attributes
    assert (heard["component"], heard["reason"].rpartition(": OSError: ")[2]) == ("lamp", "no power")


def test_only_the_skill_reports_a_failure_while_it_runs():
    text = """
        plot: p
        emits: {heard: }
        states:
          a:
            entry: {trigger: camera.look}
            on: {component_failed: {emit: heard}, looked: e, skill_error: b}
          b: {on: {component_failed: {emit: heard}}, after: {seconds: 5, to: e}}
          e: {final: true}
    """
    camera = Device("camera", [])

    async def crash(_):
        await asyncio.sleep(1.5)
        camera.life.become(Life.FATAL_ERROR, "unplugged")

    end, _ = ran(text, camera, meanwhile=crash)
    assert (end.finished, end.emitted, end.programming_error) == (True, (), None)


def test_a_component_that_cannot_stop_is_in_the_end_of_the_run():
    end, _ = ran(ALONE.replace("ACTION", "{set: lamp.level, to: 3}"), Device("lamp", [], fails="stop"))
    assert end.problem == "component 'lamp' could not stop: OSError: no power"


def test_the_last_of_several_runs_stops_a_component():
    log: list[str] = []
    text = (
        "{plot: NAME, states: {a: {entry: {set: lamp.level, to: 3}, after: {seconds: LONG, to: e}}, e: {final: true}}}"
    )

    async def main():
        lamp, kb = Device("lamp", log), KnowledgeBase(Schema())
        plots = [plot(text.replace("NAME", name).replace("LONG", long)) for name, long in (("p", "5"), ("q", "9"))]
        await asyncio.gather(*(Sequencer(Library([one]), kb, [lamp], LoopClock()).run(one.name) for one in plots))
        log.append("end")

    run_simulated(main())
    assert (log.count("lamp start"), log[-3:]) == (1, ["lamp stop", "lamp stop over", "end"])


def test_a_component_of_a_plot_that_is_a_skill_is_stopped_with_the_whole_run():
    log: list[str] = []
    inner = plot(
        "{plot: glow, states: {a: {entry: {set: lamp.level, to: 3}, after: {seconds: 2, to: e}}, e: {final: true}}}"
    )
    text = """
        plot: p
        states:
          a: {entry: {trigger: part.glow}, on: {completed: b}}
          b: {entry: {trigger: part.glow}, on: {completed: e}}
          e: {final: true}
    """
    end, _ = ran(text, PlotComponent("part", Library([inner]), [Device("lamp", log)]))
    assert end.problem is None
    assert [one for one in log if "over" not in one] == ["lamp start", "lamp level 3", "lamp level 3", "lamp stop"]
