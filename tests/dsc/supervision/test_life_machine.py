"""Random lives of a component: its hooks come in their order, and each skill finds the configuration of its state.

A state machine of hypothesis enters states, loses the device, lets hooks fail, restarts the host of the device, and
suspends or kills the run and resumes it. A model of the life cycle (S1.2) checks the log of the device.
"""

from __future__ import annotations

import asyncio
import logging
import shutil
import tempfile
from pathlib import Path

import pytest
from dsc_charts import plot
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

from dsc import Component, Library, LoopClock, Outcome, Sequencer, SkillCall, skill
from dsc.components.hooks import abandon
from dsc.components.life_cycle import Life
from dsc.events import Event
from dsc.runs.store import RunStore
from dsc.sequencer import signals
from dsc.sequencer.clock import SimulatedEventLoop
from dsc.wire.endpoint import LocalTransport
from dsc.wire.host import Host
from dsc.wire.remote import RemoteComponent
from knowledge_base import KnowledgeBase, Schema

HOOKS = ["start", "on", "set", "enter", "leave", "off", "stop"]
CHART = plot("""
    plot: p
    receives: {scan: , park: , idle: , rest: , again: , shut: }
    emits: {heard: {why: text}}
    states:
      all:
        entry: {set: device.force, to: 7}
        on:
          scan: scan
          park: park
          idle: idle
          rest: rest
          again: again
          shut: shut
          component_failed: {emit: heard, with: {why: ?event.reason}}
        states:
          rest: {}
          scan:
            entry: [{set: device.speed, to: 1}, {switch: device, to: scan}, {trigger: device.work, with: {speed: 1, mode: scan}}]
            exit: {switch: device, to: neutral}
            on: {worked: rest, skill_error: {to: rest, emit: heard, with: {why: ?event.reason}}}
          park:
            entry: [{trigger: device.work, with: {speed: 2, mode: park}}, {set: device.speed, to: 2}, {switch: device, to: park}]
            exit: {switch: device, to: neutral}
            on: {worked: rest, skill_error: {to: rest, emit: heard, with: {why: ?event.reason}}}
          idle:
            entry: {set: device.speed, to: 3}
            states:
              first: {entry: {trigger: device.work, with: {speed: 3, mode: neutral}}, on: {worked: second}}
              second: {entry: {trigger: device.work, with: {speed: 3, mode: neutral}}, on: {worked: third}}
              third: {final: true}
            on: {done: rest, skill_error: {to: rest, emit: heard, with: {why: ?event.reason}}}
          again: {entry: {switch: device, to: init}}
          shut: {entry: {switch: device, to: shutdown}}
""")


class Worked(Outcome): ...


class Model:
    """The life cycle as its page describes it: which hook may come next, and which exit hooks are due."""

    def __init__(self) -> None:
        self.open = self.active = False
        self.mode = "neutral"
        self.working = 0
        self.log: list[str] = []
        self.violations: list[str] = []

    def require(self, holds: bool, what: str) -> None:
        if not holds:  # an exception in a hook would be the device's own failure
            self.violations.append(f"{what} after {self.log[-25:]}")

    def note(self, what: str) -> None:
        self.log.append(what)
        hook, _, value = what.partition(" ")
        allowed = {
            "start": not self.open and not self.active and self.mode == "neutral",
            "on": self.open and not self.active,
            "set": self.open,
            "enter": self.open and self.mode in {"neutral", value},
            "work": self.open and self.active,
            "off": self.active and not self.working,
            "leave": self.mode == value and not (self.working and not self.open),
            "stop": self.open and not self.active and self.mode == "neutral" and not self.working,
            "worked": self.working > 0,
        }
        self.require(allowed[hook], what)
        if hook in {"off", "leave", "stop"}:  # an exit hook is called once, also if it fails
            self.done(what)

    def done(self, what: str) -> None:
        match what.split():
            case ["start"]:
                self.open = True
            case ["stop"]:
                self.open = False
            case ["on"]:
                self.active = True
            case ["off"]:
                self.active = False
            case ["enter", mode]:
                self.mode = mode
            case ["leave", _]:
                self.mode = "neutral"
            case ["work"]:
                self.working += 1
            case ["worked"]:
                self.working -= 1


