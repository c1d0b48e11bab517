"""Test suite for any transport: subclass `TransportSuite` in a test file, with a method that creates a transport.

    class TestZenoh(TransportSuite):
        run = staticmethod(run_real)

        def transport(self) -> Transport:
            return ZenohTransport()

Two endpoints, or a hosted component and its client, communicate over one transport. The suite tests the guarantees of
the communication patterns. A transport may therefore lose, duplicate, delay and reorder frames.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager, suppress
from functools import partial, wraps
from typing import Any

import pytest

from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.components.life_cycle import Life
from dsc.components.streams import Stream
from dsc.components.wiring import Wiring
from dsc.errors import NoAnswerError, NotAliveError, ProgrammingError, RefusedError
from dsc.outcomes import Outcome
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.supervision.activation import ComponentActivation
from dsc.supervision.component_registry import ComponentRegistry
from dsc.supervision.skill_dependencies import SkillDependencies
from dsc.testing.suite_components import Laser, Mapper, SuiteRobot
from dsc.wire.endpoint import Endpoint, Transport
from dsc.wire.heartbeat import BEAT, SILENCE, Heartbeat
from dsc.wire.host import Host
from dsc.wire.publication import Publisher, Subscription
from dsc.wire.remote import RemoteComponent
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta, fact

PATIENCE = 20.0
"""Seconds of loop time within which each guarantee must be fulfilled."""


async def until(holds: Callable[[], bool]) -> None:
    """Wait until `holds()` is true; fail after `PATIENCE` seconds."""
    async with asyncio.timeout(PATIENCE):
        while not holds():  # noqa: ASYNC110  # the condition may have no event
            await asyncio.sleep(0.05)


@asynccontextmanager
async def running(*work: Coroutine[Any, Any, None]) -> AsyncIterator[list[asyncio.Task[None]]]:
    """Run coroutines during the block."""
    tasks = [asyncio.ensure_future(one) for one in work]
    try:
        yield tasks
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def in_loop(test: Callable[[TransportSuite], Coroutine[Any, Any, None]]) -> Callable[[TransportSuite], None]:
    """Convert a coroutine method to a test, which the suite's `run` executes."""

    @wraps(test)
    def tested(suite: TransportSuite) -> None:
        suite.run(test(suite))

    return tested


