"""Time, injected: real seconds, or simulated ones that jump to the next thing that is due.

In simulated time the whole asyncio loop runs on the simulated clock, so that a skill may simply sleep. While
a real answer is awaited (a planner in another process) the clock is held: nothing else becomes due.
"""

from __future__ import annotations

import asyncio
import heapq
import math
import selectors
from collections.abc import Callable, Coroutine, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import Context, ContextVar, copy_context
from functools import partial
from typing import Any, NamedTuple, TypeVar, TypeVarTuple, Unpack

_Result = TypeVar("_Result")
_Args = TypeVarTuple("_Args")
_DIGITS = 9
"""Of a second: what is due closer together is due at one moment, as for every asyncio loop."""
_FEW = 100
"""So many cancelled calls may wait until they would be due, however few others there are."""


class LoopClock:
    """A `Clock` on the running asyncio loop's time, which is real or simulated.

    Args:
        at: what it shows when it is made, in seconds; a run that is taken up again goes on from there.
    """

    def __init__(self, at: float = 0.0) -> None:
        self._time = asyncio.get_running_loop().time
        self._start = self._time() - at

    def now(self) -> float:
        """Seconds of run time."""
        return self._time() - self._start

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

    async def settled(self) -> None:
        """Wait until nothing more happens at this moment of simulated time; in real time, for no time."""
        loop = asyncio.get_running_loop()
        await (loop.settled() if isinstance(loop, SimulatedEventLoop) else asyncio.sleep(0))

    def hold(self) -> AbstractContextManager[None]:
        """Simulated time stands still inside; real time goes on, of course."""
        loop = asyncio.get_running_loop()
        return loop.hold() if isinstance(loop, SimulatedEventLoop) else _no_hold()


@contextmanager
def _no_hold() -> Iterator[None]:
    yield


class PastClock:
    """An action's clock after a restart: it begins at the start of the action, and passes the past without waiting.

    Each task of an action passes through the past on its own.

    Args:
        clock: run time.
        began: second of run time at which the action began.
    """

    def __init__(self, clock: LoopClock, began: float) -> None:
        self._clock = clock
        self._restart = clock.now()
        self._own: ContextVar[float] = ContextVar("own", default=began)

    def now(self) -> float:
        """Seconds of run time, as the action sees it."""
        own = self._own.get()
        return own if own < self._restart else self._clock.now()

    async def sleep(self, seconds: float) -> None:
        """Let `seconds` of the action's time pass."""
        due = self.now() + seconds
        self._own.set(due)
        await self._clock.sleep_until(due)

    def hold(self) -> AbstractContextManager[None]:
        """Simulated time stands still inside."""
        return self._clock.hold()


def released() -> AbstractContextManager[None]:
    """Inside, one hold on simulated time does not count: its owner waits in simulated time for what comes."""
    loop = asyncio.get_running_loop()
    return loop.release() if isinstance(loop, SimulatedEventLoop) else _no_hold()


class SimulatedEventLoop(asyncio.SelectorEventLoop):
    """An asyncio loop whose time jumps to what is due next once nothing is ready.

    What is due at one moment comes in the order in which it was asked for; asyncio's own queue leaves that open.

    Args:
        at: its time when it is made, in simulated seconds.
    """

    def __init__(self, at: float = 0.0) -> None:
        self._simulated_now = at
        self._due: list[_Due] = []
        self._asked = 0
        self._cancelled = 0  # at most so many of those that are due
        self._holds = 0
        self._settling: list[asyncio.Future[None]] = []
        super().__init__(_IdleSelector(self._go_on))

    def time(self) -> float:
        """Simulated seconds."""
        return self._simulated_now

    def call_at(
        self, when: float, callback: Callable[[Unpack[_Args]], object], *args: *_Args,
        context: Context | None = None,
    ) -> asyncio.TimerHandle:  # fmt: skip
        """As every loop's."""
        context = context or copy_context()
        timer = asyncio.TimerHandle(when, callback, args, self, context)
        call = partial(_unless_cancelled, timer, callback, *args)
        if when <= self._simulated_now:
            self.call_soon(call, context=context)
        else:
            self._asked += 1
            heapq.heappush(self._due, _Due(round(when, _DIGITS), self._asked, timer, call, context))
        return timer

    def _timer_handle_cancelled(self, handle: asyncio.TimerHandle) -> None:
        """Asyncio's loops are told so; when most of what waits was cancelled, that is forgotten."""
        self._cancelled += handle.when() > self._simulated_now  # else it has left the queue
        if self._cancelled > max(_FEW, len(self._due) // 2):
            self._due = [due for due in self._due if not due.timer.cancelled()]
            heapq.heapify(self._due)
            self._cancelled = 0

    async def settled(self) -> None:
        """Wait until nothing more happens at this moment, without letting it pass."""
        waits = self.create_future()
        self._settling.append(waits)
        await waits

    @contextmanager
    def hold(self) -> Iterator[None]:
        """Inside, time stands still and the loop waits for real input."""
        self._holds += 1
        try:
            yield
        finally:
            self._holds -= 1

    @contextmanager
    def release(self) -> Iterator[None]:
        """Inside, one `hold` does not count."""
        self._holds -= 1
        try:
            yield
        finally:
            self._holds += 1

    def _go_on(self) -> bool:
        """Nothing is ready: let time jump, if it may; whether anything is ready now."""
        settling, self._settling = self._settling, []
        for waits in settling:
            if not waits.done():
                waits.set_result(None)
        return bool(settling) or (not self._holds and self._jump())

    def _jump(self) -> bool:
        while self._due and self._due[0].timer.cancelled():
            heapq.heappop(self._due)
        if not self._due:
            return False
        moment = self._due[0].moment
        while self._due and self._due[0].moment == moment:
            due = heapq.heappop(self._due)
            self._simulated_now = max(self._simulated_now, due.timer.when())
            self.call_soon(due.call, context=due.context)
        return True


class _Due(NamedTuple):
    """A call that is to come, ordered by its moment and then by its number; no two have the same."""

    moment: float
    number: int
    timer: asyncio.TimerHandle
    call: Callable[[], object]
    context: Context | None


def _unless_cancelled(timer: asyncio.TimerHandle, callback: Callable[[Unpack[_Args]], object], *args: *_Args) -> None:
    """What was due together with it may have cancelled it."""
    if not timer.cancelled():
        callback(*args)


class _IdleSelector(selectors.DefaultSelector):
    """Asks what to do instead when the loop would wait; waits for real input only if that is nothing."""

    def __init__(self, go_on: Callable[[], bool]) -> None:
        super().__init__()
        self._go_on = go_on

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        ready: list[tuple[selectors.SelectorKey, int]] = super().select(0)
        if ready or timeout is not None or self._go_on():
            return ready
        return super().select(None)


def run_simulated(main: Coroutine[Any, Any, _Result], at: float = 0.0) -> _Result:
    """Run a coroutine in simulated time that begins at `at`; a clock made with the same time then counts like before.

    The loop's own time is what is due at equal times compared by: it must not be off by a rounding error.
    """
    with asyncio.Runner(loop_factory=lambda: SimulatedEventLoop(at)) as runner:
        return runner.run(main)


def run_real(main: Coroutine[Any, Any, _Result]) -> _Result:
    """Run a coroutine in real time."""
    return asyncio.run(main)