class Device(Component):
    """Forgets its settings when it starts; the hooks in `fails` fail once, each with its own reason."""

    name = "device"
    modes = ("scan", "park")
    device_errors = (OSError,)

    def __init__(self, failures: list[str]) -> None:
        super().__init__()
        self.model = Model()
        self.settings: dict[str, object] = {}
        self.fails: set[str] = set()
        self.failures = failures

    async def do(self, what: str) -> None:
        self.model.note(what)
        await asyncio.sleep(0.1)
        hook = what.split(maxsplit=1)[0]
        if hook in self.fails:
            self.fails.remove(hook)
            self.failures.append(f"failure {len(self.failures)} of {hook}")
            raise OSError(self.failures[-1])
        if hook not in {"off", "leave", "stop"}:
            self.model.done(what)

    async def start(self) -> None:
        self.settings = {"mode": "neutral"}
        await self.do("start")

    async def stop(self) -> None:
        await self.do("stop")

    async def activate(self, active: bool) -> None:
        await self.do("on" if active else "off")

    async def configure(self, parameter: str, value: object) -> None:
        await self.do("set")
        self.settings[parameter] = value

    async def switch(self, mode: str) -> None:
        await super().switch(mode)
        await self.do(f"enter {mode}")
        self.settings["mode"] = mode

    async def leave_mode(self, mode: str) -> None:
        await self.do(f"leave {mode}")
        self.settings["mode"] = "neutral"

    @skill(after_crash="repeat")
    async def work(self, call: SkillCall, speed: float, mode: str) -> Worked:
        self.model.note("work")
        self.model.require(self.settings == {"force": 7, "speed": speed, "mode": mode}, f"work with {self.settings}")
        self.model.done("work")
        try:
            await call.clock.sleep(2)
            await asyncio.sleep(0.5)
        except asyncio.CancelledError:
            await asyncio.sleep(0.5)
            raise
        finally:
            self.model.note("worked")
            self.model.done("worked")
        return Worked()


