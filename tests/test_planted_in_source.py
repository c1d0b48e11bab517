"""Bugs planted in the source of one function each: bounds off by one, and what is done before what has to come first.

The function is compiled again with a few characters exchanged; the test that guards it must fail then. A bug that
cannot be planted any more fails as well: the code has changed, and the bug has to be looked for elsewhere.
"""

from __future__ import annotations

import asyncio
import inspect
import textwrap
from collections import Counter
from contextlib import suppress
from typing import Any

import pytest

from dsc.calls import SkillCall, Status
from dsc.components.component import Component
from dsc.components.frames import encoded
from dsc.dynamic.library import Library
from dsc.outcomes import Outcome
from dsc.runs.store import RunStore
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from dsc.text.plot_files import parse_plot
from dsc.trace import Trace
from dsc.wire.endpoint import Endpoint, LocalTransport
from dsc.wire.host import Host, HostedActions
from dsc.wire.remote import RemoteComponent
from knowledge_base import Delta, Fact, KnowledgeBase, Schema, StoreError
from knowledge_base.journal import history, journal
from knowledge_base.journal.history import MemoryHistory

SCHEMA = Schema.parse("(define (domain d) (:predicates (quiet)))")
QUIET, LOUD = Delta(added=(Fact("quiet"),)), Delta(removed=(Fact("quiet"),))


def exchanged(function, old, new):
    """The function with one part of its source exchanged, which has to stand there once."""
    source = textwrap.dedent(inspect.getsource(function))
    assert source.count(old) == 1, f"{function.__qualname__} has changed"
    made: dict[str, Any] = {}
    code = compile("from __future__ import annotations\n" + source.replace(old, new), "<planted>", "exec")
    exec(code, function.__globals__, made)  # noqa: S102  our own source but for a few characters
    return made[function.__name__]


# -- what must hold --------------------------------------------------------------------------------------


def exactly_the_last_keys_are_remembered():
    """A repeated key counts as long as it is one of the last `MOST_KEYS`, and not longer."""
    kb = KnowledgeBase(SCHEMA)
    most, history.MOST_KEYS = history.MOST_KEYS, 3
    try:
        for number in range(4):
            kb.apply(LOUD if number % 2 else QUIET, "a", key=f"key {number}")
        version = kb.version
        assert [kb.apply(LOUD, "a", key=f"key {number}").version for number in (1, 2, 3)] == [2, 3, 4]
        assert kb.version == version
        kb.apply(QUIET, "a", key="key 0")
        assert kb.version == version + 1
    finally:
        history.MOST_KEYS = most


def a_key_at_the_oldest_version_outlives_compaction(folder):
    """Its change is deleted with those before; what the key stands for is not."""
    for keep_since in (1, 2, 3):
        with KnowledgeBase.open(SCHEMA, folder / f"{keep_since}.kb") as kb:
            made = [kb.apply(LOUD if number % 2 else QUIET, "a", key=f"key {number}") for number in range(3)]
            kb.compact(keep_since)
            assert [kb.apply(QUIET, "a", key=f"key {number}") for number in range(3)] == made


def heard_of(*pushes):
    """What an endpoint hears of pushes that come from one sender, each with its life, number and body."""

    async def main():
        transport, said = LocalTransport(), []
        there = Endpoint("b", transport)
        there.receive("n", lambda _, body: said.append(body))
        for life, number, body in pushes:
            frame = {"what": "push", "kind": "n", "n": number, "low": number, "life": life, "body": body}
            transport.deliver("a", "b", encoded(frame))
        await there.close()
        return said

    return run_simulated(main())


def a_push_is_heard_once():
    """However often a network doubles it."""
    assert heard_of(("x", 1, 1), ("x", 1, 1), ("x", 2, 2), ("x", 2, 2), ("x", 1, 1)) == [1, 2]


def a_push_of_an_earlier_life_is_not_heard():
    """It was overtaken by the first word of the present one."""
    assert heard_of(("x", 1, "one"), ("y", 1, "new"), ("x", 2, "late")) == ["one", "new"]


class Did(Outcome): ...


class Arm(Component):
    """Takes its time to stop."""

    name = "arm"

    def __init__(self):
        super().__init__()
        self.log = []

    @skill
    async def work(self, call: SkillCall, seconds: float = 1.0) -> Did:
        """Work, and put things in order when cancelled."""
        self.log.append("begun")
        try:
            await call.clock.sleep(seconds)
        except asyncio.CancelledError:
            await call.clock.sleep(0.5)
            self.log.append("in order")
            raise
        self.log.append("done")
        return Did()


def remotely(judge):
    """Let `judge(arm, host, remote, clock)` use an arm on the other side of a transport."""

    async def main():
        transport, arm, clock = LocalTransport(), Arm(), LoopClock()
        host = Host(arm, transport, clock)
        remote = await RemoteComponent.connect("arm", transport)
        await judge(arm, host, remote, clock)
        await host.close()

    run_simulated(main())


def stopping_is_over_when_things_are_in_order():
    """The answer to `stop` comes after the action has ended, and until then a host knows it."""

    async def judge(arm, host, remote, clock):
        working = asyncio.ensure_future(remote.execute("work", SkillCall("7", clock, lambda _: None), {"seconds": 9}))
        await clock.sleep(1)
        stopping = asyncio.ensure_future(remote.abandon("7", "work", {}))
        await clock.sleep(0.1)
        assert await remote.status("7", "work", {}) is Status.RUNNING
        await stopping
        assert arm.log == ["begun", "in order"]
        await asyncio.gather(working, return_exceptions=True)

    remotely(judge)


