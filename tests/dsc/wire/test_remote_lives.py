"""The life of a remote component: no loss of its host is silent, and slow hooks are no loss (S0.20, S2.6)."""

from __future__ import annotations

import asyncio

import pytest
from dsc_charts import plot
from dsc_runs import ran as ran_here

from dsc import Component, Library, LoopClock, Outcome, Sequencer, SkillCall, skill
from dsc.sequencer.clock import run_simulated
from dsc.testing import LossyTransport
from dsc.wire import Host, RemoteComponent
from dsc.wire.endpoint import LocalTransport
from knowledge_base import KnowledgeBase, Schema


class Moved(Outcome): ...


class Arm(Component):
    """An arm whose hooks take `seconds`, and whose skill takes 100 s."""

    name = "arm"

    def __init__(self, seconds=0.0):
        super().__init__()
        self.seconds = seconds
        self.log = []

    async def start(self):
        await asyncio.sleep(self.seconds)

    async def configure(self, parameter, value):
        await asyncio.sleep(self.seconds)
        self.log.append((parameter, value))

    async def switch(self, mode):
        await asyncio.sleep(self.seconds)
        self.log.append(mode)
        await super().switch(mode)

    @skill
    async def move(self, call: SkillCall, seconds: float) -> Moved:
        self.log.append("move")
        try:
            await call.clock.sleep(seconds)
        except asyncio.CancelledError:
            self.log.append("stopped")
            raise
        return Moved()


class Cut:
    """A transport that can be cut, which nobody reports; `reports` tells whether it reports the end of a program."""

    def __init__(self, inner, reports):
        self.inner = inner
        self.cut = False
        self.reports = reports
        self.earliest = 11 if isinstance(inner, LossyTransport) else 12  # the last answer before a cut may be lost

    def attach(self, address, receive):
        self.inner.attach(address, receive)

    def detach(self, address):
        self.inner.detach(address)

    def send(self, sender, to, frame):
        if not self.cut:
            self.inner.send(sender, to, frame)

    def watch(self, address, changed):
        return self.inner.watch(address, changed if self.reports else lambda _: None)


TRANSPORTS = {
    "local": LocalTransport,
    "lossy": lambda: LossyTransport(seed=3, loss=0.2, double=0.2, delay=0.1),
}


@pytest.fixture(params=TRANSPORTS)
def transport(request, reports):
    return Cut(TRANSPORTS[request.param](), reports)


@pytest.fixture(params=[True, False], ids=["reported", "silent"])
def reports(request):
    return request.param


def ran(text, transport, arm, meanwhile=None):
    """How the plot `p` ended with the arm behind a transport, its events by time, and the second of its end."""
    found = []

    async def main():
        hosts = [Host(arm, transport, LoopClock())]
        remote = await RemoteComponent.connect("arm", transport)
        clock = LoopClock()
        sequencer = Sequencer(Library([plot(text)]), KnowledgeBase(Schema()), [remote], clock)

        def keep(step):
            if step.event is not None:
                found.append((round(clock.now()), step.event.name, dict(step.event.attributes)))

        sequencer.listen(keep)
        busy = asyncio.ensure_future(meanwhile(hosts)) if meanwhile else None
        end = await sequencer.run("p")
        at = clock.now()
        if busy is not None:
            await busy
        await hosts[-1].close()
        return end, at

    return (*run_simulated(main()), found)


GONE = "'arm' is gone: its program has ended, or cannot be reached"
IDLE = "{plot: p, states: {a: {after: {seconds: 60, to: e}}, e: {final: true}}}"


def test_plots_hear_of_the_loss_and_the_return_of_an_unused_component(transport):
    async def crash(hosts):
        await asyncio.sleep(10)
        await hosts[0].close()
        await asyncio.sleep(20)
        hosts.append(Host(Arm(), transport, LoopClock()))

    end, _, found = ran(IDLE, transport, Arm(), crash)
    assert end.finished
    (lost, failed, why), (back, recovered, which) = found[:2]
    reason = GONE if transport.reports else "'arm' has not answered for 3 s"
    assert (failed, why) == ("component_failed", {"component": "arm", "reason": reason})
    assert lost == 10 if transport.reports else transport.earliest <= lost <= 13
    assert (recovered, which) == ("component_recovered", {"component": "arm"})
    assert 30 <= back <= 32


