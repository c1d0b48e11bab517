"""Wiring: required ports of all patterns are met by service, by the profile, and changed while a robot runs."""

from __future__ import annotations

import asyncio
import pickle
from pathlib import Path
from typing import ClassVar

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsc.components.clients import EventClient, ParameterClient, QueryClient, SendClient, StateClient
from dsc.components.component import Component
from dsc.components.parameters import Parameters, parameter
from dsc.components.ports import event, query, takes
from dsc.components.requirement import Requirement
from dsc.components.services import Service
from dsc.components.streams import Push, Stream
from dsc.components.wiring import Wiring, choose_sources, name_sources, require_wired, wiring_errors
from dsc.errors import NoAnswerError, NotWiredError, SkillError
from dsc.outcomes import Outcome
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.wire.endpoint import LocalTransport
from dsc.wire.host import Host
from dsc.wire.hosted_wiring import HostedWiring
from dsc.wire.remote import RemoteComponent
from knowledge_base.errors import InputError, SchemaError, UnknownNameError


class Laser(Component):
    modes = ("scanning", "parked")
    scan = Push({"metres": "number", "points": None})


class Mapper(Component):
    name = "mapper"
    needs: ClassVar = {"mapping": ("scan",)}
    modes = ("mapping",)
    scan = Stream({"metres": "number"})


class Lasts(Outcome):
    hours: float
    sure: bool


class Low(Outcome):
    level: float


class CellParameters(Parameters):
    reserve: float = parameter(10.0, least=0.0, most=50.0)


class Cell(Component):
    """A battery with a query, an event, a message, parameters and modes."""

    name = "cell"
    modes = ("charging", "idle")
    parameters: CellParameters

    def __init__(self, name=None, hours=2.0):
        super().__init__(name)
        self.hours = hours
        self.full = 0.0
        self.asked = 0

    @query
    async def lasts(self, watts: float, spare: float = 0.0) -> Lasts:
        self.asked += 1
        await asyncio.sleep(self.hours)
        return Lasts(hours=self.hours * 60 / watts - spare, sure=True)

    @event
    def low(self, level: float, below: float = 20.0) -> Low | None:
        return Low(level=level) if level < below else None

    @takes
    async def calibrate(self, full: float) -> None:
        self.full = full


class Watch(Component):
    """A component of a stranger, which knows no name of the battery."""

    name = "watch"
    battery = QueryClient({"watts": "number"}, answer={"hours": "number"})
    empty = EventClient({"below": "number"}, event={"level": "number"})
    tell = SendClient({"full": "number"})
    settings = ParameterClient({"reserve": "number"})
    charger = StateClient("charging")


def wired(*components, **wiring):
    """Return the wiring of components; `a__b` stands for the port `a.b`."""
    choose_sources(components, {name.replace("__", "."): to for name, to in wiring.items()})
    require_wired(components)
    return Wiring({one.name: one for one in components})


def simulate(main):
    return run_simulated(main())


@pytest.mark.parametrize("far", [False, True])
def test_a_component_is_wired_by_service_and_uses_its_own_names(far):
    async def main():
        cell, watch = Cell(), Watch()
        transport = LocalTransport()
        host = Host(cell, transport, LoopClock()) if far else None
        wiring = wired(watch, await RemoteComponent.connect("cell", transport) if far else cell)
        assert await watch.battery.ask(watts=60.0) == {"hours": 2.0}
        await watch.tell.send(full=0.9)
        await watch.settings.set(reserve=5.0)
        await watch.charger.switch("charging")
        assert (cell.full, cell.parameters.reserve, cell.mode) == (0.9, 5.0, "charging")
        assert watch.charger.mode == "charging"
        async with watch.empty.activation(below=30.0) as low:
            await asyncio.sleep(1)
            for level in (50.0, 25.0, 60.0, 10.0):
                cell.update("low", level)
            assert [(await low.next(1))["level"] for _ in range(2)] == [25.0, 10.0]
            with pytest.raises(NoAnswerError, match=r"'watch\.empty' has not occurred within 1 s"):
                await low.next(1)
        await asyncio.sleep(1)
        assert not cell.activations.active("low")
        wiring.close()
        if host is not None:
            await host.close()

    simulate(main)


