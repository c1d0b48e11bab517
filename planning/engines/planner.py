"""The planner interface, and a planner that runs one engine within a limit of real time."""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections.abc import AsyncGenerator, Callable, Sequence
from contextlib import AbstractContextManager, aclosing, nullcontext
from dataclasses import replace
from typing import Any, Protocol, runtime_checkable

from planning.engines.action_elimination import indispensable
from planning.engines.process import EngineProcess, EngineStoppedError, OutOfTimeError, answers, worker
from planning.engines.registry import can_time, cannot, in_concert, refusal
from planning.engines.request import write_problem
from planning.model.cancellable_work import aside
from planning.model.plan import EngineFailed, NoneFound, Plan, PlanFound, PlanningOutcome, ProvenUnsolvable, TimedOut
from planning.model.problem import Problem


@runtime_checkable
class Improving(Protocol):
    """The interface of a `Planner` that improves plans; for real time only, since improvements are not repeatable."""

    def plans(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """Yield the outcome of `solve`, then each better plan that is found within `seconds` of real time.

        Closing the generator ends the search.
        """
        ...


ENGINE = "pyperplan"
"""The embedded engine, which is always installed and is deterministic."""

START_UP_SECONDS = 60.0


class Planner(Protocol):
    """The interface of a planner; tests and deployments may replace the planner."""

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        """Return the outcome after at most `seconds` of real time."""
        ...


class PlannerProcess:
    """A planner with one engine in a separate process, which stays ready between problems.

    The process solves one problem at a time; the next problem waits. Closing the generator of `plans` ends the search
    and all processes of the search; the worker process stays ready.
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
            engine: the name of the engine in `planning.engines.registry`.
            clock_hold: returns a context that is entered during a search, e.g. to stop a simulated clock.
            command: the command of the worker process; by default the command of the engine's worker.
            start_up_seconds: the limit for the start of the process; the start does not count as planning time.
            megabytes: the memory limit of each process of a search; by default the limit of the worker.
        """
        self.engine = engine
        self._clock_hold = clock_hold
        self._command = worker(engine, megabytes) if command is None else tuple(command)
        self._start_up_seconds = start_up_seconds
        self._process: EngineProcess | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._lock = asyncio.Lock()

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        """Return the outcome after at most `seconds` of real time, counted while the engine searches.

        If a slice has no plan, or none in half the time, the whole problem is tried. An engine that supports durations
        first tries the temporal problem, then the problem with one action at a time.
        """
        async with aclosing(self.plans(problem, seconds)) as plans:
            return await anext(plans)

    async def plans(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """Yield the outcome of `solve`, then each cheaper plan that an anytime engine finds in the remaining time.

        Closing the generator ends the search; use `async with contextlib.aclosing(...)`.
        """
        known = self._without_search(problem)
        if known is not None:
            yield known
            return
        async with self._turn():
            with self._clock_hold():
                async with aclosing(self._try_forms(problem, seconds)) as outcomes:
                    async for outcome in outcomes:
                        yield outcome

    async def warm_up(self) -> None:
        """Start the process before the first problem; if the start fails, the first problem reports the failure."""
        async with self._turn():
            with self._clock_hold(), contextlib.suppress(OSError, EngineStoppedError, OutOfTimeError):
                await self._ready()

    async def close(self) -> None:
        """End the process; a later `solve` starts a new process."""
        self.kill()

    def kill(self) -> None:
        """End the process; this method needs no event loop."""
        if self._process is not None:
            self._process.kill()
            self._process = None

    def _turn(self) -> asyncio.Lock:
        """Return the lock of the running event loop, since a planner may be used after its first loop has ended."""
        loop = asyncio.get_running_loop()
        if loop is not self._loop:
            self._loop, self._lock = loop, asyncio.Lock()
        return self._lock

    def _without_search(self, problem: Problem) -> PlanningOutcome | None:
        if problem.unreachable and not self._is_timed(problem):
            return self._none(problem, "unreachable: " + ", ".join(problem.unreachable))
        if not problem.goal and not problem.bounds and not problem.unreachable:
            return PlanFound(Plan(), self.engine, 0.0, problem.simulated_seconds)
        if cannot(self.engine, problem):
            return refusal(problem.features, self.engine)
        return None

    def _none(self, problem: Problem, reason: str) -> ProvenUnsolvable | NoneFound:
        if not problem.one_at_a_time:
            return ProvenUnsolvable(self.engine, reason)
        return NoneFound(self.engine, f"no plan with one action at a time ({reason}); {in_concert()}")

    def _is_timed(self, problem: Problem) -> bool:
        """Return whether the problem has a temporal form and the engine supports durations."""
        return problem.timed is not None and can_time(self.engine)

    def _forms(self, problem: Problem) -> list[Callable[[], Problem]]:
        """Return constructors of the forms of a problem, in the order in which the forms are tried."""
        forms = [problem.timed] if self._is_timed(problem) else []
        made = [_made(one) for one in (*forms, problem) if one is not None and not one.unreachable]
        return made if problem.unsliced is None else [*made, problem.unsliced]

    async def _try_forms(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """Yield the plans of the first form that has one; each form except the last uses half of the remaining time."""
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
            seconds -= min(
                time.monotonic() - started, seconds / 2
            )  # the restart of a process does not count as planning time
        async with aclosing(self._attempt(last(), seconds)) as outcomes:
            async for outcome in outcomes:
                yield replace(outcome, reproducible=not cut_short) if isinstance(outcome, PlanFound) else outcome

    async def _attempt(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """Yield the first outcome, then each cheaper plan; an outcome without a plan ends the search."""
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
            async with aclosing(answers(process, write_problem(problem), seconds)) as heard:
                async for answer in heard:
                    outcome = self._outcome_of(answer, problem, time.monotonic() - started)
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
        """Return the ready process; a cancellation of the caller does not cancel the start of the process."""
        known = self._process
        if known is not None:
            with contextlib.suppress(OutOfTimeError, EngineStoppedError):
                await self._start_process(known)
            if known.alive:  # after the wait: the end of the previous search may have killed the process
                return known
            self.kill()
        self._process = process = EngineProcess(self._command)
        await self._start_process(process)
        return process

    async def _start_process(self, process: EngineProcess) -> None:
        if not process.idle:
            await aside(lambda: process.start(self._start_up_seconds))

    def _outcome_of(self, answer: dict[str, Any], problem: Problem, seconds: float) -> PlanningOutcome:
        """Return the outcome for the engine's answer; a plan that does not solve the problem is a failure."""
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