def test_plots_hear_of_a_restart_of_the_program_of_an_unused_component(transport):
    async def restart(hosts):
        await asyncio.sleep(10)
        await hosts[0].close()
        hosts.append(Host(Arm(), transport, LoopClock()))

    _, _, found = ran(IDLE, transport, Arm(), restart)
    assert [name for _, name, _ in found[:2]] == ["component_failed", "component_recovered"]
    assert found[0][2]["reason"] in {"the program of 'arm' was restarted", *([GONE] if transport.reports else ())}


def test_a_skill_fails_when_the_program_of_its_component_is_gone(transport):
    text = """
        plot: p
        states:
          a: {entry: {trigger: arm.move, with: {seconds: 100}}, on: {moved: x, skill_error: e}}
          x:
          e: {final: true}
    """

    async def crash(hosts):
        await asyncio.sleep(10)
        await hosts[0].close()

    end, _, found = ran(text, transport, Arm(), crash)
    assert end.finished, end
    (at, name, _), *_ = found
    assert name == "skill_error"
    assert at == 10 if transport.reports else transport.earliest <= at <= 13


def test_an_action_whose_stop_was_lost_is_stopped_when_the_host_answers_again(transport):
    text = """
        plot: p
        emits: {why: {why: text}}
        states:
          a: {entry: {trigger: arm.move, with: {seconds: 100}}, on: {moved: x, skill_error: {to: b, emit: why, with: {why: ?event.reason}}}}
          b: {after: {seconds: 60, to: e}}
          x:
          e: {final: true}
    """
    arm = Arm()

    async def cut(_):
        await asyncio.sleep(10)
        transport.cut = True
        await asyncio.sleep(10)
        assert arm.log == ["move"]
        transport.cut = False
        await asyncio.sleep(5)
        assert arm.log == ["move", "stopped"]

    end, _, found = ran(text, transport, arm, cut)
    assert end.finished, end
    assert "'arm' has not answered for 3 s" in end.emitted[0].attributes["why"]
    assert transport.earliest <= found[0][0] <= 13


@pytest.mark.parametrize("remote", [False, True])
def test_slow_hooks_are_no_loss(transport, remote):
    text = """
        plot: p
        states:
          a:
            entry: [{set: arm.speed, to: 2}, {switch: arm, to: fast}, {trigger: arm.move, with: {seconds: 1}}]
            on: {moved: e}
          e: {final: true}
    """
    arm = Arm(seconds=20)
    if remote:
        end, at, found = ran(text, transport, arm)
    else:
        (end, at), found = ran_here(text, arm), []
    assert end.finished, end
    assert arm.log == [("speed", 2), "fast", "move"]
    assert 61 <= at <= 66
    assert [name for _, name, _ in found] == (["moved"] if remote else [])


def test_a_skill_at_a_host_has_the_key_of_its_run():
    keys: list[str] = []

    class Keyed(Arm):
        async def execute(self, skill_name, call, arguments):
            keys.append(call.key)
            return await super().execute(skill_name, call, arguments)

    async def main():
        transport = LocalTransport()
        host = Host(Keyed(), transport, LoopClock())
        remote = await RemoteComponent.connect("arm", transport)
        text = (
            "{plot: p, states: {a: {entry: {trigger: arm.move, with: {seconds: 1}}, on: {moved: e}}, e: {final: true}}}"
        )
        library = Library([plot(text)])
        await Sequencer(library, KnowledgeBase(Schema()), [remote], LoopClock(), run_id="r7").run("p")
        await host.close()

    run_simulated(main())
    assert [key.split("/")[0] for key in keys] == ["r7"]
