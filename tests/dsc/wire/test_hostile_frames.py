"""Whatever arrives at an address is answered, or dropped and counted; and what is kept of others is bounded."""

from __future__ import annotations

import asyncio
import json
import os
import sys

import pytest
from dsc_runs import SCHEMA, Ran
from hypothesis import given, settings
from hypothesis import strategies as st

from dsc import calls
from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.components.streams import Push, Stream
from dsc.errors import NoAnswerError, ProgrammingError, RefusedError
from dsc.outcomes import Outcome
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.skills import skill
from dsc.wire import endpoint as endpoints
from dsc.wire import host as hosts
from dsc.wire.endpoint import BROADCAST, Endpoint, LocalTransport
from dsc.wire.host import CONDITION, Host
from dsc.wire.publication import Subscription
from dsc.wire.remote import RemoteComponent
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta, fact
from knowledge_base.store import KnowledgeBase


class Ok(Outcome): ...


class Step(Outcome):
    n: float


class Robot(Component):
    name = "robot"
    scan = Push({"metres": "number"})
    other = Stream({"metres": "number"}, "peer.scan")

    @skill
    async def go(self, call: SkillCall[Step], steps=0) -> Ok:
        for n in range(steps):
            call.report(Step(n=n))
        return Ok()

    @skill
    async def exits(self, call) -> Ok:
        sys.exit("the driver")

    @skill
    async def closes(self, call) -> Ok:
        raise GeneratorExit

    @skill
    async def cancels(self, call) -> Ok:  # type: ignore[return]
        asyncio.current_task().cancel()
        await asyncio.sleep(0)

    @skill
    async def waits(self, call) -> Ok:  # type: ignore[return]
        await asyncio.sleep(1000)


EXAMPLES = int(os.environ.get("EXAMPLES", "30"))
"""Of each property; with more, this is a fuzzer."""
KINDS = [
    "hull", "come alive", "be active", "switch", "set", "set all", "take", "diagnose", "start", "how", "stop", "heartbeat",
    "subscribe scan", f"subscribe {CONDITION}", "push peer.scan", f"push robot.{CONDITION}", "news a1",
]  # fmt: skip
FIELDS = st.sampled_from([
    "run", "id", "skill", "arguments", "seconds", "heard", "needs", "mode", "parameter", "value", "port", "message", "life", "n", "reason", "metres",
])  # fmt: skip
PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3) | FIELDS, inner, max_size=5),
    max_leaves=8,
)
BODIES = PLAIN | st.fixed_dictionaries({
    "run": st.just("r") | PLAIN, "id": st.just("a") | PLAIN, "skill": st.sampled_from(["go", "exits", "waits"]) | PLAIN, "arguments": st.just({}) | PLAIN,
    "seconds": st.none() | PLAIN, "heard": st.just(0) | PLAIN, "mode": PLAIN, "n": st.integers(), "life": st.text(max_size=3), "value": PLAIN,
})  # fmt: skip
SAID = st.fixed_dictionaries({
    "what": st.sampled_from(["call", "push", "answer", "refusal"]) | PLAIN,
    "kind": st.sampled_from(KINDS) | PLAIN,
    "n": st.integers(0, 3) | PLAIN,
    "low": st.integers(0, 3) | PLAIN,
    "life": st.sampled_from(["l1", "l2", "known"]) | PLAIN,
    "body": BODIES,
})  # fmt: skip
FRAMES = (
    st.binary(max_size=30)
    | PLAIN.map(lambda value: json.dumps(value).encode())
    | SAID.map(lambda said: json.dumps(said).encode())
    | st.sampled_from(
        [
            b"[" * 100_000,
            b'{"n":' * 50_000,
            b"1" * 5_000,
            b'{"what": "call"',
            b"\xff\xfe",
            b"\x00",
            b'"\\ud800"',
            b"NaN",
        ]
    )
)


@given(st.lists(st.tuples(st.sampled_from(["peer", "robot", "x"]), FRAMES), max_size=8))
@settings(max_examples=EXAMPLES, deadline=None)
def test_a_host_answers_an_honest_caller_after_any_frames(frames):
    problems = []

    async def main():
        asyncio.get_running_loop().set_exception_handler(lambda _, context: problems.append(context))
        transport, clock = LocalTransport(), LoopClock()
        host = Host(Robot(), transport, clock)
        user = Endpoint("user", transport, life="known")
        subscription = Subscription(user, "robot", CONDITION)
        for sender, frame in frames:
            transport.deliver(sender, BROADCAST, frame)
            await asyncio.sleep(0.01)
        remote = await RemoteComponent.connect("robot", transport)
        assert set(remote.skills()) == {"go", "exits", "closes", "cancels", "waits", "watch_values"}
        assert await user.call("robot", "diagnose")
        assert subscription.value is None or isinstance(subscription.value, object)
        await host.close()

    run_simulated(main())
    assert not problems


