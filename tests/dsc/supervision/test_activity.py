"""Components are switched on while a state, or somebody active, needs them, and off when none does (S1.9, S4.1)."""

from __future__ import annotations

import asyncio

import pytest
from dsc_charts import plot
from dsc_runs import ran

from dsc.components.component import ALWAYS, Component
from dsc.components.life_cycle import Life
from dsc.dynamic.library import Library
from dsc.engine.steps import SwitchMode
from dsc.outcomes import Outcome
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from dsc.testing.faults import LossyTransport
from dsc.wire.endpoint import LocalTransport
from dsc.wire.host import Host
from dsc.wire.remote import RemoteComponent
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema

Log = list[tuple[float, str]]


class Looked(Outcome): ...


class Device(Component):
    """Notes what it is told, and when."""

    modes = ("mapping",)
    device_errors = (OSError,)

    def __init__(self, name, log, needs=(), *, mapping=()):
        super().__init__(name)
        self.log = log
        self.needs = {ALWAYS: needs, "mapping": mapping}  # type: ignore[misc]
        self.refuses = 0

    def note(self, what):
        self.log.append((round(asyncio.get_running_loop().time(), 3), f"{self.name} {what}"))

    async def start(self):
        self.note("starts")

    async def activate(self, active):
        if active and self.refuses:
            self.refuses -= 1
            raise OSError("no power")
        self.note("on" if active else "off")

    @skill
    async def look(self, call, seconds: float = 5.0) -> Looked:
        self.note("looks")
        await call.clock.sleep(seconds)
        return Looked()


LOOK = """
    plot: p
    emits: {failed: {why: text}}
    states:
      a: {entry: {trigger: camera.look}, on: {looked: b, skill_error: {to: e, emit: failed, with: {why: ?event.reason}}}}
      b: {entry: {trigger: camera.look}, on: {looked: idle}}
      idle: {after: {seconds: 60, to: c}}
      c: {entry: {trigger: camera.look}, on: {looked: e}}
      e: {final: true}
"""


def test_a_component_is_on_while_a_state_uses_it_and_so_is_what_it_needs():
    log: Log = []
    end, _ = ran(
        LOOK, Device("camera", log, needs=("power",)), Device("power", log, needs=("net",)), Device("net", log)
    )
    assert end.finished
    first, second = [0.0, 5.0, 10.0], [70.0, 75.0]
    assert log == [
        *((first[0], f"{name} {what}") for name in ("net", "power", "camera") for what in ("starts", "on")),
        *((at, "camera looks") for at in first[:2]),
        *((first[2], f"{name} off") for name in ("camera", "power", "net")),
        *((second[0], f"{name} on") for name in ("net", "power", "camera")),
        (second[0], "camera looks"),
        *((second[1], f"{name} off") for name in ("camera", "power", "net")),
    ]  # fmt: skip


def test_a_component_is_switched_off_after_those_that_need_it_even_if_that_takes_time():
    class Slow(Device):
        async def activate(self, active):
            if not active:
                await asyncio.sleep(2)
            await super().activate(active)

    log: Log = []
    ran(LOOK, Slow("camera", log, needs=("power",)), Device("power", log))
    assert [one for one in log if one[1].endswith("off")][:2] == [(12.0, "camera off"), (12.0, "power off")]


def test_a_component_that_nobody_needs_is_left_alone():
    log: Log = []
    ran(LOOK, Device("camera", log), Device("power", log))
    assert not [what for _, what in log if what.startswith("power")]


def test_a_shared_component_is_off_when_no_other_component_needs_it():
    log: Log = []
    text = """
        plot: p
        states:
          w:
            regions:
              a: {states: {x: {entry: {trigger: camera.look, with: {seconds: 3}}, on: {looked: f}}, f: {final: true}}}
              b: {states: {y: {entry: {trigger: laser.look, with: {seconds: 8}}, on: {looked: g}}, g: {final: true}}}
            on: {done: e}
          e: {after: {seconds: 5, to: h}}
          h: {final: true}
    """
    power = Device("power", log)
    ran(text, Device("camera", log, needs=("power",)), Device("laser", log, needs=("power",)), power)
    assert [one for one in log if one[1].startswith("power")] == [
        (0, "power starts"),
        (0, "power on"),
        (8, "power off"),
    ]


class Choosy(Device):
    """Its needs follow from what is plugged in."""

    plugged = ("power",)

    def __init__(self, name, log, error=None):
        super().__init__(name, log)
        self.error = error

    def needed(self):
        if self.error is not None:
            error, self.error = self.error, None
            raise error
        return self.plugged


def test_needs_that_a_hook_returns_are_on_while_a_state_uses_the_component():
    log: Log = []
    end, _ = ran(LOOK, Choosy("camera", log), Device("power", log))
    assert end.finished
    assert log.index((0, "power on")) < log.index((0, "camera on"))


class Tuned(Component):
    """It needs what it is tuned to, and has no activity of its own."""

    name = "radio"

    def needed(self):
        return ("power",)

    @skill
    async def look(self, call, seconds: float = 5.0) -> Looked:
        await call.clock.sleep(seconds)
        return Looked()