def test_a_mapper_of_one_laser_among_two_is_wired_by_the_profile():
    async def main():
        front, rear, mapper = Laser("front"), Laser("rear"), Mapper()
        with pytest.raises(InputError, match=r"several services fit port 'mapper\.scan': front\.scan, rear\.scan"):
            wired(front, rear, mapper)
        wiring = wired(front, rear, mapper, mapper__scan="rear.scan")
        front.scan.put(metres=1.0, points=[])
        rear.scan.put(metres=2.0, points=[])
        assert mapper.scan.value == {"metres": 2.0, "points": []}
        assert (await mapper.diagnose())["wires"] == {"scan": "rear.scan"}
        mapper.mode = "mapping"
        assert mapper.needed() == ("rear",)
        wiring.wire("mapper.scan", "front", activation=7)
        assert mapper.needed() == ("front",)
        front.scan.put(metres=3.0, points=[])
        assert mapper.scan.value["metres"] == 3.0
        wiring.revert(7)
        rear.scan.put(metres=4.0, points=[])
        front.scan.put(metres=5.0, points=[])
        assert mapper.scan.value["metres"] == 4.0
        wiring.close()
        assert mapper.scan.provider is None

    simulate(main)


@pytest.mark.parametrize(
    ("wiring", "kind", "said"),
    [
        ({"mapper.scam": "rear.scan"}, UnknownNameError, "no required port 'mapper.scam'; did you mean 'mapper.scan'"),
        (
            {"mapper.scan": "raer.scan"},
            UnknownNameError,
            "wired to 'raer.scan', and there is no such component; did you",
        ),
        (
            {"mapper.scan": "rear.scam"},
            UnknownNameError,
            "component 'rear' has no push port 'scam'; did you mean 'scan'",
        ),
        (
            {"mapper.scan": "cell"},
            SchemaError,
            "component 'cell' has no push port that fits 'mapper.scan', which wants",
        ),
        ({"mapper.scan": "cell.lasts"}, UnknownNameError, "component 'cell' has no push port 'lasts'"),
    ],
)
def test_a_wire_that_does_not_fit_is_refused_with_the_nearest_name(wiring, kind, said):
    components = [Laser("front"), Laser("rear"), Mapper(), Cell()]
    with pytest.raises(kind) as refused:
        wired(*components, **{name.replace(".", "__"): to for name, to in wiring.items()})
    assert said in str(refused.value)


class Thermometer(Component):
    scan = Push({"metres": "text"})


def test_a_port_without_a_provider_names_the_reasons():
    with pytest.raises(SchemaError) as missing:
        require_wired([Mapper(), Thermometer()])
    said = (
        "port 'mapper.scan' wants a push port -> (metres: number), and no component has one; 'thermometer.scan' pushes"
    )
    assert said in str(missing.value)
    assert missing.value.place is not None


def test_an_optional_port_needs_no_provider():
    class Careful(Component):
        name = "careful"
        battery = QueryClient({}, answer={"hours": "number"}, optional=True)

    async def main():
        careful = Careful()
        wired(careful)
        with pytest.raises(NotWiredError, match=r"port 'careful\.battery' is not wired"):
            await careful.battery.ask()

    simulate(main)


@pytest.mark.parametrize("cut", ["unwire", "rewire", "close"])
def test_pending_calls_of_a_cut_wire_end(cut):
    async def main():
        old, new, watch = Cell("old"), Cell("new"), Watch()
        sources = {f"watch__{port}": "old" for port in ("battery", "empty", "tell", "settings", "charger")}
        wiring = wired(old, new, watch, **sources)
        asking = asyncio.ensure_future(watch.battery.ask(watts=60.0))
        await asyncio.sleep(0.5)
        async with watch.empty.activation(below=30.0) as low:
            waiting = asyncio.ensure_future(low.next(60))
            await asyncio.sleep(0.5)
            if cut == "close":
                wiring.close()
            else:
                for port in ("watch.battery", "watch.empty"):
                    wiring.wire(port, "new" if cut == "rewire" else None)
            for pending in (asking, waiting):
                with pytest.raises(NotWiredError, match=r"'old.*was cut during a call"):
                    await pending
        if cut == "rewire":
            assert await watch.battery.ask(watts=60.0) == {"hours": 2.0}
            assert new.asked == 1
        else:
            with pytest.raises(NotWiredError):
                await watch.battery.ask(watts=60.0)
        assert issubclass(NotWiredError, SkillError)  # a skill that does not catch it ends with `skill_error`

    simulate(main)