@given(SAID, PLAIN, PLAIN)
@settings(max_examples=EXAMPLES, deadline=None)
def test_any_answer_of_a_host_gives_a_component_or_an_error_of_one_kind(said, hull, condition):
    async def main():
        transport = LocalTransport()
        host = Endpoint("robot", transport)

        async def answers(_, __):
            return hull if said["what"] == "call" else {"skills": [], "pushes": {}, "condition": condition}

        host.answer("hull", answers)
        try:
            await RemoteComponent.connect("robot", transport)
        except (NoAnswerError, RefusedError):
            return

    run_simulated(main())


def test_frames_that_are_none_are_counted():
    async def main():
        transport = LocalTransport()
        server = Endpoint("server", transport)
        for frame in (b"", b"[]", b"{}", b'{"what":"call","kind":7,"n":1,"low":1,"life":"l","body":0}'):
            transport.deliver("x", "server", frame)
        server.receive("news", lambda _, body: body["missing"])
        transport.deliver("x", "server", b'{"what":"push","kind":"news","n":1,"low":1,"life":"l","body":{}}')
        return server.dropped

    assert run_simulated(main()) == {"no frame": 4, "push 'news' that cannot be read": 1}


# -- bounds ------------------------------------------------------------------------------------------------


def frame(**said):
    return json.dumps({"what": "call", "kind": "count", "n": 1, "low": 1, "life": "l", "body": None} | said).encode()


def test_peers_are_bounded_and_nobody_known_is_served_twice(monkeypatch):
    monkeypatch.setattr(endpoints, "MOST_PEERS", 50)
    executed = []

    async def main():
        transport = LocalTransport()
        server = Endpoint("server", transport)

        async def count(sender, _):
            executed.append(sender)

        server.answer("count", count)
        transport.deliver("honest", "server", frame())
        for n in range(500):
            transport.deliver(f"flood{n}", "server", frame(life=str(n)))
        transport.deliver("honest", "server", frame())
        await asyncio.sleep(1)
        assert len(server._peers) == len(server._lives) == 50
        assert executed.count("honest") == 1
        assert server.dropped == {"too many peers": 451}
        await asyncio.sleep(2 * endpoints.REMEMBERED)
        transport.deliver("late", "server", frame())
        await asyncio.sleep(1)
        assert executed[-1] == "late"
        assert len(server._peers) == 1

    run_simulated(main())


def test_answers_to_one_peer_are_bounded(monkeypatch):
    monkeypatch.setattr(endpoints, "MOST_CALLS", 20)

    async def main():
        transport = LocalTransport()
        server = Endpoint("server", transport)
        for n in range(1, 500):
            transport.deliver("greedy", "server", frame(n=n, low=0))
        await asyncio.sleep(1)
        (peer,) = server._peers.values()
        assert len(peer.answers) == 20
        assert server.dropped == {"too many calls": 479}
        transport.deliver("greedy", "server", frame(n=500, low=500))
        assert len(peer.answers) == 1
        await asyncio.sleep(1)

    run_simulated(main())


def test_unclaimed_actions_are_bounded_and_those_going_on_too(monkeypatch):
    monkeypatch.setattr(hosts, "MOST_ACTIONS", 20)

    async def main():
        transport = LocalTransport()
        host, user = Host(Robot(), transport, LoopClock()), Endpoint("user", transport)

        async def start(n, name):
            said = {"run": "r", "id": f"a{n}", "skill": name, "arguments": {}, "seconds": None}
            await user.call("robot", "start", said)

        for n in range(100):
            await start(n, "go")
            await asyncio.sleep(0.01)
        assert len(host._actions._actions) == 20
        assert await user.call("robot", "how", {"run": "r", "id": "a0", "heard": 0}) is None
        assert await user.call("robot", "how", {"run": "r", "id": "a99", "heard": 0})
        for n in range(100, 120):
            await start(n, "waits")
        with pytest.raises(RefusedError, match="20 actions are running here"):
            await start(120, "waits")
        await host.close()

    run_simulated(main())


@pytest.mark.parametrize(
    ("name", "why"),
    [("exits", "SystemExit: the driver"), ("closes", "GeneratorExit"), ("cancels", "its task was cancelled")],
)
def test_a_skill_that_exits_does_not_end_its_host(name, why):
    async def main():
        transport, clock = LocalTransport(), LoopClock()
        host = Host(Robot(), transport, clock)
        remote = await RemoteComponent.connect("robot", transport)
        with pytest.raises(RefusedError if name == "cancels" else ProgrammingError, match=why):
            await remote.execute(name, SkillCall("a1", clock, print), {})
        assert await remote.execute("go", SkillCall("a2", clock, print), {}) == Outcome("ok")
        await host.close()

    run_simulated(main())


# -- reports -----------------------------------------------------------------------------------------------

