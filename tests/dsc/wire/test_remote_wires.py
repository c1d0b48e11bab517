"""Wires of hosted components that a run changes: at the host, reverted at exit, at the end of the run, and of the client."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from dsc import Component, Outcome, Push, SkillCall, Stream, parse_plot, query, skill
from dsc.components.clients import QueryClient
from dsc.components.wiring import choose_sources
from dsc.errors import NotWiredError
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.trace import Record
from dsc.wire.endpoint import LocalTransport
from dsc.wire.host import Host
from dsc.wire.hosted_wiring import HostedWiring
from dsc.wire.remote import RemoteComponent
from knowledge_base.errors import InputError
from planning import Robot

DOMAIN = "(define (domain wires) (:predicates (p)))"


class Named(Outcome):
    name: str


class Said(Outcome):
    name: str
    number: float


class Source(Component):
    period = 0.1
    echo = Push({"number": "number"})

    @query
    async def who(self) -> Named:
        await asyncio.sleep(1.0)
        return Named(name=self.name)

    async def step(self) -> None:
        self.echo.put(number={"left": 1, "middle": 2, "right": 3}[self.name])


class Probe(Component):
    name = "probe"
    needs = {"neutral": ("echo",)}  # noqa: RUF012
    source = QueryClient({}, answer={"name": "text"})
    echo = Stream({"number": "number"})

    @skill(after_crash="repeat")
    async def ask(self, call: SkillCall) -> Said:
        name = (await self.source.ask())["name"]
        return Said(name=name, number=(await self.echo.next(within=5))["number"])


PLOT = """
plot: visits
outputs:
  before: {type: text, initial: none}
  inside: {type: text, initial: none}
  seen: {type: number, initial: 0}
  cut: {type: text, initial: none}
  after_all: {type: text, initial: none}
  seen_after: {type: number, initial: 0}
states:
  settle: {after: {seconds: 5, to: before}}
  before:
    entry: {trigger: probe.ask}
    on: {said: {to: inside, assign: {before: ?event.name}}}
  inside:
    entry: [{wire: probe.source, to: left.who}, {wire: probe.echo, to: right.echo}]
    on: {done: after_all}
    states:
      wait: {after: {seconds: 2, to: ask}}
      ask:
        entry: {trigger: probe.ask}
        on: {said: {to: cut, assign: {inside: ?event.name, seen: ?event.number}}}
      cut:
        entry: [{unwire: probe.source}]
        after: {seconds: 2, to: ask_again}
      ask_again:
        entry: [{unwire: probe.source}, {trigger: probe.ask}]
        on:
          said: {to: over, assign: {cut: ?event.name}}
          skill_error: {to: over, assign: {cut: ?event.reason}}
      over: {final: true}
  after_all: {after: {seconds: 3, to: ask_at_last}}
  ask_at_last:
    entry: {trigger: probe.ask}
    on: {said: {to: end, assign: {after_all: ?event.name, seen_after: ?event.number}}}
  end: {final: true}