def test_a_late_answer_and_wrong_arguments():
    async def main():
        watch = Watch()
        wired(Cell(hours=20.0), watch)
        with pytest.raises(NoAnswerError, match=r"call of 'watch\.battery' to 'cell\.lasts' has no answer within 3 s"):
            await watch.battery.ask(watts=60.0, within=3)
        with pytest.raises(InputError, match="needs its argument 'watts'"):
            await watch.battery.ask()
        with pytest.raises(UnknownNameError, match="no argument 'wats'; did you mean 'watts'"):
            await watch.battery.ask(wats=1.0)
        with pytest.raises(InputError, match="a finite number, not 'much'"):
            await watch.battery.ask(watts="much")
        with pytest.raises(InputError):
            await watch.settings.set(reserve=500.0)

    simulate(main)


def test_a_stream_with_a_period_and_kept_values():
    class Slow(Component):
        name = "slow"
        scan = Stream({"metres": "number"}, period=1.0, timeout=2.0, keep=3)

    async def main():
        laser, slow = Laser("laser"), Slow()
        wiring = wired(laser, slow)
        seen = []
        for n in range(25):
            laser.scan.put(metres=n, points=[])
            await asyncio.sleep(0.1)
            metres = (slow.scan.value or {})["metres"]
            if metres not in seen:
                seen.append(metres)
        assert seen == [0, 9, 19]  # the newest value at 0, 1 and 2 s
        assert [one["metres"] for one in slow.scan.take_kept()] == [0, 9, 19]
        assert slow.scan.take_kept() == []
        assert (await slow.scan.next())["metres"] == 24
        with pytest.raises(NoAnswerError, match=r"nothing has come from 'laser\.scan' within 2 s"):
            await slow.scan.next()
        waiting = asyncio.ensure_future(slow.scan.next(100))
        await asyncio.sleep(0)
        wiring.wire("slow.scan", None)
        with pytest.raises(NotWiredError):
            await waiting

    simulate(main)


def test_two_runs_share_the_wires_of_their_components():
    async def main():
        laser, mapper = Laser("laser"), Mapper()
        runs = [wired(laser, mapper), wired(laser, mapper)]
        runs[0].close()
        laser.scan.put(metres=1.0, points=[])
        assert mapper.scan.value is not None
        runs[1].close()
        assert mapper.scan.provider is None

    simulate(main)


def test_a_component_that_is_deployed_late_is_wired_and_a_replaced_one_too():
    async def main():
        mapper = Mapper()
        components: dict[str, Component] = {}
        components["mapper"] = mapper
        wiring = Wiring(components)
        assert mapper.scan.provider is None
        for metres in (1.0, 2.0):
            components["laser"] = laser = Laser("laser")
            wiring.deployed(laser)
            laser.scan.put(metres=metres, points=[])
            assert (mapper.scan.value or {})["metres"] == metres

    simulate(main)


def test_a_component_with_wires_goes_to_another_process():
    async def main():
        watch = Watch()
        wired(Cell(), watch)
        copied = pickle.loads(pickle.dumps(watch))  # noqa: S301  # our own
        assert copied.battery.provider is None
        assert copied.battery.name == "watch.battery"

    simulate(main)


def test_instances_of_one_class_have_separate_ports():
    one, other = Watch("one"), Watch("other")
    assert one.battery is not other.battery
    assert (one.battery.name, other.battery.name) == ("one.battery", "other.battery")


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: QueryClient({"within": "number"}, answer={}),
        lambda: QueryClient({"a b": "number"}, answer={}),
        lambda: QueryClient({}, answer={}, source="."),
        lambda: SendClient(["text"]),  # type: ignore[arg-type]
        StateClient,
    ],
)
def test_a_required_port_is_declared_rightly(wrong):
    with pytest.raises(InputError):
        wrong()


# -- random wirings ----------------------------------------------------------------------------------------

NAMES, TYPES = ("a", "b", "c"), ("number", "text", "integer", None)
VALUES = st.dictionaries(st.sampled_from(NAMES), st.sampled_from(TYPES), max_size=3)


@st.composite
def _services(draw):
    pattern = draw(st.sampled_from(["push", "query"]))
    takes = draw(VALUES) if pattern == "query" else {}
    return Service(pattern, takes, draw(VALUES), draw(st.frozensets(st.sampled_from(NAMES))) & takes.keys())