def what_is_forgotten_here_is_forgotten_there():
    """A host does not grow with every action that was ever carried out."""

    async def judge(arm, host, remote, clock):
        for number in range(3):
            await remote.execute("work", SkillCall(str(number), clock, lambda _: None), {})
        assert len(host._actions.tasks()) == 3
        for number in range(3):
            await remote.forget(str(number))
        assert host._actions.tasks() == []

    remotely(judge)


class Remembering(Component):
    """Remembers ends until it is told to forget them."""

    name = "arm"

    def __init__(self):
        super().__init__()
        self.ends = []

    @skill(after_crash="same_id")
    async def work(self, call: SkillCall) -> Did:
        """End at once."""
        self.ends.append(call.action_id)
        return Did()

    async def forget(self, action_id: str) -> None:
        """It has been taken and is kept."""
        self.ends.remove(action_id)


TWO = "plot: p\nstates:\n  a: {entry: [{trigger: arm.work}], on: {did: b}}\n  b: {entry: [{trigger: arm.work}], on: {did: e}}\n  e: {final: true}\n"


def an_end_is_forgotten_only_when_it_is_kept(folder):
    """A commit that fails, one after the other: the robot still remembers what was not kept."""

    def remembered(path, fails_at):
        arm = Remembering()
        commits: Counter[str] = Counter()

        def fail(boundary):
            commits[boundary] += 1
            if commits["before commit"] == fails_at:
                raise StoreError("the disk is full")

        with KnowledgeBase.open(SCHEMA, path) as kb:
            store = RunStore(kb, path)
            store.writing.listen(fail)

            async def main():
                clock = LoopClock()
                await Sequencer(Library([parse_plot(TWO)]), kb, [arm], clock, Trace(clock.now), store=store).run("p")

            with suppress(StoreError):
                run_simulated(main())
        return len(arm.ends)

    assert [remembered(folder / f"{n}.kb", fails_at=n) for n in (1, 2, 3, 99)] == [0, 1, 1, 0]


# -- each of them planted --------------------------------------------------------------------------------

SETTLED = """
    if isinstance(message, SkillMessage) and message.final and not message.continues:
        self.dispatcher.settle(message.start)
    if self.store is None:"""
BUGS = {
    "one key too few is remembered": (
        MemoryHistory, "_remember", "> MOST_KEYS", ">= MOST_KEYS", exactly_the_last_keys_are_remembered),
    "keys are remembered for ever": (
        MemoryHistory, "_remember", "len(self._keys) > MOST_KEYS", "False", exactly_the_last_keys_are_remembered),
    "the newest key is forgotten": (
        MemoryHistory, "_remember", "next(iter(self._keys))", "key", exactly_the_last_keys_are_remembered),
    "a push is heard as often as it comes": (
        Endpoint, "_received", 'number > peer.newest', 'number >= peer.newest', a_push_is_heard_once),
    "a push of an earlier life is heard": (
        Endpoint, "_received", 'and self._lives.get(sender) == said["life"] and', "and", a_push_of_an_earlier_life_is_not_heard),
    "an action is unknown while it is being stopped": (
        HostedActions, "_stop", "if action is not None", "self._actions.pop(_key(said), None)\n    if action is not None",
        stopping_is_over_when_things_are_in_order),
    "a stop does not wait": (
        HostedActions, "_stop", "await asyncio.wait([action.task])", "pass", stopping_is_over_when_things_are_in_order),
    "a host forgets nothing": (
        RemoteComponent, "_release", 'await self._ask_about(action_id, "stop")', "pass",
        what_is_forgotten_here_is_forgotten_there),
    "an answer is settled before the commit": (
        Sequencer, "_take", "\n    if self.store is None:", SETTLED, an_end_is_forgotten_only_when_it_is_kept),
}  # fmt: skip


def judged(judge, folder):
    judge(*[folder] * len(inspect.signature(judge).parameters))


@pytest.mark.parametrize(
    "judge", dict.fromkeys([*(bug[-1] for bug in BUGS.values()), a_key_at_the_oldest_version_outlives_compaction])
)
def test_it_holds(judge, tmp_path):
    judged(judge, tmp_path)


@pytest.mark.parametrize("name", BUGS)
def test_a_planted_bug_is_caught(name, tmp_path, monkeypatch):
    owner, function, old, new, judge = BUGS[name]
    monkeypatch.setattr(owner, function, exchanged(getattr(owner, function), old, new))
    with pytest.raises(AssertionError):
        judged(judge, tmp_path)


def test_a_bound_of_what_is_forgotten_is_caught(tmp_path, monkeypatch):
    """`<` for `<=`: the key of the oldest version that is kept loses its change."""
    before = journal._FORGET
    planted = tuple(one.replace("delta IS NULL AND version <= ", "delta IS NULL AND version < ") for one in before)
    assert planted != before
    monkeypatch.setattr(journal, "_FORGET", planted)
    with pytest.raises((AssertionError, StoreError)):
        a_key_at_the_oldest_version_outlives_compaction(tmp_path)