class Lives(RuleBasedStateMachine):
    """A run of `CHART` in simulated time; each rule lets some time pass."""

    remote = False

    @initialize()
    def begin(self) -> None:
        self.failures: list[str] = []
        self.heard: list[str] = []
        self.killed_after = 0  # failures that a killed program may not have reported
        self.log = logging.Handler()
        self.log.emit = lambda record: self.heard.append(record.getMessage())  # type: ignore[method-assign]
        logging.getLogger("dsc").addHandler(self.log)
        self.folder = Path(tempfile.mkdtemp())
        self.devices: list[Device] = []
        self.launch(at=0.0, resumed=False)

    def launch(self, at: float, *, resumed: bool) -> None:
        """Begin or resume the run, as a program does."""
        self.loop = SimulatedEventLoop(at)
        self.ending = signals._Ending()
        self.host: Host | None = None
        self.plugged = True

        async def program() -> None:
            component: Component = self.new_device()
            if self.remote:
                self.transport = LocalTransport()
                self.host = Host(component, self.transport, LoopClock())
                component = await RemoteComponent.connect("device", self.transport)
            self.kb = KnowledgeBase.open(Schema(), self.folder / "run.kb")
            store, library = RunStore(self.kb, self.folder / "run.kb"), Library([CHART])
            kept = store.load_unfinished(library) if resumed else None
            clock = LoopClock()
            self.sequencer = Sequencer(library, self.kb, [component], clock, open_ended=True, store=store)
            self.sequencer.listen(self.receive)
            signals._ending.set(self.ending)
            run = self.sequencer.run("p") if kept is None else self.sequencer.resume(kept)
            self.run_task = asyncio.ensure_future(run)

        self.loop.run_until_complete(program())
        self.after(0.05)

    def new_device(self) -> Device:
        self.devices.append(Device(self.failures))
        return self.devices[-1]

    @property
    def device(self) -> Device:
        return self.devices[-1]

    def receive(self, step) -> None:
        for one in [*step.emitted, step.event]:
            if isinstance(one, Event):
                self.heard += [str(value) for value in one.attributes.values()]

    def after(self, seconds: float) -> None:
        self.loop.run_until_complete(asyncio.sleep(seconds))
        assert not self.run_task.done(), self.run_task.result()
        for device in self.devices:
            assert not device.model.violations, device.model.violations[0]

    @rule(
        state=st.sampled_from(["scan", "park", "idle", "rest", "again", "shut"]),
        seconds=st.sampled_from([0.0, 0.25, 4]),
    )
    def enter(self, state: str, seconds: float) -> None:
        self.sequencer.post(Event(state))
        self.after(seconds)

    @rule(seconds=st.sampled_from([0.05, 0.3, 1, 10, 70]))
    def wait(self, seconds: float) -> None:
        self.after(seconds)

    @rule(hook=st.sampled_from(HOOKS))
    def let_fail(self, hook: str) -> None:
        self.device.fails.add(hook)

    @precondition(lambda self: self.device.life.state is Life.ALIVE)
    @rule(seconds=st.sampled_from([0.0, 0.05, 3]))
    def lose(self, seconds: float) -> None:
        self.failures.append(f"failure {len(self.failures)} of the cable")

        async def unplug() -> None:
            self.device.life.become(Life.FATAL_ERROR, self.failures[-1])

        self.loop.run_until_complete(unplug())
        self.after(seconds)

    @precondition(lambda self: self.remote)
    @rule(seconds=st.sampled_from([0.1, 2, 9]))
    def restart_host(self, seconds: float) -> None:
        assert self.host is not None
        self.loop.run_until_complete(self.host.close())
        self.after(seconds)
        self.host = self.loop.run_until_complete(self.hosted())
        self.after(5)

    async def hosted(self) -> Host:
        return Host(self.new_device(), self.transport, LoopClock())

    @rule(killed=st.booleans())
    def restart_program(self, killed: bool) -> None:
        if not killed:
            self.ending.received = "SIGTERM"
            self.run_task.cancel()
            with pytest.raises(asyncio.CancelledError):
                self.loop.run_until_complete(self.run_task)
            self.require_closed()
        else:
            self.killed_after = len(self.failures)
        at = self.loop.time()
        self.end_program()
        self.launch(at, resumed=True)

    def require_closed(self) -> None:
        if not self.remote:
            model = self.device.model
            assert (model.open, model.active, model.mode) == (False, False, "neutral"), model.log[-20:]

    def end_program(self) -> None:
        """Forget the program, as a kill does."""
        self.kb.close()
        self.loop.set_exception_handler(lambda *_: None)
        for task in asyncio.all_tasks(self.loop):
            abandon(task)  # its coroutine would clean up when it is freed
        self.loop.close()

    def teardown(self) -> None:
        if not hasattr(self, "loop"):
            return
        try:
            self.after(100)
            self.run_task.cancel()
            with pytest.raises(asyncio.CancelledError):
                self.loop.run_until_complete(self.run_task)
            self.require_closed()
            heard = "\n".join(self.heard)
            assert [failure for failure in self.failures[self.killed_after :] if failure not in heard] == [], heard
        finally:
            logging.getLogger("dsc").removeHandler(self.log)
            self.end_program()
            shutil.rmtree(self.folder)


class HostedLives(Lives):
    """The same with the device at a host."""

    remote = True


TestLives = Lives.TestCase
TestLives.settings = settings(max_examples=60, stateful_step_count=10, deadline=None)
TestHostedLives = HostedLives.TestCase
TestHostedLives.settings = settings(max_examples=12, stateful_step_count=10, deadline=None)


def test_a_device_that_fails_after_a_short_absence_of_its_host_is_reported():
    lives = HostedLives()
    lives.begin()
    lives.restart_host(seconds=0.1)  # while the client starts the component
    assert lives.device.life.state is Life.ALIVE
    lives.lose(seconds=0.0)
    lives.teardown()