def _offers(number, service):
    """Return a component that offers a service."""
    one = Component(f"offer_{number}")
    if service.pattern == "push":
        one.pushes["port"] = Push(service.gives)
    else:
        signature = Cell().skills()["lasts"]
        made = type(signature)(
            one.name, "port", service.takes, dict.fromkeys(service.defaults, 0), {"answered": service.gives}, "query"
        )
        one.skills = lambda: {"port": made}  # type: ignore[method-assign]
    return one


def _accepted(wanted, offered):
    """Return whether the service fits, by the words of the documentation."""

    def is_of(kind, other):
        return other is None or kind == other or (kind == "integer" and other == "number")

    return (
        wanted.pattern == offered.pattern
        and all(name in offered.gives and is_of(offered.gives[name], kind) for name, kind in wanted.gives.items())
        and all(name in offered.takes and is_of(kind, offered.takes[name]) for name, kind in wanted.takes.items())
        and all(name in wanted.takes or name in offered.defaults for name in offered.takes)
    )


@given(st.lists(_services(), max_size=4), st.lists(_services(), max_size=4))
def test_a_wiring_is_accepted_if_each_requirement_has_one_provider(wants, offers):
    user = Component("user")
    for number, service in enumerate(wants):
        user.requirements[f"port_{number}"] = Requirement(service).of("user", f"port_{number}")
    refused = {port.name for port, _ in wiring_errors([user, *[_offers(n, one) for n, one in enumerate(offers)]])}
    fitting = {f"user.port_{n}": sum(_accepted(wanted, one) for one in offers) for n, wanted in enumerate(wants)}
    assert refused == {name for name, count in fitting.items() if count != 1}


@pytest.mark.parametrize("far", [False, True])
def test_a_hosted_component_uses_components_of_its_program_and_of_others(far):
    async def main():
        transport, clock = LocalTransport(), LoopClock()
        cell, watch = Cell(), Watch()
        name_sources([watch], [cell, watch])
        assert watch.battery.source == "cell.lasts"
        here = Host(watch, transport, clock)
        there = [] if far else [Host(cell, transport, clock)]
        wires = asyncio.ensure_future(HostedWiring([watch] if far else [watch, cell], transport).run())
        await asyncio.sleep(5)
        if far:
            with pytest.raises(NotWiredError):
                await watch.battery.ask(watts=60.0)
            there = [Host(cell, transport, clock)]  # it starts later
            await asyncio.sleep(20)
        assert await watch.battery.ask(watts=60.0) == {"hours": 2.0}
        await watch.settings.set(reserve=5.0)
        assert cell.parameters.reserve == 5.0
        if far:
            await there[0].close()
            with pytest.raises((NoAnswerError, SkillError)):
                await watch.battery.ask(watts=60.0)
            there = [Host(Cell(hours=3.0), transport, clock)]
            await asyncio.sleep(20)
            assert await watch.battery.ask(watts=60.0) == {"hours": 3.0}
        wires.cancel()
        await asyncio.wait([wires])
        with pytest.raises(NotWiredError):
            await watch.battery.ask(watts=60.0)
        for host in (here, *there):
            await host.close()

    simulate(main)


def test_a_provider_of_another_program_that_does_not_fit_is_reported(caplog):
    async def main():
        transport, clock = LocalTransport(), LoopClock()
        watch = Watch()
        choose_sources([watch], {"watch.battery": "laser.scan"})
        hosts = [Host(watch, transport, clock), Host(Laser("laser"), transport, clock)]
        wires = asyncio.ensure_future(HostedWiring([watch], transport).run())
        await asyncio.sleep(5)
        with pytest.raises(NotWiredError):
            await watch.battery.ask(watts=60.0)
        wires.cancel()
        await asyncio.wait([wires])
        for host in hosts:
            await host.close()

    simulate(main)
    assert "port 'watch.battery' is not wired" in caplog.text


def test_an_error_of_wiring_has_the_line_of_the_port():
    lines = Path(__file__).read_text("utf-8").splitlines()
    ((_, error),) = wiring_errors([Laser("front"), Laser("rear"), Mapper()])
    assert error.place is not None
    assert lines[(error.place.line or 0) - 1].strip() == 'scan = Stream({"metres": "number"})'
    assert error.place.source == __file__
    ((_, missing),) = wiring_errors([Mapper()])
    assert missing.place == error.place
