"""Clocks of a run, always injected: real seconds, or simulated seconds that jump to the next timer.

In simulated time, the whole asyncio loop runs on the simulated clock, so that a skill sleeps as in real time. A hold
stops the clock during the wait for a real answer, e.g. of a planner in another process. The clock also stops while a
skill waits for a socket, pipe or process of its component; deadlines then count real seconds. A finite speed, e.g. ten
simulated seconds per real second, slows the jumps down for people who watch.
"""

from __future__ import annotations

import asyncio
import heapq
import math
import selectors
import time
from collections.abc import Callable, Coroutine, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import Context, ContextVar, copy_context
from functools import partial
from typing import Any, Literal, NamedTuple, TypeVar, TypeVarTuple, Unpack

from dsc.components.hooks import unawaited_coroutines
from dsc.loop_calls import LoopCalls
from dsc.sequencer.real_input import RealInput, TasksOf
from dsc.sequencer.signals import run_until_signal
from knowledge_base.errors import InputError

ClockKind = Literal["real", "simulated"]
"""The kind of time of a run."""
_Result = TypeVar("_Result")
_Args = TypeVarTuple("_Args")
_DIGITS = 9
"""Decimal places of a second to which scheduled times are rounded.

Calls with equal rounded times are executed together, as in every asyncio loop.
"""
_FEW = 100
"""Number of cancelled calls that may stay scheduled, unless they are less than half of all scheduled calls."""


class LoopClock:
    """A `Clock` on the running asyncio loop's time, which is real or simulated.

    Args:
        at: the clock's first time, in seconds; the clock of a resumed run continues from there.

    Attributes:
        calls: executes calls of other threads in the loop's thread.
    """

    def __init__(self, at: float = 0.0) -> None:
        self.calls = LoopCalls()
        self.calls.bind()
        self._time = asyncio.get_running_loop().time
        self._start = self._time() - at

    def now(self) -> float:
        """Return the seconds of run time."""
        return self._time() - self._start

    async def sleep(self, seconds: float) -> None:
        """Wait until `seconds` of run time have passed."""
        await asyncio.sleep(seconds)

    async def sleep_until(self, due: float) -> None:
        """Wait until second `due` of run time; return immediately if `due` is past."""
        passed = asyncio.Event()
        handle = self.call_at(due, passed.set)
        try:
            await passed.wait()
        finally:
            handle.cancel()

    async def sleep_in_background(self, seconds: float) -> None:
        """Wait, without an effect on `idle`; simulated time does not jump for this wait alone."""
        loop = asyncio.get_running_loop()
        await (loop.sleep_in_background(seconds) if isinstance(loop, SimulatedEventLoop) else asyncio.sleep(seconds))

    def call_at(self, due: float, call: Callable[[], object]) -> ScheduledCall:
        """Schedule a call for second `due` of run time, or for the next loop iteration if `due` is past."""
        return ScheduledCall(asyncio.get_running_loop(), due + self._start, call)

    def timeout_at(self, due: float) -> asyncio.Timeout:
        """Return a context manager that raises `TimeoutError` at second `due` of run time, or never for `math.inf`."""
        return asyncio.timeout_at(due + self._start if math.isfinite(due) else None)

    @property
    def simulated(self) -> bool:
        """Whether time is simulated and jumps."""
        return isinstance(asyncio.get_running_loop(), SimulatedEventLoop)

    @property
    def kind(self) -> ClockKind:
        """The kind of time."""
        return "simulated" if self.simulated else "real"

    async def settled(self) -> None:
        """Wait until the loop has no more work at the present simulated time; in real time, for one loop iteration."""
        loop = asyncio.get_running_loop()
        await (loop.settled() if isinstance(loop, SimulatedEventLoop) else asyncio.sleep(0))

    def idle(self, before: float) -> asyncio.Future[None]:
        """Return a future that resolves when nothing can happen before second `before` of simulated run time.

        Then no call is ready or scheduled for an earlier time, and time is not held. In real time it never resolves.
        """
        loop = asyncio.get_running_loop()
        return loop.idle(before + self._start) if isinstance(loop, SimulatedEventLoop) else loop.create_future()

    def hold(self) -> AbstractContextManager[None]:
        """Return a context manager that stops simulated time; real time continues."""
        loop = asyncio.get_running_loop()
        return loop.hold() if isinstance(loop, SimulatedEventLoop) else _no_hold()

    def attend(self, tasks_of: TasksOf) -> None:
        """Let simulated time stand still while a skill waits for a socket, pipe or process of its component.

        Args:
            tasks_of: returns the tasks of the running skills of a component.
        """
        loop = asyncio.get_running_loop()
        if isinstance(loop, SimulatedEventLoop):
            loop.real_input.attended.append(tasks_of)

    def disregard(self, tasks_of: TasksOf) -> None:
        """Undo `attend`."""
        loop = asyncio.get_running_loop()
        if isinstance(loop, SimulatedEventLoop) and tasks_of in loop.real_input.attended:
            loop.real_input.attended.remove(tasks_of)


