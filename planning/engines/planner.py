"""The planner interface, and a planner with one engine that never waits longer than its limit."""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections.abc import AsyncGenerator, Callable, Sequence
from contextlib import AbstractContextManager, aclosing, nullcontext
from dataclasses import replace
from typing import Any, Protocol, runtime_checkable

from planning.action_elimination import indispensable
from planning.cancellable_work import aside
from planning.engines.process import EngineProcess, EngineStoppedError, OutOfTimeError, answers, worker
from planning.engines.registry import can_time, cannot, in_concert, nobody
from planning.engines.request import written
from planning.plan import EngineFailed, NoneFound, Plan, PlanFound, PlanningOutcome, ProvenUnsolvable, TimedOut
from planning.strips import Problem


@runtime_checkable
class Improving(Protocol):
    """The interface of a `Planner` that improves plans; used in real time only, since no two such runs are equal."""

    def plans(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """Yield the outcome of `solve`, then each better plan found within `seconds` of real time.

        Closing the generator ends the search.
        """
        ...


ENGINE = "pyperplan"
"""The embedded engine: always installed, with the same plan for the same problem."""

START_UP_SECONDS = 60.0


class Planner(Protocol):
    """The interface of a planner, replaceable in tests and deployments."""

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        """Return the outcome after at most `seconds` of real time."""
        ...


class PlannerProcess:
    """One engine, warm in a separate process.

    It solves one problem at a time; a second one waits for the first. Closing the generator of `plans` ends the search
    and all processes started by it; the worker process stays warm.
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
        """Configure the planner without starting its process.

        Args:
            engine: its name in `planning.engines.registry`.
            clock_hold: entered while the engine works, e.g. to hold a simulated clock.
            command: the command of the worker process; by default the engine's own.
            start_up_seconds: limit of the start, which does not count as planning time.
            megabytes: memory limit of each process of a search; by default the worker's.
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

        A sliced problem is tried as a whole if the slice has no plan, or none in half the time. An engine with
        durations first tries the temporal problem, then the one with one action at a time.
        """
        async with aclosing(self.plans(problem, seconds)) as plans:
            return await anext(plans)

    async def plans(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """Yield the outcome of `solve`, then each cheaper plan that an anytime engine finds in the remaining time.

        Closing the generator ends the search: `async with contextlib.aclosing(...)`.
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
        """Start the process now, so that the first problem does not wait; the first problem reports a failed start."""
        async with self._turn():
            with self._clock_hold(), contextlib.suppress(OSError, EngineStoppedError, OutOfTimeError):
                await self._ready()

    async def close(self) -> None:
        """End the process; a later `solve` starts a new one."""
        self.kill()

    def kill(self) -> None:
        """End the process; needs no event loop."""
        if self._process is not None:
            self._process.kill()
            self._process = None

    def _turn(self) -> asyncio.Lock:
        """Return the running loop's lock: a planner may outlive a run and its loop."""
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
        """Return whether the engine can try the temporal problem."""
        return problem.timed is not None and can_time(self.engine)

    def _forms(self, problem: Problem) -> list[Callable[[], Problem]]:
        """Return makers of the forms of a problem, in the order in which they are tried."""
        forms = [problem.timed] if self._timed(problem) else []
        made = [_made(one) for one in (*forms, problem) if one is not None and not one.unreachable]
        return made if problem.unsliced is None else [*made, problem.unsliced]

    async def _tried(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """Yield the plans of the first form with a plan; each form but the last gets half of the remaining time."""
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
            seconds -= min(time.monotonic() - started, seconds / 2)  # a restart is not planning time
        async with aclosing(self._attempt(last(), seconds)) as outcomes:
            async for outcome in outcomes:
                yield replace(outcome, reproducible=not cut_short) if isinstance(outcome, PlanFound) else outcome

    async def _attempt(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """Yield the first outcome and each cheaper plan; any other outcome is the last."""
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
            async with aclosing(answers(process, written(problem), seconds)) as heard:
                async for answer in heard:
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
        """Return the ready process; a cancelled caller does not cancel the start."""
        known = self._process
        if known is not None:
            with contextlib.suppress(OutOfTimeError, EngineStoppedError):
                await self._started(known)
            if known.alive:  # checked late: the previous search may just have ended the process
                return known
            self.kill()
        self._process = process = EngineProcess(self._command)
        await self._started(process)
        return process

    async def _started(self, process: EngineProcess) -> None:
        if not process.idle:
            await aside(lambda: process.start(self._start_up_seconds))

    def _judged(self, answer: dict[str, Any], problem: Problem, seconds: float) -> PlanningOutcome:
        """Return the outcome of the engine's answer: a plan counts only if it solves the problem."""
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
