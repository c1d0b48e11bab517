"""Time, injected: real seconds, or simulated ones that jump to the next timer.

In simulated time the whole asyncio loop runs on the simulated clock, so that a skill may sleep as in real time. A hold
stops the clock during the wait for a real answer, e.g. of a planner in another process.
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
"""Decimal places of a second: calls that are due closer together are due at one moment, as in every asyncio loop."""
_FEW = 100
"""Upper bound of cancelled calls that wait for their time, unless they are less than half of all."""


class LoopClock:
    """A `Clock` on the running asyncio loop's time, which is real or simulated.

    Args:
        at: its first time, in seconds; a resumed run continues from there.
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
        """Let run time pass until `due`, if that is in the future."""
        passed = asyncio.Event()
        handle = self.call_at(due, passed.set)
        try:
            await passed.wait()
        finally:
            handle.cancel()

    def call_at(self, due: float, call: Callable[[], object]) -> asyncio.TimerHandle:
        """Let the loop make a call at that run time, or soon if that is past."""
        return asyncio.get_running_loop().call_at(due + self._start, call)

    def timeout_at(self, due: float) -> asyncio.Timeout:
        """Return a bound for the waits in a block: `TimeoutError` at that run time; `math.inf` means no bound."""
        return asyncio.timeout_at(due + self._start if math.isfinite(due) else None)

    @property
    def simulated(self) -> bool:
        """Whether time jumps instead of passing."""
        return isinstance(asyncio.get_running_loop(), SimulatedEventLoop)

    async def settled(self) -> None:
        """Wait until the loop has no work at this moment of simulated time; in real time, for one turn."""
        loop = asyncio.get_running_loop()
        await (loop.settled() if isinstance(loop, SimulatedEventLoop) else asyncio.sleep(0))

    def hold(self) -> AbstractContextManager[None]:
        """Stop simulated time inside the block; real time continues."""
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
        """Stop simulated time inside the block."""
        return self._clock.hold()


def released() -> AbstractContextManager[None]:
    """Suspend one hold on simulated time inside the block: its owner waits in simulated time."""
    loop = asyncio.get_running_loop()
    return loop.release() if isinstance(loop, SimulatedEventLoop) else _no_hold()


class SimulatedEventLoop(asyncio.SelectorEventLoop):
    """An asyncio loop whose time jumps to the next call that is due when no call is ready.

    Calls that are due at one moment keep the order of their requests; the queue of asyncio leaves that open.

    Args:
        at: its first time, in simulated seconds.
    """

    def __init__(self, at: float = 0.0) -> None:
        self._simulated_now = at
        self._due: list[_Due] = []
        self._asked = 0
        self._cancelled = 0  # an upper bound of the cancelled calls in `_due`
        self._holds = 0
        self._settling: list[asyncio.Future[None]] = []
        super().__init__(_IdleSelector(self._go_on))

    def time(self) -> float:
        """Return the simulated seconds."""
        return self._simulated_now

    def call_at(
        self, when: float, callback: Callable[[Unpack[_Args]], object], *args: *_Args,
        context: Context | None = None,
    ) -> asyncio.TimerHandle:  # fmt: skip
        """See `asyncio.loop.call_at`."""
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
        """Count a cancelled call, as asyncio requires; drop the cancelled calls when they are the majority."""
        self._cancelled += handle.when() > self._simulated_now  # else it has left the queue
        if self._cancelled > max(_FEW, len(self._due) // 2):
            self._due = [due for due in self._due if not due.timer.cancelled()]
            heapq.heapify(self._due)
            self._cancelled = 0

    async def settled(self) -> None:
        """Wait until the loop has no work at this moment; time does not pass."""
        waits = self.create_future()
        self._settling.append(waits)
        await waits

    @contextmanager
    def hold(self) -> Iterator[None]:
        """Stop time inside the block; the loop waits for real input."""
        self._holds += 1
        try:
            yield
        finally:
            self._holds -= 1

    @contextmanager
    def release(self) -> Iterator[None]:
        """Suspend one `hold` inside the block."""
        self._holds -= 1
        try:
            yield
        finally:
            self._holds += 1

    def _go_on(self) -> bool:
        """Let time jump, unless it is held, as no call is ready; return whether one is ready now."""
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
    """A future call, ordered by its moment and then by its unique number."""

    moment: float
    number: int
    timer: asyncio.TimerHandle
    call: Callable[[], object]
    context: Context | None


def _unless_cancelled(timer: asyncio.TimerHandle, callback: Callable[[Unpack[_Args]], object], *args: *_Args) -> None:
    """Make the call, unless another call of the same moment has cancelled it."""
    if not timer.cancelled():
        callback(*args)


class _IdleSelector(selectors.DefaultSelector):
    """Lets simulated time jump where the loop would wait; waits for real input if it cannot jump."""

    def __init__(self, go_on: Callable[[], bool]) -> None:
        super().__init__()
        self._go_on = go_on

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        ready: list[tuple[selectors.SelectorKey, int]] = super().select(0)
        if ready or timeout is not None or self._go_on():
            return ready
        return super().select(None)


def run_simulated(main: Coroutine[Any, Any, _Result], at: float = 0.0) -> _Result:
    """Run a coroutine in simulated time that begins at `at`; a clock with the same `at` then shows the same times.

    Equal due times are compared in the loop's own time, which therefore must have no rounding error.
    """
    with asyncio.Runner(loop_factory=lambda: SimulatedEventLoop(at)) as runner:
        return runner.run(main)


def run_real(main: Coroutine[Any, Any, _Result]) -> _Result:
    """Run a coroutine in real time."""
    return asyncio.run(main)
