"""Time that jumps to what is due next, and stands still while a real answer is awaited."""

from __future__ import annotations

import asyncio
import math
import time
import weakref
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from dsc.sequencer.clock import LoopClock, released, run_real, run_simulated
from knowledge_base import InputError


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


def test_calls_due_at_one_moment_come_in_the_order_of_their_requests():
    async def main():
        clock, woken = LoopClock(), []

        async def sleeper(name):
            await clock.sleep(3)
            woken.append(name)

        await asyncio.gather(*map(sleeper, range(20)))
        for number in range(20):
            clock.call_at(5.0, partial(woken.append, number))
        await clock.sleep_until(6.0)
        return woken

    assert run_simulated(main()) == [*range(20)] * 2


def test_a_due_call_may_cancel_another_call_due_at_the_same_moment():
    async def main():
        clock, called = LoopClock(), []
        others: list[Any] = []
        clock.call_at(1.0, lambda: others.pop().cancel())
        others.append(clock.call_at(1.0, lambda: called.append(1)))
        await clock.sleep(2)
        return called

    assert run_simulated(main()) == []


def test_a_moment_is_settled_when_nothing_more_happens_in_it():
    async def main():
        clock, heard = LoopClock(), []

        async def slowly():
            await clock.sleep(1)
            for number in range(5):
                await asyncio.sleep(0)
                heard.append(number)

        task = asyncio.get_running_loop().create_task(slowly())
        await clock.sleep(1)
        before = len(heard)
        await clock.settled()
        await task
        return before, heard, clock.now()

    assert run_simulated(main()) == (0, [0, 1, 2, 3, 4], 1.0)


def test_a_released_hold_lets_time_pass_and_another_one_still_holds_it():
    async def main():
        clock = LoopClock()
        with clock.hold():
            with released():
                await clock.sleep(1)
                with clock.hold():
                    task = asyncio.create_task(clock.sleep(1))
                    await asyncio.to_thread(time.sleep, 0.01)
                    held = clock.now()
            await asyncio.to_thread(time.sleep, 0.01)
            still = clock.now()
        await task
        return held, still, clock.now()

    assert run_simulated(main()) == (1.0, 1.0, 2.0)


def test_real_time_is_always_released():
    async def main():
        with LoopClock().hold(), released():
            await LoopClock().settled()
        return True

    assert run_real(main())


def test_a_cancelled_call_is_not_kept_until_its_due_moment():
    class Something:
        def __call__(self):
            woken.append(self)

    woken: list[Something] = []

    async def main():
        clock, made = LoopClock(), []
        for number in range(2000):
            something = Something()
            made.append(weakref.ref(something))
            handle = clock.call_at(1000.0 + number % 7, something)
            del something
            if number % 10:
                handle.cancel()
            del handle
        kept = sum(one() is not None for one in made)
        await clock.sleep(2000)
        return kept

    assert run_simulated(main()) < 2 * 200 + 101
    assert len(woken) == 200


# -- a finite speed ------------------------------------------------------------------------------------------


class Wall:
    """A real clock that passes only while a selector waits; real input arrives at given real seconds."""

    def __init__(self, monkeypatch, inputs=()):
        self.now, self.inputs = 0.0, list(inputs)
        monkeypatch.setattr("dsc.sequencer.clock.time.monotonic", lambda: self.now)
        monkeypatch.setattr("selectors.DefaultSelector.select", self.select)

    def select(self, timeout=None):
        due = self.inputs[0][0] if self.inputs else math.inf
        if timeout is not None and self.now + timeout < due:
            self.now += timeout
            return []
        assert due < math.inf, "the loop waits without end"
        self.now = max(self.now, due)
        self.inputs.pop(0)[1]()
        return [(SimpleNamespace(fileobj=None, data=(None, None)), 0)]


async def slept(seconds):
    clock = LoopClock()
    await clock.sleep(seconds)
    return clock.now()


@pytest.mark.parametrize(("speed", "real"), [(10.0, 2.0), (0.5, 40.0), (math.inf, 0.0)])
def test_a_run_lasts_as_long_as_its_speed_says(monkeypatch, speed, real):
    wall = Wall(monkeypatch)
    assert run_simulated(slept(20.0), speed=speed) == 20.0
    assert wall.now == pytest.approx(real)


@pytest.mark.parametrize("speed", [0.0, -1.0, math.nan])
def test_a_speed_is_positive(speed):
    with pytest.raises(InputError, match="a speed is a positive number"):
        run_simulated(slept(1.0), speed=speed)


def test_real_input_has_the_simulated_time_of_its_arrival(monkeypatch):
    async def main():
        clock, heard = LoopClock(), asyncio.Event()
        wall.inputs.append((1.5, heard.set))
        await heard.wait()
        arrived = clock.now()
        await clock.sleep(5.0)
        return arrived, clock.now()

    wall = Wall(monkeypatch)
    assert run_simulated(main(), speed=10.0) == (15.0, 20.0)


def test_time_does_not_catch_up_after_a_hold(monkeypatch):
    async def main():
        clock, answered = LoopClock(), asyncio.Event()
        wall.inputs.append((7.0, answered.set))
        with clock.hold():
            await answered.wait()
        held = clock.now()
        await clock.sleep(10.0)
        return held, clock.now()

    wall = Wall(monkeypatch)
    assert run_simulated(main(), speed=10.0) == (0.0, 10.0)
    assert wall.now == pytest.approx(8.0)
