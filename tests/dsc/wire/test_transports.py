"""Every transport passes the suite; endpoints forget what nobody asks for any more."""

from __future__ import annotations

import pytest

from dsc.components.component import Component
from dsc.sequencer.clock import LoopClock, run_real, run_simulated
from dsc.testing.faults import LossyTransport
from dsc.testing.transport_suite import TransportSuite
from dsc.wire.endpoint import Endpoint, LocalTransport
from dsc.wire.host import Host
from dsc.wire.publication import Publisher
from knowledge_base.errors import InputError


class TestLocal(TransportSuite):
    def transport(self):
        return LocalTransport()


class TestLocalInRealTime(TransportSuite):
    """What takes no time anyway."""

    run = staticmethod(run_real)

    def transport(self):
        return LocalTransport()

    test_a_call_has_a_timeout = None  # type: ignore[assignment]
    test_a_timed_push_comes_again_and_its_silence_is_noticed = None  # type: ignore[assignment]
    test_the_newest_value_arrives_and_time_never_runs_backwards = None  # type: ignore[assignment]
    test_components_are_active_while_an_active_component_needs_them = None  # type: ignore[assignment]
    test_a_silent_death_frees_what_the_dead_one_needed = None  # type: ignore[assignment]
    test_a_silent_death_is_noticed_and_a_return_too = None  # type: ignore[assignment]
    test_a_call_is_executed_once_and_answered = None  # type: ignore[assignment]
    test_a_skill_waits_for_needed_components_and_ends_without_them = None  # type: ignore[assignment]
    test_a_stream_of_something_else_is_refused_with_the_reason = None  # type: ignore[assignment]
    test_a_component_that_pushes_is_one_like_any_other = None  # type: ignore[assignment]


@pytest.mark.parametrize("seed", range(5))
class TestLossy(TransportSuite):
    @pytest.fixture(autouse=True)
    def _seeded(self, seed):
        self.seed = seed

    def transport(self):
        return LossyTransport(self.seed, loss=0.2, double=0.3, delay=0.3)


def test_a_lossy_transport_does_the_same_with_the_same_seed():
    def fates(seed):
        async def main():
            transport, arrived = LossyTransport(seed), []
            transport.attach("b", lambda sender, frame: arrived.append(frame))
            for n in range(100):
                transport.send("a", "b", str(n).encode())
            import asyncio

            await asyncio.sleep(1)
            return arrived

        return run_simulated(main())

    assert fates(1) == fates(1) != fates(2)
    assert fates(1) != sorted(fates(1), key=int)
    assert len(set(fates(1))) < len(fates(1))


def test_answers_are_forgotten_when_nobody_waits_for_them():
    async def main():
        transport = LocalTransport()
        server, client = Endpoint("server", transport), Endpoint("client", transport)

        async def big(_, __):
            return "x" * 1000

        server.answer("big", big)
        for _ in range(100):
            await client.call("server", "big")
        (peer,) = server._peers.values()
        return len(peer.answers)

    assert run_simulated(main()) <= 1


def test_an_address_is_not_taken_away_from_who_has_it():
    async def main():
        transport = LocalTransport()
        host = Host(Component("laser"), transport, LoopClock())
        with pytest.raises(InputError, match="'laser' is in use"):
            Endpoint("laser", transport)
        assert Publisher(host.endpoint, "scan").newest["n"] == 0
        await host.close()
        Endpoint("laser", transport)

    run_simulated(main())