class TransportSuite:
    """The guarantees of the communication patterns, as tests.

    Attributes:
        run: runs a coroutine; use `run_real` for a transport that needs real time.
    """

    run: Callable[[Coroutine[Any, Any, Any]], Any] = staticmethod(run_simulated)

    def transport(self) -> Transport:
        """Return a new transport; called inside the running loop."""
        raise NotImplementedError

    # -- calls -------------------------------------------------------------------------------------------

    @in_loop
    async def test_a_call_is_executed_once_and_answered(self) -> None:
        """Each call is executed one time, for any number of frames."""
        transport, done = self.transport(), []
        server, client = Endpoint("server", transport), Endpoint("client", transport)

        async def note(sender: str, body: Any) -> Any:
            await asyncio.sleep(0.3)
            done.append((sender, body))
            return {"got": body}

        server.answer("note", note)
        for n in range(20):
            assert await client.call("server", "note", n, PATIENCE) == {"got": n}
        assert done == [("client", n) for n in range(20)]
        answers = await asyncio.gather(*(client.call("server", "note", n, PATIENCE) for n in range(20, 40)))
        assert answers == [{"got": n} for n in range(20, 40)]
        assert sorted(n for _, n in done) == list(range(40))

    @in_loop
    async def test_an_impossible_call_is_refused_with_its_reason(self) -> None:
        """Cases: a handler that raises an error, an unknown kind, an answer that is not plain data."""
        transport = self.transport()
        server, client = Endpoint("server", transport), Endpoint("client", transport)

        async def broken(_: str, __: Any) -> Any:
            raise RuntimeError("it is stuck")

        async def strange(_: str, __: Any) -> Any:
            return object()

        server.answer("broken", broken)
        server.answer("strange", strange)
        for kind, why in [("broken", "stuck"), ("strange", "plain data"), ("absent", "does not answer 'absent'")]:
            with pytest.raises(RefusedError, match=why):
                await client.call("server", kind, None, PATIENCE)

    @in_loop
    async def test_a_call_has_a_timeout(self) -> None:
        """Cases: an endpoint that never existed, and a closed one."""
        transport = self.transport()
        client, gone = Endpoint("client", transport), Endpoint("gone", transport)
        await gone.close()
        for to in ("nobody", "gone"):
            began = asyncio.get_running_loop().time()
            with pytest.raises(NoAnswerError, match=f"'{to}' has not answered 'x' within 1 s"):
                await client.call(to, "x", None, 1.0)
            assert asyncio.get_running_loop().time() - began >= 0.99

    @in_loop
    async def test_nothing_is_shared_by_accident(self) -> None:
        """Messages are encoded, also inside one process."""
        transport, kept = self.transport(), []
        server, client = Endpoint("server", transport), Endpoint("client", transport)

        async def keep(_: str, body: Any) -> Any:
            kept.append(body)

        server.answer("keep", keep)
        mine = {"list": [1]}
        await client.call("server", "keep", mine, PATIENCE)
        mine["list"].append(2)
        assert kept == [{"list": [1]}]
        with pytest.raises(InputError, match="only plain data"):
            await client.call("server", "keep", {"thing": object()}, PATIENCE)

    @in_loop
    async def test_a_restarted_host_has_a_new_identity(self) -> None:
        """The calls of a restarted endpoint are separate from its earlier calls."""
        transport, done = self.transport(), []
        server = Endpoint("server", transport)

        async def note(_: str, body: Any) -> Any:
            done.append(body)

        server.answer("note", note)
        for life in ("first", "second"):
            client = Endpoint("client", transport, life)
            for n in range(3):
                await client.call("server", "note", f"{life} {n}", PATIENCE)
            await client.close()
        assert done == [f"{life} {n}" for life in ("first", "second") for n in range(3)]

    # -- pushes ------------------------------------------------------------------------------------------

    @in_loop
    async def test_the_newest_value_arrives_and_time_never_runs_backwards(self) -> None:
        """*Push newest*: values may be lost, arrive in order, and the last one arrives."""
        transport = self.transport()
        seen: list[int] = []
        mine, theirs = Endpoint("user", transport), Endpoint("laser", transport)
        subscription, publisher = (
            Subscription(mine, "laser", "scan", lambda n, _: seen.append(n)),
            Publisher(theirs, "scan"),
        )
        async with running(subscription.run()):
            for n in range(50):
                publisher.put(n)
                await asyncio.sleep(0.1)
            await until(lambda: subscription.value == 49)
        assert seen == sorted(set(seen))

    @in_loop
    async def test_a_timed_push_comes_again_and_its_silence_is_noticed(self) -> None:
        """Values of a *push timed* port arrive periodically at another component, with the time since their `put`."""
        transport, laser, mapper = self.transport(), Laser(), Mapper()
        host, other = Host(laser, transport, LoopClock()), Host(mapper, transport, LoopClock())
        loop = asyncio.get_running_loop()
        laser.heat.put(celsius=20)
        at = loop.time()
        await until(lambda: mapper.heat.value == {"celsius": 20})
        for _ in range(5):
            await mapper.heat.next(2.0)
            assert abs(mapper.heat.age - (loop.time() - at)) < 2.0
        assert mapper.scan.value is None
        await host.close()
        await asyncio.sleep(2.0)  # messages may still be in transit
        with pytest.raises(NoAnswerError, match=r"nothing has come from 'laser\.heat' within 4 s"):
            await mapper.heat.next(4.0)
        assert mapper.heat.age > 3.0
        await other.close()

    @in_loop
    async def test_a_component_that_pushes_is_one_like_any_other(self) -> None:
        """A component's push ports and skills share its address, and remote components find both."""
        transport, laser, mapper = self.transport(), Laser(), Mapper()
        host, other = Host(laser, transport, LoopClock()), Host(mapper, transport, LoopClock())
        remote = await RemoteComponent.connect("laser", transport, PATIENCE)
        here = Mapper()
        wiring = Wiring({"laser": remote, "mapper": here})
        for n in range(10):
            laser.scan.put(metres=n)
            await asyncio.sleep(0.1)
        await until(lambda: mapper.scan.value == here.scan.value == {"metres": 9})
        call = SkillCall("a8.0", LoopClock(), lambda _: None)
        assert await remote.execute("measure", call, {}) == Outcome("answered", {"metres": 9})
        wiring.close()
        await host.close()
        await other.close()

    @in_loop
    async def test_a_stream_of_something_else_is_refused_with_the_reason(self) -> None:
        """Case: the publisher lacks a value of the subscription."""
        transport, mapper = self.transport(), Mapper()
        mapper.scan = mapper.requirements["scan"] = Stream({"meters": "number"}, "laser.scan")
        hosts = [Host(one, transport, LoopClock()) for one in (Laser(), mapper)]
        with pytest.raises(NoAnswerError, match=r"'laser\.scan' pushes no 'meters'; did you mean 'metres'"):
            await mapper.scan.next(PATIENCE / 2)
        for host in hosts:
            await host.close()

    @in_loop
    async def test_values_of_a_restarted_publisher_arrive(self) -> None:
        """The publisher restarts its count, and its subscribers receive its values again."""
        transport = self.transport()
        subscription = Subscription(Endpoint("user", transport), "laser", "scan")
        async with running(subscription.run()):
            for value in ("first", "second"):
                theirs = Endpoint("laser", transport)
                Publisher(theirs, "scan").put(value)
                await until(lambda value=value: subscription.value == value)  # type: ignore[misc]
                await theirs.close()

    # -- presence ----------------------------------------------------------------------------------------

    @in_loop
    async def test_the_presence_of_an_address_is_reported(self) -> None:
        """Cases: an address that appears, disappears and returns, one that was there before, and an ended watch."""
        transport, reports = self.transport(), list[bool]()
        stop = transport.watch("server", reports.append)
        for number in range(2):
            server = Endpoint("server", transport)
            await until(lambda n=number: reports == [True, False] * n + [True])  # type: ignore[misc]
            await server.close()
            await until(lambda n=number: reports == [True, False] * (n + 1))  # type: ignore[misc]
        stop()
        server, late = Endpoint("server", transport), list[bool]()
        await asyncio.sleep(1.0)
        ends = [transport.watch("server", late.append) for _ in range(2)]
        await until(lambda: late == [True, True])
        ends[0]()
        ends[0]()  # the end of an ended watch does nothing
        await server.close()
        await until(lambda: late == [True, True, False])
        assert reports == [True, False, True, False]

    @in_loop
    async def test_addresses_with_any_characters_are_different(self) -> None:
        """Case: characters that have a meaning in the keys, paths or patterns of a transport."""
        transport = self.transport()
        addresses = ["a/b", "a", "a/*", "**", "a?b#c", "a$*", "%2F", " ", "für Arm 7", "@x", "{}"]
        received: dict[str, list[Any]] = {address: [] for address in addresses}
        present: dict[str, list[bool]] = {address: [] for address in addresses}
        for address in addresses:
            transport.watch(address, present[address].append)
        client = Endpoint("client/*", transport)

        async def note(to: str, sender: str, body: Any) -> None:
            received[to].append((sender, body))

        for address in addresses:
            Endpoint(address, transport).answer("note", partial(note, address))
        for address in addresses:
            await client.call(address, "note", address, PATIENCE)
        assert received == {address: [("client/*", address)] for address in addresses}
        await until(lambda: all(reports == [True] for reports in present.values()))

    @in_loop
    async def test_a_death_is_noticed_before_its_silence(self) -> None:
        """The component is in FatalError when its address has disappeared, and recovers when the address returns."""
        async with self._robot() as (_, remote, host):
            remote.watch(True)  # noqa: FBT003
            await asyncio.sleep(1.0)
            assert remote.life.state is Life.ALIVE
            at = asyncio.get_running_loop().time()
            await host.close()
            await until(lambda: remote.life.state is Life.FATAL_ERROR)
            assert remote.life.reason == "'robot' is gone: its program has ended, or cannot be reached"
            assert asyncio.get_running_loop().time() - at < SILENCE / 2
            again = Host(SuiteRobot(), remote._transport, LoopClock())  # noqa: SLF001
            await until(lambda: remote.life.state is not Life.FATAL_ERROR)
            remote.watch(False)  # noqa: FBT003
            await again.close()

    @in_loop
    async def test_the_needs_of_a_dead_activator_end_before_its_silence(self) -> None:
        """The address of the activator disappears without a last heartbeat."""
        transport = self.transport()

        async def ignore(_: bool) -> None:  # noqa: FBT001
            pass

        arm, motor = Endpoint("arm", transport), Heartbeat(Endpoint("motor", transport), list, ignore)
        async with running(motor.run()):
            task = asyncio.ensure_future(Heartbeat(arm, lambda: ["motor"], ignore, root=True).run())
            await until(lambda: motor.active)
            await asyncio.sleep(1.0)
            arm.broadcast = lambda *_: None  # type: ignore[method-assign]
            await asyncio.sleep(0.5)  # messages may still be in transit
            at = asyncio.get_running_loop().time()
            await arm.close()
            await until(lambda: not motor.active)
            assert asyncio.get_running_loop().time() - at < SILENCE / 2
            task.cancel()

    # -- components --------------------------------------------------------------------------------------

    @asynccontextmanager
    async def _robot(self) -> AsyncIterator[tuple[SuiteRobot, RemoteComponent, Host]]:
        transport, robot = self.transport(), SuiteRobot()
        host = Host(robot, transport, LoopClock())
        remote = await RemoteComponent.connect("robot", transport, PATIENCE)
        await remote.life.come_alive()
        try:
            yield robot, remote, host
        finally:
            await host.close()

    @in_loop
    async def test_a_skill_reports_in_order_and_ends_once(self) -> None:
        """The outcome has its observations; a repeated request with an equal id executes nothing."""
        async with self._robot() as (robot, remote, _):
            assert remote.skills() == robot.skills()
            assert robot.life.state is Life.ALIVE
            reports: list[Outcome] = []
            call = SkillCall("a1.0", LoopClock(), reports.append)
            outcome = await remote.execute("go", call, {"to": "kitchen", "steps": 5})
            assert outcome == Outcome("there", {"to": "kitchen"}, Delta(added=(fact("at", "kitchen"),)))
            assert [one.attributes["n"] for one in reports] == list(range(5))
            assert robot.log == ["go kitchen"]

    @in_loop
    async def test_a_skill_that_fails_there_fails_here(self) -> None:
        """The error has the reason of the failure at the host."""
        async with self._robot() as (_, remote, __):
            with pytest.raises(ProgrammingError, match=r"robot.fall: RuntimeError: a2\.0 fell"):
                await remote.execute("fall", SkillCall("a2.0", LoopClock(), lambda _: None), {})

    @in_loop
    async def test_a_cancellation_arrives(self) -> None:
        """The component is cancelled before the caller continues."""
        async with self._robot() as (robot, remote, _):
            call = SkillCall("a3.0", LoopClock(), lambda _: None)
            task = asyncio.ensure_future(remote.execute("go", call, {"to": "kitchen", "steps": 1000}))
            await until(lambda: bool(robot.log))
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task
            assert robot.log == ["go kitchen", "cancelled"]

    @in_loop
    async def test_a_silent_death_is_noticed_and_a_return_too(self) -> None:
        """The skill fails, and the component is in FatalError; the next skill connects to it again."""
        transport, robot = self.transport(), SuiteRobot()
        host = Host(robot, transport, LoopClock())
        remote = await RemoteComponent.connect("robot", transport, PATIENCE)
        await remote.life.come_alive()
        call = SkillCall("a4.0", LoopClock(), lambda _: None)
        task = asyncio.ensure_future(remote.execute("go", call, {"to": "kitchen", "steps": 1000}))
        await until(lambda: bool(robot.log))
        await host.close()
        with pytest.raises(NoAnswerError):
            await task
        assert remote.life.state == "fatal_error"
        again = Host(SuiteRobot(), transport, LoopClock())
        await remote.life.come_alive()
        assert remote.life.state == "alive"
        assert await remote.execute("doubled", SkillCall("a5.0", LoopClock(), lambda _: None), {"n": 4}) == Outcome(
            "answered", {"n": 8}
        )
        await again.close()

    @in_loop
    async def test_commands_to_a_component_arrive_once_in_order(self) -> None:
        """Calls of the ports *param* and *send* arrive in sequence."""
        async with self._robot() as (robot, remote, _):
            for n in range(10):
                await remote.configure("speed", n)
                await remote.receive("say", {"text": f"now {n}"})
            assert robot.log == [one for n in range(10) for one in (("speed", n), f"now {n}")]
            robot.log.clear()
            await remote.configure_all({"speed": 3, "gear": 2})
            assert robot.log == [("speed", 3), ("gear", 2)]
            await remote.change_mode("resting")
            assert (await remote.diagnose())["mode"] == "resting"

    @in_loop
    async def test_changed_needs_of_a_component_are_announced(self) -> None:
        """Cases: the client has changed the component's mode, or the component itself has."""
        async with self._robot() as (robot, remote, _):
            assert remote.needed() == ()
            await remote.change_mode("scanning")
            assert remote.needed() == ("power", "light")
            # A client only watches the host of an active component.
            await remote.life.become_active(1, active=True)
            robot.mode = "resting"
            await until(lambda: remote.mode == "resting")
            assert remote.needed() == ()
            await remote.life.become_active(1, active=False)

    @in_loop
    async def test_a_skill_waits_for_needed_components_and_ends_without_them(self) -> None:
        """Cases: a required component is local or remote, is deployed late, is lost without a message, and returns."""
        transport, robot, clock = self.transport(), SuiteRobot(), LoopClock()
        robot.mode = "scanning"
        host = Host(robot, transport, clock)
        remote = await RemoteComponent.connect("robot", transport, PATIENCE)
        registry = ComponentRegistry({"robot": remote, "light": Component("light")})
        activity = ComponentActivation(registry, lambda: {"robot"})
        support = SkillDependencies(activity, remote)
        waiting = asyncio.ensure_future(support.ready())
        await asyncio.sleep(2.0)
        assert not waiting.done()
        for n in range(2):
            power = Host(Component("power"), transport, clock)
            await asyncio.wait_for(waiting, PATIENCE)
            call = SkillCall(f"a7.{n}", clock, lambda _: None)
            work = remote.execute("go", call, {"to": "kitchen", "steps": 1000})
            working = asyncio.ensure_future(support.carrying(work))
            await until(lambda n=n: len(robot.log) == 2 * n + 1)  # type: ignore[misc]
            await power.close()
            with pytest.raises(NotAliveError, match="it needs component 'power', which is in 'fatal_error'"):
                await asyncio.wait_for(working, PATIENCE)
            assert robot.log[-1] == "cancelled"
            assert remote.life.state == "alive"
            support = SkillDependencies(activity, remote)
            waiting = asyncio.ensure_future(support.ready())
        waiting.cancel()
        await host.close()

    @in_loop
    async def test_an_event_comes_once_for_each_time_it_happens(self) -> None:
        """Events arrive in order, until the deactivation."""
        async with self._robot() as (robot, remote, _):
            heard: list[Any] = []
            call = SkillCall("a6.0", LoopClock(), lambda outcome: heard.append(outcome.attributes["level"]))
            async with running(_watch_low(remote, call)):
                await until(lambda: robot.activations.active("low"))
                for level in (30, 19, 18, 25, 15, 10, 40, 5):
                    robot.update("low", level)
                await until(lambda: len(heard) == 3)
            assert heard == [19, 15, 5]
            assert not robot.activations.active("low")

    @in_loop
    async def test_a_hosted_component_is_active_while_it_is_needed(self) -> None:
        """The component acquires its resources, and releases them."""
        transport, told = self.transport(), []

        class Camera(Component):
            async def activate(self, active: bool) -> None:  # noqa: FBT001
                told.append(active)

        async def ignore(_: bool) -> None:  # noqa: FBT001
            pass

        host = Host(Camera(), transport, LoopClock())
        root = Heartbeat(Endpoint("sequencer", transport), lambda: ["camera"], ignore, root=True)
        async with running(root.run()):
            await until(lambda: told == [True])
        await until(lambda: told == [True, False])
        await host.close()

    # -- activation trees --------------------------------------------------------------------------------

    @in_loop
    async def test_components_are_active_while_an_active_component_needs_them(self) -> None:
        """Activation proceeds from the root downwards, in any order of arrival.

        A component becomes inactive when its activator ends, or no longer needs it.
        """
        transport = self.transport()
        active: set[str] = set()
        needs = {"root": ["arm"], "arm": ["motor"], "motor": [], "camera": []}
        hearts: dict[str, Heartbeat] = {}

        def heart(name: str) -> Coroutine[Any, Any, None]:
            async def changed(now: bool) -> None:  # noqa: FBT001
                (active.add if now else active.discard)(name)

            endpoint = Endpoint(name, transport)
            hearts[name] = Heartbeat(endpoint, lambda: needs[name], changed, root=name == "root")
            return hearts[name].run()

        async with running(heart("root"), heart("motor"), heart("camera")) as tasks:
            await asyncio.sleep(4 * BEAT)
            assert active == {"root"}
            async with running(heart("arm")):  # late
                await until(lambda: active == {"root", "arm", "motor"})
                await asyncio.sleep(3 * SILENCE)
                assert active == {"root", "arm", "motor"}
                assert hearts["motor"].activators == {"arm"}
                needs["arm"] = ["camera"]  # the arm enters another state
                hearts["arm"].stir()
                await until(lambda: active == {"root", "arm", "camera"})
            await until(lambda: active == {"root"})
            tasks[0].cancel()
            await until(lambda: not active)

    @in_loop
    async def test_a_silent_death_frees_what_the_dead_one_needed(self) -> None:
        """Case: the dead component sends no last message."""
        transport, told = self.transport(), []

        async def ignore(_: bool) -> None:  # noqa: FBT001
            pass

        async def note(now: bool) -> None:  # noqa: FBT001
            told.append(now)

        dying = Endpoint("arm", transport)
        arm = Heartbeat(dying, lambda: ["motor"], ignore, root=True)
        motor = Heartbeat(Endpoint("motor", transport), list, note)
        async with running(motor.run()):
            task = asyncio.ensure_future(arm.run())
            await until(lambda: told == [True])
            transport.detach("arm")
            dying.broadcast = lambda *_: None  # type: ignore[method-assign]
            assert motor.activators == {"arm"}
            await until(lambda: told == [True, False])
            assert not motor.activators
            task.cancel()


async def _watch_low(remote: RemoteComponent, call: SkillCall) -> None:
    await remote.execute("low", call, {"below": 20})