class ScheduledCall:
    """A call at a time of a loop; a late call lets earlier answers be received first.

    After the computer slept, or a task blocked the loop, many calls and answers are due together, and the loop does not
    know their order. A late call then waits `GRACE` seconds, so that a time limit does not discard an answer that came
    before it.

    Args:
        loop: real or simulated; simulated time is never late.
        due: seconds of the loop's time.
        call: the call.

    Attributes:
        gives_way: whether the call was late and waits.
    """

    __slots__ = ("_due", "_handle", "_loop", "gives_way")
    LATE = 0.1
    """Seconds after which a call is late."""
    GRACE = 0.05
    """Seconds that a late call waits."""

    def __init__(self, loop: asyncio.AbstractEventLoop, due: float, call: Callable[[], object]) -> None:
        self._loop = loop
        self._due = max(due, loop.time())
        self.gives_way = False
        self._handle = loop.call_at(due, self._fire, call)  # the handle alone, which forgets it when cancelled

    def cancel(self) -> None:
        """Prevent the call."""
        self._handle.cancel()

    def _fire(self, call: Callable[[], object]) -> None:
        if self.gives_way or self._loop.time() - self._due < self.LATE:
            call()
            return
        self.gives_way = True
        self._handle = self._loop.call_later(self.GRACE, self._fire, call)


@contextmanager
def _no_hold() -> Iterator[None]:
    yield


class PastClock:
    """The clock of an action after a restart; it begins at the start of the action.

    Sleeps that end before the restart return immediately. Each task of an action passes the time before the restart
    separately.

    Args:
        clock: run time.
        began: second of run time at which the action began.
    """

    def __init__(self, clock: LoopClock, began: float) -> None:
        self._clock = clock
        self._restart = clock.now()
        self._own: ContextVar[float] = ContextVar("own", default=began)

    def now(self) -> float:
        """Return the seconds of run time from the action's point of view."""
        own = self._own.get()
        return own if own < self._restart else self._clock.now()

    async def sleep(self, seconds: float) -> None:
        """Wait until `seconds` of the action's time have passed."""
        due = self.now() + seconds
        self._own.set(due)
        await self._clock.sleep_until(due)

    def hold(self) -> AbstractContextManager[None]:
        """Return a context manager that stops simulated time."""
        return self._clock.hold()


def released() -> AbstractContextManager[None]:
    """Return a context manager that suspends one hold on simulated time, while the hold's owner waits in that time."""
    loop = asyncio.get_running_loop()
    return loop.release() if isinstance(loop, SimulatedEventLoop) else _no_hold()