FLOODED = """
    plot: p
    variables: {n: {type: number, initial: 0}, heard: {type: number, initial: 0}}
    emits: {last: {n: number, heard: number}}
    states:
      a:
        entry: {trigger: arm.SKILL, within: 100}
        on: {step: {assign: {n: ?event.n, heard: (+ ?heard 1)}}, ok: e}
      e: {final: true, emit: last, with: {n: ?n, heard: ?heard}}
"""


class Flooding(Component):
    name = "arm"

    def __init__(self, times):
        super().__init__()
        self.times = times

    def step(self, n):  # type: ignore[override]
        return Outcome(
            "step", {"n": n}, Delta(nodes={f"cup{n}": "item"}, added=(fact("seen", f"cup{n}"),) if n % 10 else ())
        )

    @skill
    async def floods(self, call) -> Ok | Step:
        for n in range(self.times):
            call.report(self.step(n))
        return Ok()

    @skill(blocking="thread")
    def floods_from_thread(self, call) -> Ok | Step:
        for n in range(self.times):
            call.report(self.step(n))
        return Ok()


@pytest.mark.parametrize("where", ["floods", "floods_from_thread"])
def test_a_flood_of_reports_is_conflated_and_no_knowledge_is_lost(where, monkeypatch):
    monkeypatch.setattr(calls, "MOST_WAITING", 50)
    most = []

    def watch(sequencer):
        sequencer.listen(lambda _: most.append(len(sequencer._inbox.waiting)))

    ran = Ran(FLOODED.replace("SKILL", where), arm=Flooding(2_000), prepare=watch)
    (last,) = ran.end.emitted
    events = [event for event in ran.of_type("event") if event["name"] == "step"]
    assert last.attributes["n"] == 1_999
    assert len(events) + sum(event.get("conflated", 0) for event in events) == 2_000
    assert len(ran.kb.query("(seen ?i)")) == 1_800
    assert max(most) <= 52
    if where == "floods":
        assert len(events) < 60


def test_reports_below_the_bound_all_arrive():
    ran = Ran(FLOODED.replace("SKILL", "floods"), arm=Flooding(calls.MOST_WAITING // 10))
    (last,) = ran.end.emitted
    assert last.attributes["heard"] == calls.MOST_WAITING // 10
    assert not any("conflated" in event for event in ran.of_type("event"))


def test_conflated_observations_come_to_the_same_knowledge(monkeypatch):
    monkeypatch.setattr(calls, "MOST_WAITING", 2)
    posted = []
    aside = calls.Reports(lambda outcome, conflated: posted.append((outcome, conflated)))
    deltas = [
        Delta(added=(fact("p"),)),
        Delta(removed=(fact("p"),)),
        Delta(added=(fact("q"),)),
        Delta(removed=(fact("q"),), added=(fact("p"),)),
    ]
    for n, delta in enumerate(deltas * 200):
        aside.put(Outcome("ab"[n % 2], {"n": n}, delta))
    aside.flush()
    kb = KnowledgeBase(SCHEMA)
    for outcome, _ in posted:
        kb.apply(outcome.observed, "arm")
    assert kb.ask("(p)")
    assert not kb.ask("(q)")
    assert [outcome.attributes["n"] for outcome, _ in posted] == [0, 1, 798, 799]
    assert len(posted) + sum(conflated for _, conflated in posted) == 800


def test_a_host_bounds_what_it_keeps_of_one_action(monkeypatch):
    monkeypatch.setattr(calls, "MOST_WAITING", 50)
    monkeypatch.setattr(hosts, "MOST_KEPT", 100)

    async def main():
        transport, clock = LocalTransport(), LoopClock()
        heard: list[Outcome] = []
        host = Host(Robot(), transport, clock)
        remote = await RemoteComponent.connect("robot", transport)
        await remote.execute("go", SkillCall("a1", clock, heard.append), {"steps": 2_000})
        assert heard[-1].attributes == {"n": 1_999}
        assert len(heard) < 60
        await host.close()

    run_simulated(main())


def test_messages_beyond_the_bound_are_refused_with_the_reason(monkeypatch):
    monkeypatch.setattr(endpoints, "MOST_BYTES", 1000)

    async def main():
        transport = LocalTransport()
        server, client = Endpoint("server", transport), Endpoint("client", transport)

        async def long(_, length):
            return "x" * length

        server.answer("long", long)
        assert await client.call("server", "long", 800) == 800 * "x"
        with pytest.raises(RefusedError, match="a message has at most 1000 bytes, not 10"):
            await client.call("server", "long", 1000)
        with pytest.raises(InputError, match="a message has at most 1000 bytes, not 10"):
            await client.call("server", "long", "x" * 1000)
        with pytest.raises(InputError, match="a message has at most 1000 bytes"):
            client.broadcast("news", "x" * 1000)
        transport.send("client", "server", b"{" + 1000 * b" ")
        await asyncio.sleep(0.1)
        assert server.dropped == {"too long": 1}

    run_simulated(main())
