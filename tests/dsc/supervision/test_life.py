"""Components come to life, need each other, are lost and come back (S1.2, S2.12)."""

from __future__ import annotations

import asyncio
import re
from pathlib import Path
from typing import ClassVar

import pytest
from dsc_charts import plot
from dsc_runs import ran

from dsc.calls import SkillCall
from dsc.components.component import ALWAYS, Component, ComponentHooks
from dsc.components.life_cycle import Life
from dsc.dynamic.library import Library
from dsc.events import Event
from dsc.outcomes import Outcome
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema


def test_the_surface_for_builders_is_small_and_documented():
    surface = {name for name in vars(ComponentHooks) if not name.startswith("_")}
    table = (
        Path(__file__).parents[3].joinpath("docs", "skills.md").read_text("utf-8").split("### The class `Component`")[1]
    )
    rows = [
        line.split("|")[1] for line in table.partition("`self.parameters`")[0].splitlines() if line.startswith("| `")
    ]
    assert set(re.findall(r"`(\w+)`", " ".join(rows))) == surface
    assert len(surface) <= 15


class Arrived(Outcome): ...


class Base(Component):
    name = "base"
    modes = ("fast",)
    device_errors = (OSError,)

    def __init__(self, starting=0.0, broken=False):
        super().__init__()
        self.starting = starting
        self.broken = broken
        self.log = []

    async def start(self):
        self.log.append("start")
        await asyncio.sleep(self.starting)
        if self.broken:
            raise OSError("no such device")

    async def stop(self):
        self.log.append("stop")

    @skill
    async def drive(self, call, seconds: float = 5.0) -> Arrived:
        await call.clock.sleep(seconds)
        return Arrived()


class Laser(Base):
    name = "laser"
    modes = ("scanning",)
    needs: ClassVar = {"scanning": ("base",)}


DRIVE = """
    plot: p
    variables: {why: text}
    emits: {broken: {why: text}}
    states:
      a: {entry: [MODE{trigger: NAME.drive}], on: {arrived: e, skill_error: {to: e, emit: broken, with: {why: ?event.reason}}, timed_out: e}}
      e: {final: true}
"""


def drive(name, *components, mode="", meanwhile=None, text=DRIVE, failure="skill_error"):
    text = (
        text.replace("skill_error", failure)
        .replace("NAME", name)
        .replace("MODE", f"{{switch: {name}, to: {mode}}}, " if mode else "")
    )
    return ran(text, *components, meanwhile=meanwhile)


def why(end):
    (event,) = end.emitted
    return event.attributes["why"]


def test_the_first_skill_brings_a_component_to_life():
    base = Base(starting=2)
    end, at = drive("base", base)
    assert end.finished
    assert at == pytest.approx(7)
    assert base.log == ["start", "stop"]
    drive("base", base)
    assert base.log == ["start", "stop"] * 2


def test_a_component_that_cannot_start_fails_its_skills_and_says_why():
    base = Base(broken=True)
    end, _ = drive("base", base)
    assert "OSError: no such device" in why(end)
    assert base.life.state is Life.FATAL_ERROR
    assert asyncio.run(base.diagnose())["reason"] == "OSError: no such device"


def test_a_component_that_could_not_start_is_started_anew():
    base = Base(broken=True)
    drive("base", base)
    base.broken = False
    end, _ = drive("base", base, mode="init")
    assert end.finished
    assert not end.emitted
    assert base.log == ["start", "start", "stop"]


def test_a_component_that_is_shut_down_does_nothing():
    base = Base()
    end, _ = drive("base", base, mode="shutdown")
    assert "'shutdown'" in why(end)
    assert base.log == []


def test_a_mode_that_a_component_does_not_have_is_refused():
    end, _ = drive("base", Base(), mode="fsat", failure="programming_error")
    assert "did you mean 'fast'" in why(end)


def test_a_component_needed_by_a_mode_is_started_first():
    base, laser = Base(starting=1), Laser(starting=1)
    _, at = drive("laser", laser, base, mode="scanning")
    assert base.log == ["start", "stop"]
    assert at == pytest.approx(7)
    alone = Base()
    drive("laser", Laser(), alone)
    assert alone.log == []


