"""A component that starts again after a failure has the parameters and the mode of the active states (S0 5.2)."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from dsc_charts import plot

from dsc import Component, Library, LoopClock, Outcome, Sequencer, SkillCall, run_simulated, skill
from dsc.components.life_cycle import Life
from dsc.wire.endpoint import LocalTransport
from dsc.wire.host import Host
from dsc.wire.remote import RemoteComponent
from knowledge_base import KnowledgeBase, Schema

TEXT = """
plot: p
emits: {worked: {speed: number, mode: text}, failed: {why: text}}
states:
  all:
    entry: [{set: device.speed, to: 5}, {set: device.force, to: 1}, {switch: device, to: scan}]
    states:
      first: {entry: {trigger: device.work}, on: {ok: {to: pause, emit: worked, with: {speed: ?event.speed, mode: ?event.mode}}}}
      pause: {after: {seconds: 12, to: second}}
      second:
        entry: {trigger: device.work, within: 60}
        on:
          ok: {to: over, emit: worked, with: {speed: ?event.speed, mode: ?event.mode}}
          skill_error: {to: retry, emit: failed, with: {why: ?event.reason}}
      retry: {after: {seconds: 1, to: second}}
      over: {final: true}
    on: {done: end}
  end: {final: true}
"""


class Ok(Outcome):
    speed: float
    mode: str


class Device(Component):
    """Forgets its settings when it starts; refuses the first settings after `refused` starts."""

    name = "device"
    modes = ("scan",)
    device_errors = (OSError,)

    def __init__(self, refused: int = -1) -> None:
        super().__init__()
        self.log: list[str] = []
        self.settings: dict[str, Any] = {}
        self.scans = False
        self.refused = refused

    async def start(self) -> None:
        self.log.append("start")
        self.settings.clear()
        self.scans = False

    async def configure(self, parameter: str, value: object) -> None:
        if self.log.count("start") == self.refused:
            self.refused = -1
            raise OSError("no answer")
        self.settings[parameter] = value

    async def switch(self, mode: str) -> None:
        await super().switch(mode)
        self.scans = mode == "scan"

    @skill
    async def work(self, call: SkillCall) -> Ok:
        self.log.append("work")
        await call.clock.sleep(1)
        return Ok(speed=self.settings.get("speed", 0), mode="scan" if self.scans else "")


GOOD = ("worked", {"speed": 5, "mode": "scan"})


def emitted(end):
    return [(one.name, one.attributes) for one in end.emitted]


async def executed(component, meanwhile):
    sequencer = Sequencer(Library([plot(TEXT)]), KnowledgeBase(Schema()), [component], LoopClock())
    other = asyncio.ensure_future(meanwhile())
    end = await sequencer.run("p")
    await other
    return end


def loses(device, at=4.0):
    async def cable():
        await asyncio.sleep(at)
        device.life.become(Life.FATAL_ERROR, "the cable is out")

    return cable


def test_a_local_component_has_its_settings_again():
    device = Device()
    end = run_simulated(executed(device, loses(device)))
    assert emitted(end) == [GOOD, GOOD]
    assert end.problem is None
    assert device.log == ["start", "work", "start", "work"]


def test_a_skill_that_fails_with_its_component_has_the_settings_at_its_next_start():
    device = Device()
    end = run_simulated(executed(device, loses(device, at=13.5)))
    assert [name for name, _ in emitted(end)] == ["worked", "failed", "worked"]
    assert emitted(end)[-1] == GOOD


@pytest.mark.parametrize("seconds", [0.1, 1, 8])
def test_a_host_that_restarts_has_the_settings_again(seconds):
    devices = [Device(), Device()]

    async def main():
        transport = LocalTransport()
        hosts = [Host(devices[0], transport, LoopClock())]
        remote = await RemoteComponent.connect("device", transport)

        async def crash():
            await asyncio.sleep(4)
            await hosts[0].close()
            await asyncio.sleep(seconds)
            hosts.append(Host(devices[1], transport, LoopClock()))

        end = await executed(remote, crash)
        await hosts[1].close()
        return end

    assert emitted(run_simulated(main())) == [GOOD, GOOD]
    assert devices[1].log == ["start", "work"]


def test_a_skill_does_not_begin_without_the_settings():
    device = Device(refused=2)
    end = run_simulated(executed(device, loses(device)))
    assert [name for name, _ in emitted(end)] == ["worked", "failed", "worked"]
    assert "no answer" in emitted(end)[1][1]["why"]
    assert emitted(end)[-1] == GOOD
    assert device.log.count("work") == 2


def test_a_component_that_failed_before_the_run_has_its_settings():
    device = Device()
    device.life.become(Life.FATAL_ERROR, "the cable was out")
    end = run_simulated(executed(device, lambda: asyncio.sleep(0)))
    assert end.problem is None
    assert emitted(end) == [GOOD, GOOD]
