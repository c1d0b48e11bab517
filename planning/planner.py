"""Asking for a plan without ever waiting longer than allowed: the engine in a process that can be killed.

The event loop may run in simulated time, so nothing here uses its timers: a thread waits for the engine in
real time and wakes the loop, while `clock_hold` keeps the simulated clock where it is.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from planning.engines.process import COMMAND, EngineProcess, EngineStoppedError, OutOfTimeError
from planning.plan import EngineFailed, Plan, PlanFound, PlanningOutcome, ProvenUnsolvable, TimedOut

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from planning.strips import Problem

ENGINE = "pyperplan"
_T = TypeVar("_T")


class Planner(Protocol):
    """Anything that plans; replaceable in tests and deployments."""

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        """What came of it, after at most `seconds` of real time."""
        ...


class PlannerProcess:
    """The embedded engine, warm in a process of its own.

    One problem at a time: a second `solve` waits for the first. Cancelling a `solve`, like its deadline,
    kills the process; the next `solve` starts a new one.
    """

    def __init__(
        self,
        *,
        clock_hold: Callable[[], AbstractContextManager[object]] = nullcontext,
        command: Sequence[str] = COMMAND,
        start_up_seconds: float = 60.0,
    ) -> None:
        """Nothing is started yet.

        Args:
            clock_hold: entered while the engine works, e.g. to hold a simulated clock.
            command: how to start the worker process.
            start_up_seconds: bound on starting it, which does not count as planning time.
        """
        self._clock_hold = clock_hold
        self._command = tuple(command)
        self._start_up_seconds = start_up_seconds
        self._process: EngineProcess | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._lock = asyncio.Lock()

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        """Plan within `seconds` of real time, counted while the engine works.

        A problem that was sliced is tried as a whole if the slice has no plan, or none in half the time.
        """
        if problem.unreachable:
            return ProvenUnsolvable(ENGINE, "unreachable: " + ", ".join(problem.unreachable))
        if not problem.goal:
            return PlanFound(Plan(), ENGINE, 0.0, problem.simulated_seconds)
        async with self._turn():
            with self._clock_hold():
                return await self._solve(problem, seconds)

    async def warm_up(self) -> None:
        """Start the process now, so that the first problem does not wait; what goes wrong shows then."""
        async with self._turn():
            with self._clock_hold(), contextlib.suppress(OSError, EngineStoppedError, OutOfTimeError):
                await self._ready()

    async def close(self) -> None:
        """End the process; a later `solve` would start a new one."""
        self.kill()

    def kill(self) -> None:
        """As `close`, without a loop."""
        if self._process is not None:
            self._process.kill()
            self._process = None

    def _turn(self) -> asyncio.Lock:
        """The running loop's lock: a planner may outlive the run, and with it the loop, that it served before."""
        loop = asyncio.get_running_loop()
        if loop is not self._loop:
            self._loop, self._lock = loop, asyncio.Lock()
        return self._lock

    async def _solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        if problem.whole is None:
            return await self._attempt(problem, seconds)
        started = time.monotonic()
        outcome = await self._attempt(problem, seconds / 2)
        if isinstance(outcome, PlanFound | EngineFailed):
            return outcome
        cut_short = isinstance(outcome, TimedOut)
        spent = min(time.monotonic() - started, seconds / 2)  # a new start is not planning time
        outcome = await self._attempt(problem.whole, seconds - spent)
        if isinstance(outcome, PlanFound):
            return replace(outcome, reproducible=not cut_short)
        return TimedOut(ENGINE, seconds) if isinstance(outcome, TimedOut) else outcome

    async def _attempt(self, problem: Problem, seconds: float) -> PlanningOutcome:
        try:
            process = await self._ready()
        except OutOfTimeError:
            return EngineFailed(ENGINE, f"it did not start within {self._start_up_seconds:g} s")
        except (OSError, EngineStoppedError) as error:
            return EngineFailed(ENGINE, f"it did not start: {error}")
        request, started = problem.to_json(), time.monotonic()
        try:
            answer = await self._in_thread(lambda: process.ask(request, seconds))
        except OutOfTimeError:
            return TimedOut(ENGINE, seconds)
        except EngineStoppedError as error:
            return EngineFailed(ENGINE, str(error))
        return _judged(answer, problem, time.monotonic() - started)

    async def _ready(self) -> EngineProcess:
        if self._process is None or not self._process.alive:
            self.kill()
            process = self._process = EngineProcess(self._command)
            await self._in_thread(lambda: process.ask(None, self._start_up_seconds))
        return self._process

    async def _in_thread(self, work: Callable[[], _T]) -> _T:
        """The result of blocking `work`; a cancellation kills the process, which ends the work."""
        loop = asyncio.get_running_loop()
        finished: asyncio.Future[_T] = loop.create_future()

        def settle(settling: Callable[[], None]) -> None:
            with contextlib.suppress(RuntimeError):  # the loop is closed: nobody waits any more
                loop.call_soon_threadsafe(lambda: None if finished.done() else settling())

        def run() -> None:
            try:
                result = work()
            except Exception as error:  # noqa: BLE001  carried over to the one who waits
                failure = error
                settle(lambda: finished.set_exception(failure))
            else:
                settle(lambda: finished.set_result(result))

        threading.Thread(target=run, daemon=True).start()
        try:
            return await finished
        except asyncio.CancelledError:
            self.kill()
            raise


def _judged(answer: dict[str, Any], problem: Problem, seconds: float) -> PlanningOutcome:
    """What the engine's answer is worth: a plan counts only if it solves the problem."""
    if "failed" in answer:
        return EngineFailed(ENGINE, str(answer["failed"]))
    chosen = answer.get("actions", "no actions")
    if chosen is None:
        return ProvenUnsolvable(ENGINE, "the search was exhausted")
    if not isinstance(chosen, list) or not all(isinstance(index, int) for index in chosen):
        return EngineFailed(ENGINE, f"no answer: {str(answer)[:80]}")
    plan = problem.plan(chosen)
    if isinstance(plan, str):
        return EngineFailed(ENGINE, f"its plan is no solution: {plan}")
    return PlanFound(plan, ENGINE, seconds, problem.simulated_seconds)