def test_a_skill_waits_for_a_needed_component_deployed_late():
    async def late(sequencer):
        await asyncio.sleep(10)
        sequencer.dispatcher.deploy(Base())

    end, at = drive("laser", Laser(), mode="scanning", meanwhile=late)
    assert end.finished
    assert at == pytest.approx(15)


def test_a_skill_waits_for_a_missing_component_only_within_its_bound():
    end, at = drive("laser", Laser(), mode="scanning")
    assert end.finished
    assert at == pytest.approx(300)


def test_a_lost_component_ends_the_skill_and_is_back_for_the_next_skill():
    base = Base()

    async def unplug(_):
        await asyncio.sleep(2)
        base.broken = True
        base.life.become(Life.FATAL_ERROR, "unplugged")
        await asyncio.sleep(3)
        base.life.become(Life.ALIVE)

    text = DRIVE.replace("skill_error: {to: e, emit: broken, with: {why: ?event.reason}}", "skill_error: a")
    reasons = []

    async def main():
        clock = LoopClock()
        library = Library([plot(text.replace("MODE", "{switch: laser, to: scanning}, ").replace("NAME", "laser"))])
        sequencer = Sequencer(library, KnowledgeBase(Schema()), [base, Laser()], clock)
        sequencer.listen(lambda step: reasons.append(step.event) if isinstance(step.event, Event) else None)
        busy = asyncio.ensure_future(unplug(None))
        end = await sequencer.run("p")
        await busy
        return end, clock.now()

    end, at = run_simulated(main())
    assert end.finished
    assert at == pytest.approx(10)
    assert [event.name for event in reasons[:2]] == ["component_failed", "skill_error"]
    assert reasons[0].attributes == {"component": "base", "reason": "unplugged"}
    assert "it needs component 'base', which is in 'fatal_error': unplugged" in reasons[1].attributes["reason"]


def test_a_timeout_names_the_missing_component():
    text = DRIVE.replace("timed_out: e", "timed_out: {to: e, emit: broken, with: {why: ?event.reason}}")
    bass = Base()
    bass.name = "bass"
    end, _ = drive("laser", Laser(), bass, mode="scanning", text=text)
    assert why(end) == (
        "laser.drive: no outcome within 300 s, it waited for component 'base', which is not there; did you mean 'bass'?"
    )
    end, at = drive("laser", Laser(), Base(broken=True), mode="scanning", text=text)
    assert "it waited for component 'base', which is in 'fatal_error': OSError: no such device" in why(end)
    assert at == pytest.approx(300)


class Moody(Base):
    """Cannot start so many times."""

    def __init__(self, times):
        super().__init__()
        self.times = times

    async def start(self):
        self.log.append(asyncio.get_running_loop().time())
        self.times -= 1
        if self.times >= 0:
            raise OSError("port busy")


def test_a_component_that_cannot_start_is_restarted_after_growing_pauses():
    base = Moody(8)
    end, at = drive("laser", Laser(), base, mode="scanning")
    assert end.finished
    assert base.log[:-1] == pytest.approx([0, 1, 3, 7, 15, 31, 61, 91, 121])
    assert at == pytest.approx(126)


def test_a_crashed_component_is_restarted_for_the_next_skill():
    base, laser = Moody(0), Laser()

    async def crash(_):
        for one, at in ((base, 2), (laser, 4)):
            await asyncio.sleep(at)
            one.life.become(Life.FATAL_ERROR, "crashed")

    text = DRIVE.replace("skill_error: {to: e, emit: broken, with: {why: ?event.reason}}", "skill_error: a")
    end, at = drive("laser", laser, base, mode="scanning", meanwhile=crash, text=text)
    assert end.finished
    assert [one for one in base.log if one != "stop"] == pytest.approx([0, 2])
    assert laser.log == ["start", "stop"] * 2
    assert at == pytest.approx(11)


