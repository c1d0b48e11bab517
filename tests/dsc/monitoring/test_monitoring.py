"""Monitoring: selected entries and streams of components, at each change or periodically, near and far."""

from __future__ import annotations

import asyncio

import pytest

from dsc.components.component import Component
from dsc.components.parameters import Parameters, parameter
from dsc.components.streams import Push
from dsc.monitoring.charts import draw_observations
from dsc.monitoring.monitor import Monitor, Observation
from dsc.monitoring.profile import parse_monitoring
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.wire.endpoint import LocalTransport
from dsc.wire.host import Host
from dsc.wire.remote import RemoteComponent
from knowledge_base.errors import InputError, UnknownNameError

PROFILE = """
monitor: cell
sample: 0.5
components:
  laser:
    diagnose: {life: change, parameters.range: change, mode: 2}
    streams: {echo: change, heat: 1}
"""


class LaserParameters(Parameters):
    range: float = parameter(8.0, least=1.0, most=20.0)


class Laser(Component):
    name = "laser"
    modes = ("scanning",)
    parameters: LaserParameters
    echo = Push({"metres": "number"})
    heat = Push({"celsius": "number"})


def of(found: list[Observation], entry: str):
    return [(one.seconds, one.value) for one in found if one.entry == entry]


@pytest.mark.parametrize("far", [False, True])
def test_values_are_reported_at_changes_or_periodically(far):
    async def main():
        laser, found = Laser(), list[Observation]()
        transport = LocalTransport()
        host = Host(laser, transport, LoopClock()) if far else None
        watched = await RemoteComponent.connect("laser", transport) if far else laser
        run = asyncio.ensure_future(Monitor(parse_monitoring(PROFILE), {"laser": watched}, found.append).run())
        await asyncio.sleep(0.2)
        await laser.life.come_alive()
        laser.echo.put(metres=1.0)
        for celsius in range(30):
            laser.heat.put(celsius=celsius)
            await asyncio.sleep(0.1)
        laser.echo.put(metres=1.0)
        await laser.configure("range", 5.0)
        laser.echo.put(metres=2.0)
        await asyncio.sleep(1.8)
        run.cancel()
        await asyncio.wait([run])
        if host is not None:
            await host.close()
        return found

    found = run_simulated(main())
    assert [value for _, value in of(found, "life")] == ["init", "alive"]
    assert [value for _, value in of(found, "parameters.range")] == [8.0, 5.0]
    assert [value for _, value in of(found, "mode")] == ["neutral"] * 3
    assert [value for _, value in of(found, "echo")] == [{"metres": 1.0}, {"metres": 2.0}]
    assert len(of(found, "heat")) == 3
    assert {one.component for one in found} == {"laser"}


def test_a_component_without_an_answer_is_reported_and_observed_again():
    async def main():
        transport, found = LocalTransport(), list[Observation]()
        host = Host(Laser(), transport, LoopClock())
        watched = await RemoteComponent.connect("laser", transport)
        run = asyncio.ensure_future(Monitor(parse_monitoring(PROFILE), {"laser": watched}, found.append).run())
        await asyncio.sleep(2)
        await host.close()
        await asyncio.sleep(30)
        host = Host(Laser(), transport, LoopClock())
        await asyncio.sleep(30)
        run.cancel()
        await asyncio.wait([run])
        await host.close()
        return of(found, "problem")

    (lost, reason), (again, none) = run_simulated(main())
    assert "has not answered" in reason
    assert none is None
    assert lost < 32 < again


@pytest.mark.parametrize(
    ("old", "new", "line", "said"),
    [
        ("  laser:", "  lasor:", 5, "there is no component 'lasor'; did you mean 'laser'?"),
        ("echo: change", "eco: change", 7, "there is no push port of component 'laser' with the name 'eco'"),
        ("parameters.range", "parameters.rang", 6, "has no entry 'parameters.rang'; did you mean 'parameters.range'?"),
        ("heat: 1", "heat: 0", 7, "a positive number of seconds; found 0"),
        ("echo: change", "echo: chang", 7, "the time is `change`, or a positive number of seconds; found 'chang'"),
        ("sample", "samples", 3, "did you mean 'sample'?"),
    ],
)
def test_a_mistake_has_its_place(old: str, new: str, line: int, said: str):
    async def main():
        async with asyncio.timeout(5):
            await Monitor(parse_monitoring(PROFILE.replace(old, new), "m.yaml"), {"laser": Laser()}, print).run()

    with pytest.raises((InputError, UnknownNameError)) as error:
        run_simulated(main())
    assert said in str(error.value)
    assert str(error.value).startswith(f"m.yaml:{line}")


def test_the_diagnosis_has_the_use_of_the_program():
    found = asyncio.run(Laser().diagnose())["program"]
    assert found["processor_s"] > 0
    assert found["memory_mib"] is None or found["memory_mib"] > 1


def test_numbers_are_drawn_as_lines_and_words_at_their_times():
    found = [
        Observation(0.0, "laser", "life", "Init"),
        Observation(2.0, "laser", "life", "Alive"),
        *(Observation(float(n), "laser", "heat", {"celsius": 20 + n}) for n in range(5)),
    ]
    drawn = draw_observations("cell", found)
    assert drawn.count('class="line"') == 1
    for text in ("laser.heat.celsius", "laser.life", "Init", "Alive", "24", "20"):
        assert f">{text}<" in drawn
    assert "<svg" in draw_observations("nothing", [])