def test_needs_of_a_component_without_an_activity_are_on_while_a_state_uses_it():
    log: Log = []
    end, _ = ran(LOOK.replace("camera", "radio"), Tuned(), Device("power", log))
    assert end.finished
    assert [one for one in log if one[1] in {"power on", "power off"}][:2] == [(0, "power on"), (10, "power off")]


def test_needs_that_a_device_could_not_tell_once_are_asked_again():
    log: Log = []
    text = LOOK.replace("skill_error: {to: e, emit: failed, with: {why: ?event.reason}}", "skill_error: a")
    end, _ = ran(text, Choosy("camera", log, OSError("no answer")), Device("power", log))
    assert end.finished
    assert "power on" in [what for _, what in log]


MAP = """
    plot: p
    states:
      a: {entry: {switch: camera, to: mapping}, exit: {switch: camera, to: neutral}, after: {seconds: 7, to: b}}
      b: {after: {seconds: 5, to: e}}
      e: {final: true}
"""


def test_a_mode_counts_as_long_as_it_is_on():
    log: Log = []
    ran(MAP, Device("camera", log, mapping=("lamp",)), Device("lamp", log))
    assert [one for one in log if "starts" not in one[1]] == [
        (0, "lamp on"), (0, "camera on"), (7, "camera off"), (7, "lamp off"),
    ]  # fmt: skip


def test_a_mode_from_before_a_restart_counts():
    log: Log = []

    async def main():
        components = [Device("camera", log, mapping=("lamp",)), Device("lamp", log)]
        dispatcher = Sequencer(Library([plot(MAP)]), KnowledgeBase(Schema()), components, LoopClock()).dispatcher
        dispatcher.restore("camera", [SwitchMode("camera", "mapping")])
        await asyncio.sleep(1)
        on = dispatcher.activation.on
        await dispatcher.close()
        return on

    assert run_simulated(main()) == {"camera", "lamp"}
    assert log[-2:] == [(1, "camera off"), (1, "lamp off")]


def test_a_mode_that_is_refused_keeps_nobody_on():
    log: Log = []
    ran(MAP.replace("mapping", "maping"), Device("camera", log))
    assert log == [(0, "camera starts")]


def test_a_mode_that_was_left_on_ends_with_the_run():
    log: Log = []
    ran(MAP.replace("exit: {switch: camera, to: neutral}, ", ""), Device("camera", log))
    assert log[-1] == (12, "camera off")


@pytest.mark.parametrize("late", [False, True])
def test_a_mode_entered_during_a_skill_adds_its_needs_to_the_skill(late):
    log: Log = []
    lamp = Device("lamp", log)
    text = """
        plot: p
        emits: {failed: {why: text}}
        states:
          w:
            on: {skill_error: {to: e, emit: failed, with: {why: ?event.reason}}}
            regions:
              a: {states: {x: {entry: {trigger: camera.look, with: {seconds: 20}}, on: {looked: f}}, f: {final: true}}}
              b: {states: {y: {after: {seconds: 2, to: z}}, z: {entry: {switch: camera, to: mapping}}}}
          e: {final: true}
    """

    async def blow(sequencer):
        if late:
            await asyncio.sleep(4)
            sequencer.dispatcher.deploy(lamp)
        await asyncio.sleep(9 - 4 * late)
        lamp.life.become(Life.FATAL_ERROR, "blown")

    end, at = ran(text, Device("camera", log, mapping=("lamp",)), *([] if late else [lamp]), meanwhile=blow)
    assert end.emitted[0].attributes["why"].endswith("it needs component 'lamp', which is in 'fatal_error': blown")
    assert at == pytest.approx(9)
    assert (4 if late else 2, "lamp on") in log


class Slow(Device):
    async def start(self):
        await asyncio.sleep(1)


def test_a_skill_after_a_change_of_mode_waits_for_what_the_mode_needs():
    log: Log = []
    text = """
        plot: p
        states:
          w:
            on: {done: e}
            regions:
              a: {states: {x: {entry: {trigger: camera.look, with: {seconds: 20}}, on: {looked: f}}, f: {final: true}}}
              b:
                states:
                  y: {after: {seconds: 2, to: z}}
                  z: {entry: [{switch: camera, to: mapping}, {trigger: camera.look, with: {seconds: 1}}], on: {looked: g}}
                  g: {final: true}
          e: {final: true}
    """
    camera = Device("camera", log, mapping=("lamp",))
    camera.concurrent = True
    ran(text, camera, Slow("lamp", log))
    assert [at for at, what in log if what == "camera looks"] == [0, 3]


def test_a_restarted_component_is_switched_on_again():
    log: Log = []
    power = Device("power", log)

    async def crash(_):
        await asyncio.sleep(2)
        power.life.become(Life.FATAL_ERROR, "crash")

    text = LOOK.replace("skill_error: {to: e, emit: failed, with: {why: ?event.reason}}", "skill_error: a")
    end, _ = ran(text, Device("camera", log, needs=("power",)), power, meanwhile=crash)
    assert end.finished
    assert [one for one in log if one[1].startswith("power")][:4] == [
        (0, "power starts"), (0, "power on"), (2, "power off"), (2, "power starts"),
    ]  # fmt: skip
    assert log.count((2, "power on")) == 1
    assert (2, "camera looks") in log


