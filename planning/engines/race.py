"""Planners of several engines: a race in real time, and a cache of outcomes by problem.

The first valid plan wins a race, and a cheaper one may follow. In simulated time one named engine plans
(`planning.engines.planner.PlannerProcess`), so that a run is repeatable. The winner of a race depends on the machine.
"""

from __future__ import annotations

import asyncio
import time
from collections import OrderedDict
from collections.abc import AsyncGenerator, Callable, Hashable, Iterable, Sequence
from contextlib import aclosing
from dataclasses import replace

from knowledge_base.errors import described
from planning.engines.planner import PlannerProcess
from planning.engines.registry import Engine, chosen, nobody
from planning.plan import (
    EngineFailed,
    NobodyCan,
    NoneFound,
    PlanFound,
    PlanningOutcome,
    ProvenUnsolvable,
    TimedOut,
)
from planning.strips import Problem

_PLAIN = Problem("", {}, (), (), ())

_Answer = tuple[str, PlanningOutcome | None]
"""An engine's name and outcome; `None` after its last outcome."""

_Failing = PlanFound | ProvenUnsolvable | NoneFound | TimedOut
"""The outcomes that can list failures of other engines."""


class PlannerRace:
    """A planner that races the engines that suit a problem: at most two, by its features and size.

    Each engine stays warm in a separate process. A new problem ends the search for a better plan of the last one. It
    waits while the last one has no plan yet.

    Args:
        choose: returns the engines for a problem, the preferred one first.
        make: returns the planner of an engine.
    """

    def __init__(
        self,
        *,
        choose: Callable[[Problem], Sequence[Engine]] = chosen,
        make: Callable[[str], PlannerProcess] = PlannerProcess,
    ) -> None:
        self._choose = choose
        self._make = make
        self._planners: dict[str, PlannerProcess] = {}
        self._improving: set[asyncio.Task[None]] = set()

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        """Return the first valid plan within `seconds` of real time, or the combined outcome of all engines.

        `failures` of the outcome lists the engines that failed. If all failed, the outcome is `EngineFailed`, with each
        in its `engine` and `message`.
        """
        async with aclosing(self.plans(problem, seconds)) as plans:
            return await anext(plans)

    async def plans(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """Yield the outcome of `solve`, then each cheaper plan that an engine finds in the remaining time.

        A problem with durations first goes to temporal engines. If they find no plan in half the time, it is tried with
        one action at a time.

        Closing the generator ends all searches: `async with contextlib.aclosing(...)`.
        """
        failures: tuple[EngineFailed, ...] = ()
        engines = [] if problem.timed is None else self._choose(problem.timed)
        if problem.timed is not None and engines:
            started, limit = time.monotonic(), seconds if problem.unreachable else seconds / 2
            async with aclosing(self._raced(engines, problem.timed, limit)) as outcomes:
                outcome = await anext(outcomes)
                if isinstance(outcome, PlanFound) or problem.unreachable:
                    yield outcome
                    async for outcome in outcomes:
                        yield outcome
                    return
            seconds -= min(time.monotonic() - started, limit)
            failures = _failures(outcome)
        problem = problem if problem.timed is None else replace(problem, timed=None)
        async with aclosing(self._raced(self._choose(problem), problem, seconds)) as outcomes:
            async for outcome in outcomes:
                yield outcome if isinstance(outcome, EngineFailed | NobodyCan) else _with(failures, outcome)

    async def _raced(
        self, engines: Sequence[Engine], problem: Problem, seconds: float
    ) -> AsyncGenerator[PlanningOutcome, None]:
        """Yield the outcomes of these engines for one form of a problem."""
        if not engines:
            yield nobody(problem)
            return
        for task in self._improving:
            task.cancel()
        answers: asyncio.Queue[_Answer] = asyncio.Queue()
        tasks = {asyncio.create_task(_run(self._planner(one.name), problem, seconds, answers)) for one in engines}
        try:
            async with aclosing(_better_and_better(answers, len(tasks), seconds)) as outcomes:
                async for outcome in outcomes:
                    self._improving |= tasks
                    yield outcome
        finally:
            self._improving -= tasks
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def warm_up(self, problem: Problem | None = None) -> None:
        """Start the engines for a problem (by default one of plain STRIPS), so that the first problem does not wait."""
        engines = self._choose(problem or _PLAIN)
        await asyncio.gather(*(self._planner(one.name).warm_up() for one in engines))

    async def close(self) -> None:
        """End all processes; a later `solve` starts new ones."""
        self.kill()

    def kill(self) -> None:
        """End all processes; needs no event loop."""
        for planner in self._planners.values():
            planner.kill()

    def _planner(self, name: str) -> PlannerProcess:
        if name not in self._planners:
            self._planners[name] = self._make(name)
        return self._planners[name]


def _with(failures: tuple[EngineFailed, ...], outcome: _Failing) -> PlanningOutcome:
    return replace(outcome, failures=(*failures, *outcome.failures)) if failures else outcome


def _failures(outcome: PlanningOutcome) -> tuple[EngineFailed, ...]:
    if isinstance(outcome, EngineFailed):
        return (outcome,)
    return () if isinstance(outcome, NobodyCan) else outcome.failures


async def _run(planner: PlannerProcess, problem: Problem, seconds: float, answers: asyncio.Queue[_Answer]) -> None:
    try:
        async with aclosing(planner.plans(problem, seconds)) as plans:
            async for outcome in plans:
                answers.put_nowait((planner.engine, outcome))
    except Exception as error:  # noqa: BLE001  a failed planner must not stop the other
        answers.put_nowait((planner.engine, EngineFailed(planner.engine, described(error))))
    finally:
        answers.put_nowait((planner.engine, None))


async def _better_and_better(
    answers: asyncio.Queue[_Answer], running: int, seconds: float
) -> AsyncGenerator[PlanningOutcome, None]:
    """Yield the first plan or proof, then each cheaper plan; without either, one outcome with all failures."""
    best: PlanFound | None = None
    failures: list[EngineFailed] = []
    late: list[str] = []
    while running:
        name, outcome = await answers.get()
        match outcome:
            case None:
                running -= 1
            case PlanFound() if best is None or outcome.cost < best.cost:
                best = replace(outcome, failures=tuple(failures))
                yield best
            case ProvenUnsolvable() | NoneFound() if best is None:
                yield replace(outcome, failures=tuple(failures))
                return
            case EngineFailed():
                failures.append(outcome)
            case TimedOut():
                late.append(name)
    if best is None and late:
        yield TimedOut(_names(late), seconds, tuple(failures))
    elif best is None:
        yield _all_failed(failures)


def _all_failed(failures: Sequence[EngineFailed]) -> EngineFailed:
    if len(failures) == 1:
        return failures[0]
    said = "; ".join(f"{one.engine}: {one.message}" for one in failures)
    return EngineFailed(_names(one.engine for one in failures), said)


def _names(names: Iterable[str]) -> str:
    return ", ".join(sorted(names))


LARGEST = 64
"""Number of cached problems; one of 50 items has about 3,000 ground actions."""


class CachingPlanner:
    """A planner that answers immediately if the same problem comes again.

    Two problems are the same if their facts, goal, numbers and ground actions are equal by value. A cached plan is
    therefore as valid as a new one; its caller validates each plan against the present world. Plans and proofs are
    cached, failures and timeouts are not.

    Args:
        planner: solves problems that are not cached.
        largest: number of problems; the least recently used is evicted first.
    """

    def __init__(self, planner: PlannerProcess | PlannerRace, largest: int = LARGEST) -> None:
        self._planner = planner
        self._largest = largest
        self._known: OrderedDict[Hashable, PlanFound | ProvenUnsolvable] = OrderedDict()

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        """Return the outcome; a cached plan has `from_cache` and takes no time."""
        async with aclosing(self.plans(problem, seconds)) as plans:
            return await anext(plans)

    async def plans(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """Yield the planner's outcomes and cache the best; a cached outcome is the only one."""
        started, key = time.monotonic(), _key(problem)
        known = self._known.get(key)
        if known is not None:
            self._known.move_to_end(key)
            yield _recalled(known, time.monotonic() - started)
            return
        async with aclosing(self._planner.plans(problem, seconds)) as plans:
            async for outcome in plans:
                self._remember(key, outcome)
                yield outcome

    async def close(self) -> None:
        """End the planner's processes."""
        self.kill()

    def kill(self) -> None:
        """End the planner's processes; needs no event loop."""
        self._planner.kill()

    def _remember(self, key: Hashable, outcome: PlanningOutcome) -> None:
        if isinstance(outcome, PlanFound | ProvenUnsolvable):
            self._known[key] = outcome
            self._known.move_to_end(key)
            if len(self._known) > self._largest:
                self._known.popitem(last=False)


def _recalled(known: PlanFound | ProvenUnsolvable, seconds: float) -> PlanFound | ProvenUnsolvable:
    known = replace(known, failures=())
    return replace(known, from_cache=True, seconds=seconds, translated=0.0) if isinstance(known, PlanFound) else known


def _key(problem: Problem) -> Hashable:
    """Return the key of a problem; the order of facts does not matter."""
    numbers = frozenset(problem.numbers.items())
    goal = (frozenset(problem.goal), frozenset(problem.bounds))
    timed = None if problem.timed is None else _key(problem.timed)
    return (problem.domain, frozenset(problem.init), numbers, goal, problem.actions, problem.unreachable, timed)
