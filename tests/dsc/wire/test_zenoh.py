"""The transport over Zenoh passes the suite: between sessions, between processes, and over a bad network."""

from __future__ import annotations

import asyncio
import builtins
import os
import random
import threading
from contextlib import asynccontextmanager
from itertools import cycle
from typing import Any

import pytest
from wire_programs import HostProgram, free_endpoint

from dsc.calls import SkillCall
from dsc.components.life_cycle import Life
from dsc.outcomes import Outcome
from dsc.sequencer.clock import LoopClock, run_real
from dsc.testing.transport_suite import PATIENCE, TransportSuite, until
from dsc.wire import Endpoint, RemoteComponent, ZenohTransport
from dsc.wire.heartbeat import SILENCE
from knowledge_base.errors import InputError

pytest.importorskip("zenoh", reason="the extra `zenoh` is not installed")
WHOLE = "WIRE" in os.environ
"""Whether all tests of the suite are executed, as `make test-wire` does; the longest take 10 s of real time each."""
LONG = {
    "test_a_call_is_executed_once_and_answered",
    "test_a_silent_death_is_noticed_and_a_return_too",
    "test_a_stream_of_something_else_is_refused_with_the_reason",
    "test_a_timed_push_comes_again_and_its_silence_is_noticed",
    "test_components_are_active_while_an_active_component_needs_them",
    "test_the_newest_value_arrives_and_time_never_runs_backwards",
    "test_a_skill_waits_for_needed_components_and_ends_without_them",
}
BRIEF = {
    "test_a_cancellation_arrives",
    "test_a_death_is_noticed_before_its_silence",
    "test_addresses_with_any_characters_are_different",
    "test_an_event_comes_once_for_each_time_it_happens",
    "test_commands_to_a_component_arrive_once_in_order",
}
"""The tests over a bad network without `WHOLE`."""


class Sessions:
    """Several sessions as one transport: each address is attached to the next session, and watched from another."""

    def __init__(self, *sessions):
        self.sessions = sessions
        self.next = cycle(sessions)
        self.of = {}

    def attach(self, address, receive):
        if address not in self.of:
            self.of[address] = next(self.next)
        self.of[address].attach(address, receive)

    def detach(self, address):
        if address in self.of:
            self.of[address].detach(address)

    def send(self, sender, to, frame):
        self.of[sender].send(sender, to, frame)

    def watch(self, address, changed):
        watching = next(one for one in self.sessions if one is not self.of.get(address))
        return watching.watch(address, changed)


class BadNetwork(Sessions):
    """Sessions that lose 5 % of the frames, double 5 %, and delay and so reorder all."""

    chance = random.Random(1)  # noqa: S311

    def send(self, sender, to, frame):
        for _ in range(self.chance.choices((0, 1, 2), (5, 90, 5))[0]):
            late = self.chance.uniform(0, 0.05)
            asyncio.get_running_loop().call_later(late, super().send, sender, to, frame)


class ZenohSuite(TransportSuite):
    """The suite between two sessions that know each other only through a third."""

    run = staticmethod(run_real)
    kind: type[Sessions] = Sessions

    @staticmethod
    def is_brief(test):
        return test not in LONG

    @pytest.fixture(autouse=True)
    def _closed(self, request):
        if not (WHOLE or self.is_brief(request.node.originalname)):
            pytest.skip("takes seconds: make test-wire")
        self.made: list[ZenohTransport] = []
        yield
        for one in self.made:
            one.close()

    def transport(self):
        endpoint = free_endpoint()
        hub = ZenohTransport(listen=[endpoint])
        self.made = [hub, *(ZenohTransport(connect=[endpoint]) for _ in range(2))]
        return self.kind(*self.made[1:])


class TestSessions(ZenohSuite):
    pass


class TestBadNetwork(ZenohSuite):
    kind = BadNetwork

    @staticmethod
    def is_brief(test):
        return test in BRIEF


# -- processes ---------------------------------------------------------------------------------------------