def test_a_component_that_is_shut_down_is_not_started_by_a_skill_that_needs_it():
    base = Base()
    base.life.become(Life.SHUTDOWN)

    async def begin(_):
        await asyncio.sleep(50)
        await base.change_mode("init")

    end, at = drive("laser", Laser(), base, mode="scanning", meanwhile=begin)
    assert end.finished
    assert base.log == ["start", "stop"]
    assert at == pytest.approx(55)


def test_a_start_that_was_broken_off_is_begun_by_who_waits_for_it():
    base = Base(starting=3)

    async def main():
        first = asyncio.ensure_future(base.life.come_alive())
        second = asyncio.ensure_future(base.life.come_alive())
        await asyncio.sleep(1)
        first.cancel()
        await asyncio.wait_for(second, 10)
        return asyncio.get_running_loop().time()

    assert run_simulated(main()) == pytest.approx(4)
    assert base.life.state is Life.ALIVE


@pytest.mark.parametrize(
    ("needs", "said"),
    [
        (
            {"scanning": "base"},
            "in its mode 'scanning' are a tuple, as in needs = {'scanning': ('power',)}, not 'base'",
        ),
        ({ALWAYS: [1]}, "needs of component 'laser' are a tuple"),
        (("base",), "is a mapping of modes, as in needs = {'scanning': ('power',)}, or of ALWAYS, not"),
        ({"scaning": ("base",)}, "in its mode 'scaning', which it does not have; did you mean 'scanning'?"),
    ],
)
def test_needs_that_are_said_wrongly_are_refused(needs, said):
    class Wrong(Laser):
        pass

    Wrong.needs = needs
    with pytest.raises(InputError) as refused:
        drive("laser", Wrong(), Base())
    assert said in str(refused.value)


def test_components_that_need_each_other_are_refused():
    class Egg(Base):
        name = "egg"
        needs: ClassVar = {ALWAYS: ("hen",)}

    class Hen(Base):
        name = "hen"
        needs: ClassVar = {ALWAYS: ("egg",)}

    end, _ = drive("egg", Egg(), Hen(), failure="programming_error")
    assert "in a cycle: egg -> hen -> egg" in why(end)


def test_a_life_has_its_order():
    life = Component("base").life
    life.become(Life.SHUTDOWN)
    with pytest.raises(InputError, match="'shutdown' cannot become 'alive'"):
        life.become(Life.ALIVE)
    life.become(Life.INIT)
    life.become(Life.FATAL_ERROR, "smoke")
    assert life.reason == "smoke"
    life.become(Life.ALIVE)
    assert life.reason == ""


def test_concurrent_waits_for_a_component_share_one_start():
    base = Base(starting=3)

    async def main():
        await asyncio.gather(base.life.come_alive(), base.life.come_alive())

    run_simulated(main())
    assert base.log == ["start"]


def test_a_mode_is_checked_by_the_component():
    with pytest.raises(UnknownNameError):
        asyncio.run(Base().change_mode("slow"))


@pytest.mark.parametrize("declared", [True, False])
def test_the_error_of_reach_fails_the_skill_that_needs_the_component(declared):
    class Far(Component):
        name = "far"
        needs = {ALWAYS: ("motor",)}  # noqa: RUF012
        device_errors = (OSError,) if declared else ()

        async def reach(self, name):
            raise OSError(f"no network to {name}")

        @skill
        async def go(self, call: SkillCall) -> Arrived:
            return Arrived()

    text = """
        plot: p
        emits: {heard: {event: text, why: text}}
        states:
          a:
            entry: {trigger: far.go, within: 9}
            on:
              arrived: x
              skill_error: {to: e, emit: heard, with: {event: '"skill_error"', why: ?event.reason}}
              programming_error: {to: e, emit: heard, with: {event: '"programming_error"', why: ?event.reason}}
          x:
          e: {final: true}
    """
    end, at = ran(text, Far())
    (heard,) = end.emitted
    assert (heard.attributes["event"], at) == ("skill_error" if declared else "programming_error", 0)
    assert "no network to motor" in heard.attributes["why"]
    assert ("far.reach: OSError" in heard.attributes["why"]) == (not declared)
