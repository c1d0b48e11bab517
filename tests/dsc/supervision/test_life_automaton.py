"""The automaton of a component's life calls each hook in its order, and each exit hook that is due (S1.2)."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import pytest
from dsc_charts import plot
from dsc_runs import ran

from dsc import Component, Library, LoopClock, Outcome, Sequencer, SkillCall, run_simulated, skill
from dsc.components.assembly import require_instances
from dsc.components.life_cycle import TRANSITIONS, Life
from dsc.text.plot_files import load_plot
from dsc.wire.endpoint import LocalTransport
from dsc.wire.host import Host
from dsc.wire.remote import RemoteComponent
from knowledge_base import KnowledgeBase, Schema
from knowledge_base.errors import InputError, UnknownNameError


class Worked(Outcome): ...


class Device(Component):
    """A device that logs its hooks; each takes a second, and fails if its name is in `fails`."""

    modes = ("scan", "park")
    device_errors = (OSError,)

    def __init__(self, name="device", log=None, fails=(), needs=()):
        super().__init__(name)
        self.log: list[str] = [] if log is None else log
        self.fails = fails
        self.needs = {"scan": needs}  # type: ignore[misc]

    async def do(self, what):
        self.log.append(f"{self.name} {what}")
        await asyncio.sleep(1)
        if what in self.fails:
            raise OSError("no power")

    async def start(self):
        await self.do("start")

    async def stop(self):
        await self.do("stop")

    async def activate(self, active):
        await self.do("on" if active else "off")

    async def switch(self, mode):
        await self.do(f"enters {mode}")
        await super().switch(mode)

    async def leave_mode(self, mode):
        await self.do(f"leaves {mode}")

    @skill
    async def work(self, call: SkillCall, seconds: float = 10.0) -> Worked:
        self.log.append(f"{self.name} works")
        try:
            await call.clock.sleep(seconds)
        finally:
            await asyncio.sleep(2)
            self.log.append(f"{self.name} has worked")
        return Worked()


def did(log, name="device"):
    return [one.removeprefix(f"{name} ") for one in log if one.startswith(f"{name} ")]


def test_the_drawn_automaton_has_the_transitions_of_the_code():
    drawn = load_plot(Path(__file__).parents[3] / "docs" / "plots" / "life_cycle.yaml")
    arrows = {name: {one.target for on in state.on.values() for one in on} for name, state in drawn.states.items()}
    assert arrows == {str(state): {str(one) for one in TRANSITIONS[state]} for state in Life}


WHILE_A_SKILL_RUNS = """
    plot: p
    states:
      a:
        regions:
          x:
            states:
              w: {entry: [{switch: device, to: scan}, {trigger: device.work}], on: {worked: f, skill_error: f}}
              f: {final: true}
          y:
            states:
              s: {after: {seconds: 6, to: t}}
              t: {entry: {switch: device, to: COMMAND}, after: {seconds: 20, to: g}}
              g: {final: true}
        on: {done: e}
      e: {final: true}