@asynccontextmanager
async def robot_at(endpoint):
    """The client of a robot that a program hosts on the endpoint."""
    with ZenohTransport(connect=[endpoint]) as transport:
        remote = await RemoteComponent.connect("robot", transport, PATIENCE)
        await remote.life.come_alive()
        remote.watch(True)
        try:
            yield remote
        finally:
            remote.watch(False)


def skill_call(action_id, reports=None):
    return SkillCall(action_id, LoopClock(), ([] if reports is None else reports).append)


async def seconds_until(holds):
    """How long it takes until `holds()` is true, to the millisecond."""
    loop = asyncio.get_running_loop()
    at = loop.time()
    async with asyncio.timeout(PATIENCE):
        while not holds():  # noqa: ASYNC110  # the condition may have no event
            await asyncio.sleep(0.001)
    return loop.time() - at


def test_a_program_executes_once_reports_in_order_and_is_cancelled():
    endpoint = free_endpoint()

    async def main():
        async with robot_at(endpoint) as remote:
            reports: list[Outcome] = []
            arguments = {"to": "kitchen", "steps": 5}
            outcome = await remote.execute("go", skill_call("a1.0", reports), arguments)
            assert outcome.attributes == {"to": "kitchen"}
            assert [one.attributes["n"] for one in reports] == list(range(5))
            assert await remote.execute("go", skill_call("a1.0"), arguments)
            task = asyncio.ensure_future(remote.execute("go", skill_call("a2.0"), {"to": "hall", "steps": 1000}))
            await asyncio.sleep(0.5)
            task.cancel()
            await asyncio.wait([task])

    with HostProgram(endpoint) as program:
        run_real(main())
        assert program.kill() == ["go kitchen", "go hall", "cancelled"]


def test_a_killed_program_is_noticed_at_once_and_so_is_its_next_life():
    endpoint = free_endpoint()

    async def main():
        async with robot_at(endpoint) as remote:
            await asyncio.sleep(0.5)  # the watch has begun
            program.kill()
            assert await seconds_until(lambda: remote.life.state is Life.FATAL_ERROR) < SILENCE / 3
            assert "'robot' is gone" in remote.life.reason
            with HostProgram(endpoint):
                await until(lambda: remote.life.state is not Life.FATAL_ERROR)
                await remote.life.come_alive()
                doubled = await remote.execute("doubled", skill_call("a1.0"), {"n": 4})
                assert doubled == Outcome("answered", {"n": 8})

    with HostProgram(endpoint) as program:
        run_real(main())


def test_a_program_that_hangs_is_noticed_and_recovers():
    endpoint = free_endpoint()

    async def main():
        async with robot_at(endpoint) as remote:
            program.stop()
            assert await seconds_until(lambda: remote.life.state is Life.FATAL_ERROR) < SILENCE
            program.go_on()
            await until(lambda: remote.life.state is not Life.FATAL_ERROR)
            await remote.life.come_alive()
            assert await remote.execute("doubled", skill_call("a1.0"), {"n": 1}) == Outcome("answered", {"n": 2})

    with HostProgram(endpoint) as program:
        run_real(main())


def test_a_transport_is_closed_soon_also_while_a_program_hangs():
    endpoint = free_endpoint()

    async def main():
        reports: list[bool] = []
        transport = ZenohTransport(connect=[endpoint], lease=0.5)
        transport.watch("robot", reports.append)
        await until(lambda: reports == [True])
        program.stop()
        await until(lambda: reports == [True, False])
        closed = asyncio.get_running_loop().time()
        transport.close()
        assert asyncio.get_running_loop().time() - closed < 2

    with HostProgram(endpoint) as program:
        run_real(main())


# -- one session -------------------------------------------------------------------------------------------


