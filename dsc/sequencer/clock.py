"""Time, injected: real seconds, or simulated ones that jump to the next thing that is due.

In simulated time the whole asyncio loop runs on the simulated clock, so that a skill may simply sleep. While
a real answer is awaited (a planner in another process) the clock is held: nothing else becomes due.
"""

from __future__ import annotations

import asyncio
import math
import selectors
from collections.abc import Callable, Coroutine, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any, TypeVar

_Result = TypeVar("_Result")


class LoopClock:
    """A `Clock` on the running asyncio loop's time, which is real or simulated.

    Args:
        at: what it shows when it is made, in seconds; a run that is taken up again goes on from there.
    """

    def __init__(self, at: float = 0.0) -> None:
        self._start = asyncio.get_running_loop().time() - at

    def now(self) -> float:
        """Seconds of run time."""
        return asyncio.get_running_loop().time() - self._start

    async def sleep(self, seconds: float) -> None:
        """Let `seconds` of run time pass."""
        await asyncio.sleep(seconds)

    async def sleep_until(self, due: float) -> None:
        """Let run time pass until `due`, if that is still to come."""
        passed = asyncio.Event()
        handle = self.call_at(due, passed.set)
        try:
            await passed.wait()
        finally:
            handle.cancel()

    def call_at(self, due: float, call: Callable[[], object]) -> asyncio.TimerHandle:
        """Let the loop make a call at that run time, or soon if it is over."""
        return asyncio.get_running_loop().call_at(due + self._start, call)

    def timeout_at(self, due: float) -> asyncio.Timeout:
        """A bound for the waiting in a block: `TimeoutError` at that run time; none if it never comes."""
        return asyncio.timeout_at(due + self._start if math.isfinite(due) else None)

    @property
    def simulated(self) -> bool:
        """Whether time jumps instead of passing."""
        return isinstance(asyncio.get_running_loop(), SimulatedEventLoop)

    def hold(self) -> AbstractContextManager[None]:
        """Simulated time stands still inside; real time goes on, of course."""
        loop = asyncio.get_running_loop()
        return loop.hold() if isinstance(loop, SimulatedEventLoop) else _no_hold()


@contextmanager
def _no_hold() -> Iterator[None]:
    yield


class SimulatedEventLoop(asyncio.SelectorEventLoop):
    """An asyncio loop whose time jumps to the next scheduled callback once nothing is ready.

    Args:
        at: its time when it is made, in simulated seconds.
    """

    def __init__(self, at: float = 0.0) -> None:
        self._simulated_now = at
        self._holds = 0
        super().__init__(_JumpingSelector(self._jump, lambda: self._holds > 0))

    def time(self) -> float:
        """Simulated seconds."""
        return self._simulated_now

    @contextmanager
    def hold(self) -> Iterator[None]:
        """Inside, time stands still and the loop waits for real input."""
        self._holds += 1
        try:
            yield
        finally:
            self._holds -= 1

    def _jump(self, seconds: float) -> None:
        self._simulated_now += seconds


class _JumpingSelector(selectors.DefaultSelector):
    def __init__(self, jump: Callable[[float], None], held: Callable[[], bool]) -> None:
        super().__init__()
        self._jump = jump
        self._held = held

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if timeout is None or (timeout > 0 and self._held()):
            return super().select(None)
        ready: list[tuple[selectors.SelectorKey, int]] = super().select(0)
        if not ready and timeout > 0:
            self._jump(timeout)
        return ready


def run_simulated(main: Coroutine[Any, Any, _Result], at: float = 0.0) -> _Result:
    """Run a coroutine in simulated time that begins at `at`; a clock made with the same time then counts like before.

    The loop's own time is what is due at equal times compared by: it must not be off by a rounding error.
    """
    with asyncio.Runner(loop_factory=lambda: SimulatedEventLoop(at)) as runner:
        return runner.run(main)


def run_real(main: Coroutine[Any, Any, _Result]) -> _Result:
    """Run a coroutine in real time."""
    return asyncio.run(main)
