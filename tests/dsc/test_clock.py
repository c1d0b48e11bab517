"""Time that jumps to what is due next, and stands still while a real answer is awaited."""

from __future__ import annotations

import asyncio
import time

import pytest

from dsc.sequencer.clock import LoopClock, run_real, run_simulated


def test_simulated_time_jumps_to_what_is_due_next():
    async def main():
        clock = LoopClock()
        began = time.monotonic()
        await clock.sleep(100_000.0)
        return clock.now(), time.monotonic() - began, clock.simulated

    now, real, simulated = run_simulated(main())
    assert now == pytest.approx(100_000.0)
    assert real < 1
    assert simulated


def test_sleepers_wake_in_the_order_of_their_times():
    async def main():
        clock, woken = LoopClock(), []

        async def sleeper(name, seconds):
            await clock.sleep(seconds)
            woken.append((name, round(clock.now(), 6)))

        await asyncio.gather(sleeper("c", 3), sleeper("a", 1), sleeper("b", 1), sleeper("d", 0))
        return woken

    assert run_simulated(main()) == [("d", 0.0), ("a", 1.0), ("b", 1.0), ("c", 3.0)]


def test_a_clock_begins_at_zero_when_it_is_made():
    async def main():
        await asyncio.sleep(5)
        clock = LoopClock()
        await clock.sleep(2)
        return clock.now()

    assert run_simulated(main()) == pytest.approx(2)


def test_every_simulated_run_begins_anew():
    async def main():
        await asyncio.sleep(5)
        return asyncio.get_running_loop().time()

    assert run_simulated(main()) == run_simulated(main()) == pytest.approx(5)


def test_a_hold_keeps_time_still_while_a_thread_works():
    async def main():
        clock, woken = LoopClock(), []

        async def sleeper():
            await clock.sleep(1)
            woken.append(clock.now())

        task = asyncio.create_task(sleeper())
        await asyncio.sleep(0)
        with clock.hold():
            await asyncio.to_thread(time.sleep, 0.02)
            still = clock.now(), list(woken)
        await task
        return still, woken

    still, woken = run_simulated(main())
    assert still == (0.0, [])
    assert woken == [pytest.approx(1)]


def test_holds_nest():
    async def main():
        clock = LoopClock()
        task = asyncio.create_task(clock.sleep(1))
        with clock.hold():
            with clock.hold():
                await asyncio.to_thread(lambda: None)
            await asyncio.to_thread(time.sleep, 0.01)
            held = clock.now()
        await task
        return held, clock.now()

    assert run_simulated(main()) == (0.0, pytest.approx(1))


def test_a_hold_ends_also_with_an_error():
    async def main():
        clock = LoopClock()
        with pytest.raises(RuntimeError), clock.hold():
            raise RuntimeError
        await clock.sleep(1)
        return clock.now()

    assert run_simulated(main()) == pytest.approx(1)


def test_real_time_passes_by_itself_and_holding_it_changes_nothing():
    async def main():
        clock = LoopClock()
        with clock.hold():
            await clock.sleep(0.01)
        return clock.now(), clock.simulated

    now, simulated = run_real(main())
    assert 0.005 < now < 5
    assert not simulated


def test_many_small_sleeps_do_not_drift():
    async def main():
        clock = LoopClock()
        for _ in range(1000):
            await clock.sleep(0.1)
        return clock.now()

    assert run_simulated(main()) == pytest.approx(100)