"""
ENTRY = ["start", "enters scan", "on", "works"]
EXIT = ["has worked", "off", "leaves scan", "stop"]


@pytest.mark.parametrize("command", ["shutdown", "init"])
def test_a_component_leaves_alive_after_its_skill_its_activity_and_its_mode(command):
    device = Device()
    end, _ = ran(WHILE_A_SKILL_RUNS.replace("COMMAND", command), device)
    assert end.problem is None
    again = ["start", "on", "enters scan", "off", "leaves scan", "stop"] if command == "init" else []
    assert did(device.log) == [*ENTRY, *EXIT, *again]


def test_a_component_at_a_host_leaves_alive_in_the_same_order():
    device = Device()

    async def main():
        transport = LocalTransport()
        host = Host(device, transport, LoopClock())
        remote = await RemoteComponent.connect("device", transport)
        library = Library([plot(WHILE_A_SKILL_RUNS.replace("COMMAND", "shutdown"))])
        end = await Sequencer(library, KnowledgeBase(Schema()), [remote], LoopClock()).run("p")
        await host.close()
        return end

    run_simulated(main())
    assert did(device.log) == [*ENTRY, *EXIT]
    assert device.life.state is Life.SHUTDOWN


def test_a_component_that_failed_is_closed_before_it_starts_again():
    device = Device()

    async def fail(_):
        await asyncio.sleep(5)
        device.life.become(Life.FATAL_ERROR, "the cable is out")

    text = """
        plot: p
        states:
          a: {entry: [{switch: device, to: scan}, {trigger: device.work}], on: {skill_error: b}}
          b: {entry: {trigger: device.work}, on: {worked: e}}
          e: {final: true}
    """
    end, _ = ran(text, device, meanwhile=fail)
    assert end.problem is None
    again = ["start", "on", "enters scan", "works"]
    assert sorted(did(device.log)) == sorted([*ENTRY, *EXIT, *again, *EXIT])
    assert did(device.log)[: len(ENTRY + EXIT)] == [*ENTRY, *EXIT]


def test_a_component_that_is_in_fatal_error_at_the_end_of_a_run_is_closed():
    device = Device()

    async def fail(_):
        await asyncio.sleep(5)
        device.life.become(Life.FATAL_ERROR, "the cable is out")

    text = "{plot: p, states: {a: {entry: {trigger: device.work}, on: {skill_error: e, worked: e}}, e: {final: true}}}"
    ran(text, device, meanwhile=fail)
    assert did(device.log) == ["start", "on", "works", "has worked", "off", "stop"]
    assert (device.life.state, device.life.reason) == (Life.FATAL_ERROR, "the cable is out")


@pytest.mark.parametrize("failing", ["off", "leaves scan", "stop"])
def test_the_failure_of_an_exit_hook_prevents_no_other_and_is_reported(failing):
    device = Device(fails=[failing])
    end, _ = ran(WHILE_A_SKILL_RUNS.replace("COMMAND", "shutdown"), device)
    assert did(device.log) == [*ENTRY, *EXIT]
    assert "OSError: no power" in end.problem
    assert device.life.state is Life.FATAL_ERROR


@pytest.mark.parametrize("failing", ["start", "on"])
def test_an_entry_hook_that_failed_has_no_exit_hook(failing):
    device = Device(fails=[failing])
    text = "{plot: p, states: {a: {entry: {trigger: device.work}, on: {skill_error: e, worked: e}}, e: {final: true}}}"
    ran(text, device)
    assert did(device.log) == (["start"] if failing == "start" else ["start", "on", "stop"])


def test_a_mode_is_left_before_the_next_one_is_entered():
    device = Device()
    actions = ", ".join(f"{{switch: device, to: {mode}}}" for mode in ("scan", "park", "park", "neutral"))
    ran(
        f"{{plot: p, states: {{a: {{entry: [{actions}], after: {{seconds: 20, to: e}}}}, e: {{final: true}}}}}}", device
    )
    modes = [one for one in did(device.log) if one.startswith(("enters", "leaves"))]
    assert modes == ["enters scan", "leaves scan", "enters park", "enters park", "leaves park", "enters neutral"]


@pytest.mark.parametrize("deployed", ["abc", "cab", "bca"])
def test_components_stop_before_those_that_they_need(deployed):
    log: list[str] = []
    needs = {"a": ("b",), "b": ("c",), "c": ()}
    devices = [Device(name, log, needs=needs[name]) for name in deployed]
    text = """
        plot: p
        states:
          w:
            entry: [{switch: a, to: scan}, {switch: b, to: scan}, {trigger: a.work}]
            on: {worked: e}
          e: {final: true}
    """
    end, _ = ran(text, *devices)
    assert end.problem is None
    assert [one for one in log if one.endswith("stop")] == ["a stop", "b stop", "c stop"]
    assert [one for one in log if one.endswith("off")] == ["a off", "b off", "c off"]


def test_components_that_need_each_other_in_different_modes_stop():
    log: list[str] = []
    devices = [Device("a", log, needs=("b",)), Device("b", log)]
    devices[1].needs = {"park": ("a",)}  # type: ignore[misc]
    ran(
        "{plot: p, states: {w: {entry: [{trigger: a.work}, {trigger: b.work}], on: {worked: e}}, e: {final: true}}}",
        *devices,
    )
    assert sorted(one for one in log if one.endswith("stop")) == ["a stop", "b stop"]


def test_a_component_waits_for_the_skills_that_need_it():
    log: list[str] = []
    base, laser = Device("base", log), Device("laser", log, needs=("base",))
    text = WHILE_A_SKILL_RUNS.replace("to: COMMAND", "to: shutdown").replace("device", "laser")
    ran(text.replace("switch: laser, to: shutdown", "switch: base, to: shutdown"), base, laser)
    assert log.index("laser has worked") < log.index("base stop")


def test_a_component_that_a_closed_loop_has_left_alive_starts_anew():
    device = Device()
    run_simulated(device.life.come_alive())
    assert device.life.state is Life.ALIVE
    ran("{plot: p, states: {a: {entry: {trigger: device.work}, on: {worked: e}}, e: {final: true}}}", device)
    assert did(device.log)[:3] == ["start", "stop", "start"]
    assert did(device.log).count("start") == did(device.log).count("stop")


def test_a_hook_may_change_the_mode():
    class Homing(Device):
        async def start(self):
            await super().start()
            await self.change_mode("park")

    device = Homing()
    ran("{plot: p, states: {a: {entry: {trigger: device.work}, on: {worked: e}}, e: {final: true}}}", device)
    assert did(device.log) == ["start", "enters park", "on", "works", "has worked", "off", "leaves park", "stop"]


def test_a_skill_may_change_the_mode_when_it_is_cancelled():
    class Folding(Device):
        @skill
        async def work(self, call: SkillCall) -> Worked:  # type: ignore[override]
            try:
                await call.clock.sleep(10)
            finally:
                await self.change_mode("park")
            return Worked()

    device = Folding()
    _, at = ran(WHILE_A_SKILL_RUNS.replace("COMMAND", "shutdown"), device)
    assert did(device.log)[-5:] == ["leaves scan", "enters park", "off", "leaves park", "stop"]
    assert at < 30


class Arm(Device):
    modes: ClassVar[Mapping[str, tuple[str, ...]]] = {"scan": ("park",), "park": ()}  # type: ignore[assignment]


def test_only_permitted_modes_follow_a_mode():
    async def main(*modes):
        arm = Arm()
        await arm.life.come_alive()
        for mode in modes:
            await arm.change_mode(mode)
        return arm.mode

    assert run_simulated(main("park", "neutral", "scan", "scan", "park")) == "park"
    with pytest.raises(UnknownNameError, match="cannot change from mode 'park' to 'scan'; valid: neutral"):
        run_simulated(main("scan", "park", "scan"))


@pytest.mark.parametrize(
    ("modes", "said"),
    [
        ("scan", "the modes of component 'arm' are a tuple, as in"),
        ({"scan": "park", "park": ()}, "not 'park'"),
        ({"scan": ("prak",), "park": ()}, "has no mode 'prak', which may follow its mode 'scan'; did you mean 'park'?"),
    ],
)
def test_modes_that_are_said_wrongly_are_refused(modes, said):
    arm = Arm("arm")
    arm.modes = modes  # type: ignore[misc]
    with pytest.raises(InputError) as refused:
        require_instances([arm])
    assert said in str(refused.value)
