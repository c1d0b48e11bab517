"""Push ports and streams of components in one run: typed, newest or timed, connected by the run (S1.1, S1.15)."""

from __future__ import annotations

import asyncio
import pickle
from typing import ClassVar

import pytest
from dsc_charts import plot

from dsc.components.component import ALWAYS, Component
from dsc.components.life_cycle import Life
from dsc.components.streams import Push, Stream
from dsc.components.wiring import Wiring
from dsc.dynamic.library import Library
from dsc.errors import NoAnswerError
from dsc.outcomes import Outcome
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from dsc.wire.endpoint import LocalTransport
from dsc.wire.host import Host
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema


class Swept(Outcome): ...


class Blind(Outcome):
    why: str


class Mapped(Outcome): ...


class Laser(Component):
    name = "laser"
    scan = Push({"metres": "number", "points": None})
    heat = Push({"celsius": "number"}, period=0.5)

    @skill
    async def sweep(self, call) -> Swept:
        for n in range(3):
            self.scan.put(metres=n, points=[n, n])
            self.heat.put(celsius=20 + n)
            await call.clock.sleep(0.6)
        return Swept()


class Mapper(Component):
    name = "mapper"
    needs: ClassVar = {ALWAYS: ("laser",)}
    scan = Stream({"metres": "number"}, "laser.scan")
    heat = Stream({"celsius": "number"}, "laser.heat")

    def __init__(self):
        super().__init__()
        self.seen = []

    @skill
    async def map(self, call) -> Mapped | Blind:
        while True:
            try:
                await self.scan.next(within=1.0)
            except NoAnswerError as silent:
                return Blind(why=str(silent))
            self.seen.append((round(call.clock.now(), 3), (self.scan.value or {})["metres"], self.heat.value))


MAP = """
    plot: p
    emits: {ended: {why: text}}
    states:
      w:
        regions:
          a: {states: {x: {entry: {trigger: laser.sweep}, on: {swept: f}}, f: {final: true}}}
          b: {states: {y: {entry: {trigger: mapper.map}, on: {blind: {emit: blind, with: {why: ?event.why}}}}}}
        on: {blind: {to: e, emit: ended, with: {why: ?event.why}}}
      e: {final: true}
"""


def ran(*components, late=()):
    async def main():
        clock = LoopClock()
        sequencer = Sequencer(Library([plot(MAP)]), KnowledgeBase(Schema()), components, clock)
        for one in late:
            sequencer.dispatcher.deploy(one)
        return await sequencer.run("p")

    return run_simulated(main())


@pytest.mark.parametrize("late", [False, True])
def test_components_of_a_run_are_connected(late):
    laser, mapper = Laser(), Mapper()
    end = ran(mapper, late=[laser]) if late else ran(laser, mapper)
    assert end.emitted[0].attributes["why"] == "nothing has come from 'laser.scan' within 1 s"
    heats = [heat and heat["celsius"] for _, _, heat in mapper.seen]
    assert [(at, metres) for at, metres, _ in mapper.seen][-2:] == [(0.6, 1), (1.2, 2)]
    assert heats[-2:] == [20, 21]  # timed: what was the newest at 0.5 and at 1.0


def test_after_a_run_nobody_is_connected():
    laser, mapper = Laser(), Mapper()
    ran(laser, mapper)
    last = mapper.scan.value
    run_simulated(_put(laser, 99))
    assert mapper.scan.value == last


async def _put(laser, metres):
    laser.scan.put(metres=metres, points=[])


def connected(check):
    async def main():
        laser, mapper = Laser(), Mapper()
        wiring = Wiring({"laser": laser, "mapper": mapper})
        await check(laser, mapper)
        wiring.close()

    run_simulated(main())


def test_a_listener_wired_late_receives_the_newest_value():
    async def main():
        laser, mapper = Laser(), Mapper()
        laser.scan.put(metres=1, points=[])
        laser.scan.put(metres=2, points=[])
        Wiring({"laser": laser, "mapper": mapper})
        assert mapper.scan.value is not None
        assert mapper.scan.value["metres"] == 2

    run_simulated(main())


