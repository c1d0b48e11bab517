"""Planner asks one engine for a plan and never waits longer than allowed."""

from __future__ import annotations

import asyncio
import contextlib
import math
import threading
import time
from contextlib import AbstractContextManager, aclosing, nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from planning.action_elimination import indispensable
from planning.cancellable_work import aside
from planning.engines.process import Deadline, EngineProcess, EngineStoppedError, OutOfTimeError, worker
from planning.engines.registry import can_time, cannot, in_concert, nobody
from planning.engines.request import written
from planning.plan import EngineFailed, NoneFound, Plan, PlanFound, PlanningOutcome, ProvenUnsolvable, TimedOut

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Callable, Sequence

    from planning.plan import PlanningOutcome
    from planning.strips import Problem


@runtime_checkable
class Improving(Protocol):
    """What a `Planner` can offer besides `solve`; asked for in real time only, since no two such runs are the same."""

    def plans(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """First what `solve` says, then each better plan that is found within the `seconds` of real time.

        It is closed when no better plan is of use any more, which ends the search.
        """
        ...


ENGINE = "pyperplan"
"""The embedded engine: always there, and always the same plan for the same problem."""

START_UP_SECONDS = 60.0


class Planner(Protocol):
    """Anything that plans; replaceable in tests and deployments."""

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        """What came of it, after at most `seconds` of real time."""
        ...


class PlannerProcess:
    """One engine, warm in a process of its own.

    One problem at a time: a second one waits for the first. Whoever stops listening ends the search, with
    everything that it started; the process stays warm.
    """

    def __init__(
        self,
        engine: str = ENGINE,
        *,
        clock_hold: Callable[[], AbstractContextManager[object]] = nullcontext,
        command: Sequence[str] | None = None,
        start_up_seconds: float = START_UP_SECONDS,
        megabytes: int | None = None,
    ) -> None:
        """Nothing is started yet.

        Args:
            engine: its name in `planning.engines.registry`.
            clock_hold: entered while the engine works, e.g. to hold a simulated clock.
            command: how to start the worker process, if not as is usual for the engine.
            start_up_seconds: bound on starting it, which does not count as planning time.
            megabytes: how much memory each process of a search may take; the worker's own default if left out.
        """
        self.engine = engine
        self._clock_hold = clock_hold
        self._command = worker(engine, megabytes) if command is None else tuple(command)
        self._start_up_seconds = start_up_seconds
        self._process: EngineProcess | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._lock = asyncio.Lock()

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        """Plan within `seconds` of real time, counted while the engine works.

        A problem that was sliced is tried as a whole if the slice has no plan, or none in half the time. So is one
        with durations, by an engine that can do these, before it is tried with one action at a time.
        """
        async with aclosing(self.plans(problem, seconds)) as plans:
            return await anext(plans)

    async def plans(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """As `solve`, and then each cheaper plan that an anytime engine finds in the rest of the time.

        Closing it ends the search: `async with contextlib.aclosing(...)`.
        """
        known = self._without_search(problem)
        if known is not None:
            yield known
            return
        async with self._turn():
            with self._clock_hold():
                async with aclosing(self._tried(problem, seconds)) as outcomes:
                    async for outcome in outcomes:
                        yield outcome

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

    def _without_search(self, problem: Problem) -> PlanningOutcome | None:
        if problem.unreachable and not self._timed(problem):
            return self._none(problem, "unreachable: " + ", ".join(problem.unreachable))
        if not problem.goal and not problem.bounds and not problem.unreachable:
            return PlanFound(Plan(), self.engine, 0.0, problem.simulated_seconds)
        if cannot(self.engine, problem):
            return nobody(problem, self.engine)
        return None

    def _none(self, problem: Problem, reason: str) -> ProvenUnsolvable | NoneFound:
        if not problem.one_at_a_time:
            return ProvenUnsolvable(self.engine, reason)
        return NoneFound(self.engine, f"no plan with one action at a time ({reason}); {in_concert()}")

    def _timed(self, problem: Problem) -> bool:
        """Whether this engine can be asked for a plan with durations."""
        return problem.timed is not None and can_time(self.engine)

    def _forms(self, problem: Problem) -> list[Callable[[], Problem]]:
        """The forms of a problem in which it is tried, one after the other, each made when its turn comes."""
        forms = [problem.timed] if self._timed(problem) else []
        made = [_made(one) for one in (*forms, problem) if one is not None and not one.unreachable]
        return made if problem.unsliced is None else [*made, problem.unsliced]

    async def _tried(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """The plans of the first form that has one; each but the last gets half of the time that is left."""
        *first, last = self._forms(problem)
        cut_short = False
        for form in first:
            started = time.monotonic()
            async with aclosing(self._attempt(form(), seconds / 2)) as outcomes:
                async for outcome in outcomes:
                    if not isinstance(outcome, PlanFound | EngineFailed):
                        cut_short |= isinstance(outcome, TimedOut)
                        break
                    yield replace(outcome, reproducible=not cut_short) if isinstance(outcome, PlanFound) else outcome
                else:
                    return
            seconds -= min(time.monotonic() - started, seconds / 2)  # a new start is not planning time
        async with aclosing(self._attempt(last(), seconds)) as outcomes:
            async for outcome in outcomes:
                yield replace(outcome, reproducible=not cut_short) if isinstance(outcome, PlanFound) else outcome

    async def _attempt(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """The first outcome and each cheaper plan; anything but a plan is the last."""
        best: PlanFound | None = None
        try:
            process = await self._ready()
        except OutOfTimeError:
            yield EngineFailed(self.engine, f"it did not start within {self._start_up_seconds:g} s")
            return
        except (OSError, EngineStoppedError) as error:
            yield EngineFailed(self.engine, f"it did not start: {error}")
            return
        started = time.monotonic()
        try:
            async with aclosing(_answers(process, written(problem), seconds)) as answers:
                async for answer in answers:
                    outcome = self._judged(answer, problem, time.monotonic() - started)
                    if best is None or (isinstance(outcome, PlanFound) and outcome.cost < best.cost):
                        yield outcome
                    if not isinstance(outcome, PlanFound):
                        return
                    best = outcome if best is None or outcome.cost < best.cost else best
        except (OutOfTimeError, EngineStoppedError) as error:
            if best is None:
                out_of_time = isinstance(error, OutOfTimeError)
                yield TimedOut(self.engine, seconds) if out_of_time else EngineFailed(self.engine, str(error))

    async def _ready(self) -> EngineProcess:
        """The process, when it can be asked; who stops waiting for that does not stop its start."""
        known = self._process
        if known is not None:
            with contextlib.suppress(OutOfTimeError, EngineStoppedError):
                await self._started(known)
            if known.alive:  # only now: the search before this one may just have been its end
                return known
            self.kill()
        self._process = process = EngineProcess(self._command)
        await self._started(process)
        return process

    async def _started(self, process: EngineProcess) -> None:
        if not process.idle:
            await aside(lambda: process.start(self._start_up_seconds))

    def _judged(self, answer: dict[str, Any], problem: Problem, seconds: float) -> PlanningOutcome:
        """What the engine's answer is worth: a plan counts only if it solves the problem."""
        if "failed" in answer:
            return EngineFailed(self.engine, str(answer["failed"]))
        durations = "durations" in problem.features
        chosen = answer.get("actions", "no actions")
        if chosen is None:
            return self._none(problem, "the search was exhausted")
        try:
            plan = problem.scheduled(_times(answer["timed"])) if durations else problem.plan(_numbers(chosen))
        except (KeyError, TypeError, ValueError):
            return EngineFailed(self.engine, f"no answer: {str(answer)[:80]}")
        if isinstance(plan, str):
            return EngineFailed(self.engine, f"its plan is no solution: {plan}")
        if not durations:
            chosen = indispensable(problem, chosen)
            plan = problem.taking(chosen)
        cost = plan.seconds if durations else problem.cost(chosen)
        translated = answer.get("translated", 0.0)
        return PlanFound(
            plan, self.engine, seconds, problem.simulated_seconds, cost=cost,
            translated=translated if isinstance(translated, float) else 0.0,
        )  # fmt: skip


def _made(problem: Problem) -> Callable[[], Problem]:
    return lambda: problem


def _numbers(chosen: Any) -> list[int]:
    if not isinstance(chosen, list) or not all(type(index) is int for index in chosen):
        raise TypeError
    return chosen


def _times(timed: Any) -> list[tuple[int, float, float]]:
    times = [(index, float(start), float(seconds)) for index, start, seconds in timed]
    _numbers([index for index, _, _ in times])
    if not all(math.isfinite(start) and math.isfinite(seconds) for _, start, seconds in times):
        raise ValueError
    return times


async def _answers(process: EngineProcess, request: bytes, seconds: float) -> AsyncGenerator[dict[str, Any], None]:
    """What the process answers, as it comes; closing this ends the search.

    Raises:
        OutOfTimeError, EngineStoppedError: as `EngineProcess.ask`.
    """
    loop, deadline = asyncio.get_running_loop(), Deadline(seconds)
    heard: asyncio.Queue[dict[str, Any] | Exception | None] = asyncio.Queue()

    def tell(what: dict[str, Any] | Exception | None) -> None:
        _call(loop, lambda: heard.put_nowait(what))

    def ask() -> None:
        try:
            process.ask(request, deadline, tell)
        except Exception as error:  # noqa: BLE001  carried over to the one who waits
            tell(error)
        else:
            tell(None)

    threading.Thread(target=ask, daemon=True).start()
    try:
        while (answer := await heard.get()) is not None:
            if isinstance(answer, Exception):
                raise answer
            yield answer
    finally:
        deadline.shorten(0)
        process.wake()


def _call(loop: asyncio.AbstractEventLoop, what: Callable[[], object]) -> None:
    """In the loop; if it is closed, nobody waits any more."""
    with contextlib.suppress(RuntimeError):
        loop.call_soon_threadsafe(what)