def test_a_component_that_cannot_be_switched_on_fails_its_skills_with_the_reason():
    log: Log = []
    camera = Device("camera", log)
    camera.refuses = 1
    end, at = ran(LOOK, camera)
    assert end.emitted[0].attributes["why"].endswith("which is in 'fatal_error': OSError: no power")
    assert at == 0


def test_a_needed_component_that_cannot_be_switched_on_is_tried_again():
    log: Log = []
    power = Device("power", log)
    power.refuses = 2
    end, _ = ran(LOOK, Device("camera", log, needs=("power",)), power)
    assert end.finished
    assert [at for at, what in log if what == "power starts"] == [0, 1, 3]
    assert next(at for at, what in log if what == "camera looks") == 3


def test_a_component_that_cannot_be_switched_off_does_not_keep_the_run():
    class Stuck(Device):
        async def activate(self, active):
            if not active:
                await asyncio.sleep(1e9)

    camera = Stuck("camera", [])
    end, at = ran(LOOK, camera)
    assert "it could not be switched off" in end.problem
    assert at == pytest.approx(75 + 30)
    assert camera.life.reason == "it could not be switched off within 30 s"


def test_a_component_is_on_while_it_puts_things_in_order():
    class Careful(Device):
        @skill
        async def look(self, call) -> Looked:  # type: ignore[override,return]
            try:
                await call.clock.sleep(100)
            finally:
                await call.clock.sleep(3)
                self.note("is folded")

    log: Log = []
    text = "{plot: p, states: {a: {entry: {trigger: arm.look}, after: {seconds: 5, to: b}, on: {looked: b}}, b: {after: {seconds: 20, to: e}}, e: {final: true}}}"
    ran(text, Careful("arm", log, needs=("power",)), Device("power", log))
    assert log[-3:] == [(8, "arm is folded"), (8, "arm off"), (8, "power off")]


def test_a_replacement_component_is_on_instead_of_the_replaced_component():
    old: Log = []
    new: Log = []

    async def replace(sequencer):
        await asyncio.sleep(2)
        sequencer.dispatcher.deploy(Device("lamp", new))

    ran(MAP, Device("camera", [], mapping=("lamp",)), Device("lamp", old), meanwhile=replace)
    assert old[-1] == (2, "lamp off")
    assert [one for one in new if "starts" not in one[1]] == [(2, "lamp on"), (7, "lamp off")]


def test_a_run_that_is_cancelled_switches_everything_off():
    log: Log = []

    async def main():
        camera = Device("camera", log, needs=("power",))
        sequencer = Sequencer(
            Library([plot(LOOK)]), KnowledgeBase(Schema()), [camera, Device("power", log)], LoopClock()
        )
        running = asyncio.ensure_future(sequencer.run("p"))
        await asyncio.sleep(2)
        said = sequencer.diagnose()["switched_on"], (await camera.diagnose())["active"]
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        return said

    assert run_simulated(main()) == (["camera", "power"], True)
    assert log[-2:] == [(2, "camera off"), (2, "power off")]


@pytest.mark.parametrize("transport", [LocalTransport, lambda: LossyTransport(3, loss=0.2, double=0.3, delay=0.1)])
def test_components_elsewhere_are_switched_on_and_off_by_the_run_itself(transport):
    log: Log = []

    async def main():
        carrier, clock = transport(), LoopClock()
        hosts = [
            Host(Device("camera", log, needs=("power",)), carrier, clock),
            Host(Device("power", log), carrier, clock),
        ]
        camera = await RemoteComponent.connect("camera", carrier)
        end = await Sequencer(Library([plot(LOOK)]), KnowledgeBase(Schema()), [camera], clock).run("p")
        await asyncio.sleep(5)
        for host in hosts:
            await host.close()
        return end

    assert run_simulated(main()).finished
    said = [what for _, what in log]
    for name in ("camera", "power"):
        told = [what for what in said if what in {f"{name} on", f"{name} off"}]
        assert told == [f"{name} {what}" for what in ("on", "off", "on", "off")]
    assert said.index("power on") < said.index("camera on") < said.index("camera looks")
    (first, off, on, last) = [at for at, what in log if what in {"camera on", "camera off"}]
    assert [first < 5, 10 <= off < 20, 70 <= on < last] == [True] * 3


def test_one_component_in_two_runs_is_off_when_neither_needs_it():
    log: Log = []

    async def main():
        camera, kb = Device("camera", log), KnowledgeBase(Schema())
        camera.concurrent = True
        short = plot(
            "{plot: q, states: {a: {entry: {trigger: camera.look, with: {seconds: 2}}, on: {looked: e}}, e: {final: true}}}"
        )
        runs = [Sequencer(Library([one]), kb, [camera], LoopClock()).run(one.name) for one in (plot(LOOK), short)]
        await asyncio.gather(*runs)

    run_simulated(main())
    assert [one for one in log if one[1] in {"camera on", "camera off"}][:2] == [(0, "camera on"), (10, "camera off")]