def test_nothing_is_shared_by_accident():
    async def check(laser, mapper):
        mine = [1]
        laser.scan.put(metres=1, points=mine)
        mine.append(2)
        assert mapper.scan.value["points"] == [1]

    connected(check)


@pytest.mark.parametrize("end", [Life.FATAL_ERROR, Life.SHUTDOWN])
def test_a_timed_port_is_silent_when_its_component_is_gone(end):
    async def check(laser, mapper):
        laser.heat.put(celsius=20)
        await asyncio.sleep(10)
        assert mapper.heat.age == 10  # since `put`, also if the port repeats the value
        assert await mapper.heat.next(within=1) == {"celsius": 20}
        laser.life.become(end)
        with pytest.raises(NoAnswerError, match="within 5 s"):
            await mapper.heat.next(within=5)
        laser.life.become(Life.INIT)
        assert await mapper.heat.next(within=5) == {"celsius": 20}

    connected(check)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"metres": 1}, "'laser.scan' needs its value 'points'"),
        ({"metres": "far", "points": []}, "'laser.scan.metres' is a finite number, not 'far'"),
        ({"metres": True, "points": []}, "is a finite number"),
        ({"meters": 1, "points": []}, "has no value 'meters'; did you mean 'metres'"),
        ({"metres": 1, "points": object()}, "only plain data"),
    ],
)
def test_a_stream_refuses_values_that_break_its_declaration(values, said):
    with pytest.raises(InputError) as refused:
        Laser().scan.put(**values)
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("source", "values", "kind", "said"),
    [
        ("laser.scam", {}, UnknownNameError, "has no push port 'scam'; did you mean 'scan'"),
        ("laser.scan", {"meters": "number"}, UnknownNameError, "did you mean 'metres'"),
        ("laser.scan", {"metres": "text"}, SchemaError, "pushes 'metres' as number, and text is wanted"),
        ("laser.scan", {"points": "number"}, SchemaError, "as plain data of any type, and number is wanted"),
    ],
)
def test_a_stream_has_a_port_that_fits(source, values, kind, said):
    class Other(Component):
        name = "other"
        scan = Stream(values, source)

    with pytest.raises(kind) as refused:
        ran(Laser(), Mapper(), Other())
    assert said in str(refused.value)


def test_ports_are_declared_rightly():
    for wrong in (
        lambda: Push(["metres"]),  # type: ignore[arg-type]
        lambda: Push({"a b": None}),
        lambda: Push({}, period=0),
        lambda: Stream({}, "laser."),
        lambda: Stream({}, 3),  # type: ignore[arg-type]
        lambda: Stream({}, period=0),
        lambda: Stream({}, timeout=-1),
    ):
        with pytest.raises(InputError):
            wrong()


def test_each_component_has_ports_of_its_own():
    left, right = Laser("left"), Laser("right")
    assert left.scan is not right.scan
    assert left.scan is left.pushes["scan"]
    assert asyncio.run(left.diagnose())["pushes"] == ["heat", "scan"]
    assert asyncio.run(Mapper().diagnose())["wires"] == {"heat": None, "scan": None}


def test_two_ports_of_one_name_are_told_apart_over_a_transport():
    class Fusion(Component):
        name = "fusion"
        left = Stream({"metres": "number"}, "left.scan")
        right = Stream({"metres": "number"}, "right.scan")

    async def main():
        transport, fusion = LocalTransport(), Fusion()
        lasers = [Laser("left"), Laser("right")]
        hosts = [Host(one, transport, LoopClock()) for one in (*lasers, fusion)]
        await asyncio.sleep(2)
        for n, laser in enumerate(lasers):
            laser.scan.put(metres=n, points=[])
        await asyncio.sleep(0.1)
        assert fusion.left.value is not None
        assert fusion.right.value is not None
        assert (fusion.left.value["metres"], fusion.right.value["metres"]) == (0, 1)
        for host in hosts:
            await host.close()

    run_simulated(main())


def test_a_component_that_is_connected_goes_to_another_process():
    async def check(laser, mapper):
        laser.heat.put(celsius=20)
        for one in (laser, mapper):
            assert pickle.loads(pickle.dumps(one)).name == one.name  # noqa: S301  # our own

    connected(check)