class SimulatedEventLoop(asyncio.SelectorEventLoop):
    """An asyncio loop whose time jumps to the next scheduled call when no call is ready.

    Calls with equal scheduled times are executed in the order of their requests; asyncio's own queue does not guarantee
    that order.

    Args:
        at: the loop's first time, in simulated seconds.
        speed: simulated seconds per real second; `math.inf` jumps without waiting.
    """

    def __init__(self, at: float = 0.0, speed: float = math.inf) -> None:
        self._simulated_now = at
        self._pace = None if speed == math.inf else _Pace(speed, at)
        self._due: list[_Due] = []
        self._asked = 0
        self._cancelled = 0  # an upper bound of the cancelled calls in `_due`
        self._holds = 0
        self._settling: list[asyncio.Future[None]] = []
        self._idle: list[tuple[float, asyncio.Future[None]]] = []
        self._background: set[asyncio.TimerHandle] = set()
        selector = _IdleSelector(self._settle_or_jump, self._until_jump, self._advance)
        self.real_input = RealInput(selector)
        super().__init__(selector)

    def time(self) -> float:
        """Return the simulated seconds."""
        return self._simulated_now

    def call_at(
        self, when: float, callback: Callable[[Unpack[_Args]], object], *args: *_Args,
        context: Context | None = None,
    ) -> asyncio.TimerHandle:  # fmt: skip
        """Schedule a call, see `asyncio.loop.call_at`."""
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
        self._cancelled += handle.when() > self._simulated_now  # else the call has left the queue
        if self._cancelled > max(_FEW, len(self._due) // 2):
            self._due = [due for due in self._due if not due.timer.cancelled()]
            heapq.heapify(self._due)
            self._cancelled = 0

    async def sleep_in_background(self, seconds: float) -> None:
        """Wait, see `LoopClock.sleep_in_background`."""
        waits = self.create_future()
        timer = self.call_later(seconds, waits.set_result, None)
        self._background.add(timer)
        try:
            await waits
        finally:
            self._background.discard(timer)
            timer.cancel()

    def run_in_executor(
        self, executor: Any, func: Callable[[Unpack[_Args]], _Result], *args: *_Args
    ) -> asyncio.Future[_Result]:
        """Run a function in a thread, e.g. for `asyncio.to_thread`; simulated time stops until it returns."""
        future = super().run_in_executor(executor, func, *args)
        self._change_holds(+1)
        future.add_done_callback(lambda _: self._change_holds(-1))
        return future

    async def subprocess_exec(self, *args: Any, **kwargs: Any) -> Any:
        """Start a process, see `asyncio.loop.subprocess_exec`."""
        transport, protocol = await super().subprocess_exec(*args, **kwargs)
        self.real_input.add_process(transport)
        return transport, protocol

    async def subprocess_shell(self, *args: Any, **kwargs: Any) -> Any:
        """Start a shell, see `asyncio.loop.subprocess_shell`."""
        transport, protocol = await super().subprocess_shell(*args, **kwargs)
        self.real_input.add_process(transport)
        return transport, protocol

    async def settled(self) -> None:
        """Wait until the loop has no more work at the present time; time does not advance."""
        waits = self.create_future()
        self._settling.append(waits)
        await waits

    def idle(self, before: float) -> asyncio.Future[None]:
        """Return a future that resolves when no call is ready or scheduled before that time, and time is not held."""
        waits = self.create_future()
        self._idle.append((before, waits))
        return waits

    @contextmanager
    def hold(self) -> Iterator[None]:
        """Stop simulated time inside the block; the loop waits for real input."""
        self._change_holds(+1)
        try:
            yield
        finally:
            self._change_holds(-1)

    @contextmanager
    def release(self) -> Iterator[None]:
        """Suspend one `hold` inside the block."""
        self._change_holds(-1)
        try:
            yield
        finally:
            self._change_holds(+1)

    def _until_jump(self) -> float:
        """Return the real seconds to wait before time jumps; without pace and waits for input, it jumps immediately."""
        if self._holds or self._settling:
            return 0.0
        if self._pace is None:
            return self._until_deadline() if self.real_input.may_come else 0.0
        self._drop_cancelled()
        self._advance()
        return self._pace.seconds(self._due[0].timer.when() - self._simulated_now) if self._due else 0.0

    def _until_deadline(self) -> float:
        """Return the real seconds for which a skill may still wait for input before the next scheduled call."""
        self._drop_cancelled()
        if not self._due or not self.real_input.is_awaited([due.timer for due in self._due]):
            return 0.0
        return self._due[0].timer.when() - self._simulated_now - self.real_input.waited()

    def _advance(self) -> None:
        """Advance simulated time by the real time that has passed, but not beyond the next scheduled call."""
        if self._pace is not None and not self._holds:
            reached = self._pace.now()
            self._simulated_now = max(
                self._simulated_now, min(reached, self._due[0].timer.when()) if self._due else reached
            )

    def _change_holds(self, change: int) -> None:
        self._holds += change
        if self._pace is not None:
            self._pace.restart(self._simulated_now)

    def _settle_or_jump(self) -> bool:
        """Advance simulated time, unless it is held, as no call is ready; return whether a call is ready now."""
        settling, self._settling = self._settling, []
        for waits in settling:
            if not waits.done():
                waits.set_result(None)
        if settling or self._holds:
            return bool(settling)
        return self._is_idle() or self._jump()

    def _is_idle(self) -> bool:
        """Resolve the futures of `idle` before whose time nothing is scheduled; return whether there are any."""
        if not self._idle:
            return False
        next_due = self._next_due()
        idle = [waits for before, waits in self._idle if before <= next_due and not waits.done()]
        self._idle = [one for one in self._idle if not one[1].done() and one[1] not in idle]
        for waits in idle:
            waits.set_result(None)
        return bool(idle)

    def _next_due(self) -> float:
        """Return the time of the next scheduled call that is not in the background; `math.inf` without one."""
        self._drop_cancelled()
        if self._due and self._due[0].timer not in self._background:
            return self._due[0].timer.when()
        others = (due.timer for due in self._due if due.timer not in self._background)
        return min((timer.when() for timer in others if not timer.cancelled()), default=math.inf)

    def _drop_cancelled(self) -> None:
        while self._due and self._due[0].timer.cancelled():
            heapq.heappop(self._due)

    def _jump(self) -> bool:
        self._drop_cancelled()
        if not self._due or (self._pace is None and self._next_due() == math.inf):
            return False
        moment = self._due[0].moment
        self.real_input.end_wait()
        while self._due and self._due[0].moment == moment:
            due = heapq.heappop(self._due)
            self._simulated_now = max(self._simulated_now, due.timer.when())
            self.call_soon(due.call, context=due.context)
        return True


class _Pace:
    """The relation of simulated to real time at a finite speed.

    Args:
        speed: simulated seconds per real second.
        at: the simulated second now.
    """

    def __init__(self, speed: float, at: float) -> None:
        self._speed = speed
        self.restart(at)

    def restart(self, at: float) -> None:
        """Let the simulated second `at` be now, e.g. after a hold."""
        self._since = time.monotonic(), at

    def now(self) -> float:
        """Return the simulated second now."""
        real, at = self._since
        return at + (time.monotonic() - real) * self._speed

    def seconds(self, simulated: float) -> float:
        """Return the real seconds that simulated seconds last."""
        return simulated / self._speed


class _Due(NamedTuple):
    """A scheduled call, ordered by its rounded time and then by its unique number."""

    moment: float
    number: int
    timer: asyncio.TimerHandle
    call: Callable[[], object]
    context: Context | None


def _unless_cancelled(timer: asyncio.TimerHandle, callback: Callable[[Unpack[_Args]], object], *args: *_Args) -> None:
    """Execute the call, unless another call of equal time has cancelled it."""
    if not timer.cancelled():
        callback(*args)


class _IdleSelector(selectors.DefaultSelector):
    """A selector that advances simulated time when the loop would wait, at the loop's speed.

    If time cannot advance, it waits for real input.
    """

    def __init__(
        self, advance: Callable[[], bool], until_jump: Callable[[], float], arrived: Callable[[], None]
    ) -> None:
        super().__init__()
        self._advance = advance
        self._until_jump = until_jump
        self._arrived = arrived

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        ready: list[tuple[selectors.SelectorKey, int]] = super().select(0)
        if ready or timeout is not None:
            return ready
        while not ready and (seconds := self._until_jump()) > 0:
            ready = super().select(seconds)
        if not ready:
            if self._advance():
                return ready
            ready = super().select(None)
        self._arrived()
        return ready


def run_simulated(main: Coroutine[Any, Any, _Result], at: float = 0.0, speed: float = math.inf) -> _Result:
    """Run a coroutine in simulated time that begins at `at`, and return its result.

    The loop compares scheduled times in its own time. With an equal `at`, a `LoopClock` returns exactly the loop's
    times, without a rounding error. With a finite `speed`, real input during the run has the simulated time of its
    arrival.

    Raises:
        InputError: the speed is not positive.
        KeyboardInterrupt: Ctrl-C or a signal has cancelled the coroutine, see `run_until_signal`.
    """
    if not speed > 0:
        main.close()
        raise InputError(f"a speed is a positive number of simulated seconds per real second, not {speed:g}")
    with unawaited_coroutines(), asyncio.Runner(loop_factory=lambda: SimulatedEventLoop(at, speed)) as runner:
        return run_until_signal(runner, main)


def run_real(main: Coroutine[Any, Any, _Result]) -> _Result:
    """Run a coroutine in real time, and return its result.

    Raises:
        KeyboardInterrupt: Ctrl-C or a signal has cancelled the coroutine, see `run_until_signal`.
    """
    with asyncio.Runner() as runner:
        return run_until_signal(runner, main)