def test_frames_arrive_in_order_in_the_thread_of_the_loop_and_only_while_attached():
    received, threads = [], set()

    def receive(sender, frame):
        threads.add(threading.current_thread())
        received.append((sender, frame))

    async def main():
        with ZenohTransport() as transport:
            transport.attach("b", receive)
            for n in range(1000):
                transport.send("a", "b", str(n).encode())
            await until(lambda: len(received) == 1000)
            transport.send("a", "b", b"late")
            transport.detach("b")
            transport.detach("b")
            transport.attach("c", receive)
            transport.attach("d", receive)
            transport.send("c", "*", b"to all but c")
            await until(lambda: len(received) == 1001)
        transport.send("a", "d", b"after the end")
        await asyncio.sleep(0.1)

    run_real(main())
    assert received == [*(("a", str(n).encode()) for n in range(1000)), ("c", b"to all but c")]
    assert threads == {threading.main_thread()}


def test_a_transport_outlives_a_loop():
    with ZenohTransport() as transport:

        async def called():
            server, client = Endpoint("server", transport), Endpoint("client", transport)

            async def echo(_, body):
                return body

            server.answer("echo", echo)
            answer = await client.call("server", "echo", 1)
            await client.close()
            await server.close()
            return answer

        assert [run_real(called()) for _ in range(2)] == [1, 1]


def test_realms_are_separate():
    async def main():
        endpoint = free_endpoint()
        with ZenohTransport("red", listen=[endpoint]) as red, ZenohTransport("blue", connect=[endpoint]) as blue:
            received: list[object] = []
            reports: list[bool] = []
            red.attach("arm", lambda *frame: received.append(frame))
            blue.attach("leg", lambda *frame: received.append(frame))
            blue.watch("arm", reports.append)
            blue.send("leg", "arm", b"x")
            blue.send("leg", "*", b"x")
            await asyncio.sleep(0.3)
            assert (received, reports) == ([], [])

    run_real(main())


def test_mistakes_are_explained(tmp_path):
    endpoint = free_endpoint()
    broken, wrong = tmp_path / "broken.json5", tmp_path / "wrong.json5"
    broken.write_text("{ mode")
    wrong.write_text("{ mode: 'peer', nonsense: 1 }")
    with ZenohTransport(listen=[endpoint]):
        cases: list[tuple[dict[str, Any], str]] = [
            ({"listen": [endpoint]}, "in use.*; end the program that listens there, or listen on another port"),
            ({"listen": ["tcp/203.0.113.1:7447"]}, "Cannot assign.*; listen on an address of this machine"),
            ({"connect": ["somewhere"]}, "'somewhere' is not an endpoint of Zenoh: write protocol, host and port"),
            ({"connect": ["tcp/robot"]}, "'tcp/robot' is not an endpoint"),
            ({"lease": 0}, "the lease is between 0.1 and 3600 seconds, not 0"),
            ({"config": tmp_path / "none"}, "settings of Zenoh are a file, and .* is none"),
            ({"config": broken}, "settings of Zenoh cannot be read: "),
            ({"config": wrong}, "unknown field `nonsense`"),
        ]
        for settings, said in cases:
            with pytest.raises(InputError, match=said) as raised:
                ZenohTransport(**settings)
            assert ".rs:" not in str(raised.value)


def test_a_file_has_the_settings_of_zenoh(tmp_path):
    endpoint, file = free_endpoint(), tmp_path / "zenoh.json5"
    file.write_text(
        f"{{mode: 'peer', listen: {{endpoints: ['{endpoint}']}}, scouting: {{multicast: {{enabled: false}}}}}}"
    )
    with ZenohTransport(config=file), pytest.raises(InputError, match="in use"):
        ZenohTransport(config=file)
    with ZenohTransport(config=file), ZenohTransport(config=file, listen=["tcp/127.0.0.1:0"]):
        pass


def test_the_missing_extra_is_named(monkeypatch):
    imported = builtins.__import__

    def without_zenoh(name, *rest):
        if name == "zenoh":
            raise ModuleNotFoundError(name)
        return imported(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without_zenoh)
    with pytest.raises(InputError, match=r"pip install 'dynamic-state-charts\[zenoh\]'"):
        ZenohTransport()
