"""Periodic steps of a component, at a fixed frequency while the component is active (S4.13)."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

TOLERANCE = 0.1
"""Share of the period by which a step may begin after its due time without being late."""


@dataclass(slots=True)
class StepCounts:
    """Numbers of a component's periodic steps since its creation.

    Attributes:
        begun: steps that have begun.
        late: steps that began more than `TOLERANCE` periods after their due time.
        missed: due times without a step, as an earlier step or other code took more than a period.
    """

    begun: int = 0
    late: int = 0
    missed: int = 0


async def step_periodically(step: Callable[[], Awaitable[None]], period: float, counts: StepCounts) -> None:
    """Call a step immediately and at each multiple of the period, until its error or a cancellation.

    A due time never depends on the duration of earlier steps, so the frequency has no drift.

    Args:
        step: the step; steps never overlap.
        period: seconds of loop time between due times.
        counts: receives the numbers of steps.

    Raises:
        Exception: the error of a step.
    """
    loop = asyncio.get_running_loop()
    begin, number = loop.time(), 0
    while True:
        due = begin + number * period
        await _until(due)
        behind = loop.time() - due
        if behind >= period:
            passed = int(behind / period)
            counts.missed += passed
            number += passed
            continue
        counts.begun += 1
        counts.late += behind > TOLERANCE * period
        await step()
        number += 1


async def _until(due: float) -> None:
    """Wait until a second of loop time; `asyncio.sleep` would add a rounding error."""
    loop = asyncio.get_running_loop()
    arrived = loop.create_future()
    timer = loop.call_at(due, arrived.set_result, None)
    try:
        await arrived
    finally:
        timer.cancel()