"""


class Cell:
    """Hosts of a probe and three sources, in one simulated program."""

    def __init__(self) -> None:
        self.transport, clock = LocalTransport(), LoopClock()
        self.probe = Probe()
        self.sources = [Source(name) for name in ("left", "middle", "right")]
        choose_sources([self.probe], {"probe.source": "middle.who", "probe.echo": "middle.echo"})
        self.hosts = [Host(one, self.transport, clock) for one in (self.probe, *self.sources)]
        self.wires = asyncio.ensure_future(HostedWiring([self.probe, *self.sources], self.transport).run())

    async def clients(self) -> list[Component]:
        return [await RemoteComponent.connect(name, self.transport) for name in ("probe", "left", "middle", "right")]

    async def close(self) -> None:
        self.wires.cancel()
        await asyncio.wait([self.wires])
        for host in self.hosts:
            await host.close()


def in_cell(main) -> Any:
    async def run() -> Any:
        cell = Cell()
        try:
            return await main(cell)
        finally:
            await cell.close()

    return run_simulated(run())


def test_a_state_changes_the_wires_of_a_hosted_component_until_its_exit():
    async def main(cell: Cell):
        with Robot(DOMAIN, [parse_plot(PLOT)], await cell.clients(), clock="simulated") as robot:
            records: list[Record] = []
            robot.listen(records.append)
            end = await robot.start("visits")
            assert end.reached, end
            outputs = dict(end.outputs)
        wires = [one.data["wires"] for one in records if one.type == "component" and one.data["component"] == "probe"]
        await asyncio.sleep(3)
        return outputs, wires, cell.probe.source.target

    outputs, wires, target = in_cell(main)
    assert outputs == {
        "before": "middle", "inside": "left", "seen": 3,
        "cut": "probe.ask: RefusedError: NotWiredError: port 'probe.source' is not wired", "after_all": "middle", "seen_after": 2,
    }  # fmt: skip
    assert wires[0] == {"source": "middle.who", "echo": "middle.echo"}
    assert {"source": "left.who", "echo": "right.echo"} in wires
    assert {"source": None, "echo": "right.echo"} in wires
    assert wires[-1] == wires[0]
    assert target == "middle.who"


def test_an_operator_changes_a_wire_and_the_end_of_the_run_restores_it():
    async def main(cell: Cell):
        text = "{plot: waits, receives: {go: }, states: {s: {on: {go: e}}, e: {final: true}}}"
        targets = [cell.probe.source.target]
        with Robot(DOMAIN, [parse_plot(text)], await cell.clients(), clock="simulated") as robot:
            run = robot.start("waits", open_ended=True)
            run.wire("probe.source", "right.who")
            await asyncio.sleep(1)
            targets.append(cell.probe.source.target)
            run.post("go")
            await run
        await asyncio.sleep(1)
        return [*targets, cell.probe.source.target]

    assert in_cell(main) == ["middle.who", "right.who", "middle.who"]


def test_a_pending_call_of_a_cut_wire_ends():
    async def main(cell: Cell):
        probe, *_ = await cell.clients()
        await asyncio.sleep(5)
        asked = asyncio.ensure_future(cell.probe.source.ask())
        heard = asyncio.ensure_future(cell.probe.echo.next(within=100))
        await asyncio.sleep(0.1)
        for port in probe.requirements.values():
            port.disconnect()
        for waits in (asked, heard):
            with pytest.raises(NotWiredError, match="was cut"):
                await waits

    in_cell(main)


def test_the_wires_of_a_client_that_is_gone_are_restored():
    async def main(cell: Cell):
        probe, left, *_ = await cell.clients()
        assert isinstance(probe, RemoteComponent)
        probe.requirements["source"].connect(_provider(left, "who"))
        await asyncio.sleep(1)
        during = cell.probe.source.target
        await probe._endpoint.close()  # as at the end of its program
        await asyncio.sleep(1)
        return during, cell.probe.source.target

    assert in_cell(main) == ("left.who", "middle.who")


def test_a_host_that_restarts_receives_the_wires_again():
    async def main(cell: Cell):
        probe, left, *_ = await cell.clients()
        probe.watch(watching=True)
        probe.requirements["source"].connect(_provider(left, "who"))
        await asyncio.sleep(1)
        await cell.hosts[0].close()
        cell.probe = Probe()
        choose_sources([cell.probe], {"probe.source": "middle.who"})
        cell.hosts[0] = Host(cell.probe, cell.transport, LoopClock())
        await asyncio.sleep(10)
        probe.watch(watching=False)
        return cell.probe.source.target

    assert in_cell(main) == "left.who"


def test_wires_that_the_host_cannot_make_are_refused():
    async def main(cell: Cell):
        here = Source("here")
        text = "{plot: waits, receives: {go: }, states: {s: {on: {go: e}}, e: {final: true}}}"
        with Robot(DOMAIN, [parse_plot(text)], [*await cell.clients(), here], clock="simulated") as robot:
            run = robot.start("waits", open_ended=True)
            for port, to, said in [
                ("probe.source", "here.who", "the host of 'probe.source' cannot reach 'here.who'"),
                ("probe.source", "left.echo", "has no query 'echo'"),
                ("probe.sauce", "left.who", "did you mean 'source'"),
            ]:
                with pytest.raises(InputError, match=said):
                    run.wire(port, to)
            run.post("go")
            await run

    in_cell(main)


def _provider(component: Component, port: str):
    from dsc.components.wiring import providers_of

    return next(one for one in providers_of(component) if one.port == port)
