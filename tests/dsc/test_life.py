"""Components come to life, need each other, are lost and come back (S1.2, S2.12)."""

from __future__ import annotations

import asyncio
from typing import ClassVar

import pytest
from dsc_charts import plot

from dsc.calls import Outcome
from dsc.components.component import ALWAYS, Component
from dsc.components.life import Life, LifeCycle
from dsc.dynamic.library import Library
from dsc.events import Event
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema


class Base(Component):
    name = "base"
    modes = ("fast",)

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

    @skill(outcomes={"arrived": {}})
    async def drive(self, call, seconds: float = 5.0):
        await call.clock.sleep(seconds)
        return Outcome("arrived")


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


def drive(name, *components, mode="", meanwhile=None, text=DRIVE):
    text = text.replace("NAME", name).replace("MODE", f"{{switch: {name}, to: {mode}}}, " if mode else "")

    async def main():
        clock = LoopClock()
        sequencer = Sequencer(Library([plot(text)]), KnowledgeBase(Schema()), components, clock)
        busy = asyncio.ensure_future(meanwhile(sequencer)) if meanwhile else None
        end = await sequencer.run("p")
        if busy is not None:
            await busy
        return end, clock.now()

    return run_simulated(main())


def why(end):
    (event,) = end.emitted
    return event.attributes["why"]


def test_the_first_skill_brings_a_component_to_life():
    base = Base(starting=2)
    end, at = drive("base", base)
    assert end.finished
    assert at == pytest.approx(7)
    assert base.life.state is Life.ALIVE
    drive("base", base)
    assert base.log == ["start"]


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
    assert base.log == ["start", "start"]


def test_a_component_that_is_shut_down_does_nothing():
    base = Base()
    end, _ = drive("base", base, mode="shutdown")
    assert "'shutdown'" in why(end)
    assert base.log == ["stop"]


def test_a_mode_that_a_component_does_not_have_is_refused():
    end, _ = drive("base", Base(), mode="fsat")
    assert "did you mean 'fast'" in why(end)


def test_what_is_needed_in_a_mode_is_started_first():
    base, laser = Base(starting=1), Laser(starting=1)
    _, at = drive("laser", laser, base, mode="scanning")
    assert base.log == ["start"]
    assert at == pytest.approx(7)
    alone = Base()
    drive("laser", Laser(), alone)
    assert alone.log == []


def test_what_is_deployed_late_is_waited_for():
    async def late(sequencer):
        await asyncio.sleep(10)
        sequencer.dispatcher.deploy(Base())

    end, at = drive("laser", Laser(), mode="scanning", meanwhile=late)
    assert end.finished
    assert at == pytest.approx(15)


def test_what_never_comes_is_waited_for_within_the_skills_bound():
    end, at = drive("laser", Laser(), mode="scanning")
    assert end.finished
    assert at == pytest.approx(300)


def test_what_is_lost_ends_the_skill_and_is_back_for_the_next():
    base = Base()

    async def unplug(_):
        await asyncio.sleep(2)
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
    assert "it needs component 'base', which is in 'fatal_error': unplugged" in reasons[0].attributes["reason"]


def test_components_that_need_each_other_are_refused():
    class Egg(Base):
        name = "egg"
        needs: ClassVar = {ALWAYS: ("hen",)}

    class Hen(Base):
        name = "hen"
        needs: ClassVar = {ALWAYS: ("egg",)}

    end, _ = drive("egg", Egg(), Hen())
    assert "in a circle: egg -> hen -> egg" in why(end)


def test_a_life_has_its_order():
    life = LifeCycle()
    life.become(Life.SHUTDOWN)
    with pytest.raises(InputError, match="'shutdown' cannot become 'alive'"):
        life.become(Life.ALIVE)
    life.become(Life.INIT)
    life.become(Life.FATAL_ERROR, "smoke")
    assert life.reason == "smoke"
    life.become(Life.ALIVE)
    assert life.reason == ""


def test_who_waits_for_the_same_start_waits_together():
    base = Base(starting=3)

    async def main():
        await asyncio.gather(base.come_alive(), base.come_alive())

    run_simulated(main())
    assert base.log == ["start"]


def test_a_mode_is_checked_by_the_component():
    with pytest.raises(UnknownNameError):
        asyncio.run(Base().change_mode("slow"))
