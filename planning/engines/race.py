"""Planners with several engines: a race in real time, and a cache of outcomes by problem.

The first valid plan wins a race, and cheaper plans may follow. The winner depends on the speed of the machine. A run
in simulated time must be repeatable, and lets only one engine start (`planning.engines.registry.repeatable`).
"""

from __future__ import annotations

import asyncio
import time
from collections import OrderedDict
from collections.abc import AsyncGenerator, Callable, Hashable, Iterable, Sequence
from contextlib import aclosing
from dataclasses import replace

from knowledge_base.user_objects import described
from planning.engines.planner import PlannerProcess
from planning.engines.registry import Engine, chosen, refusal
from planning.model.plan import (
    EngineFailed,
    NoneFound,
    PlanFound,
    PlanningOutcome,
    ProvenUnsolvable,
    TimedOut,
    Unsupported,
)
from planning.model.problem import Problem

_PLAIN = Problem("", {}, (), (), ())

_Answer = tuple[str, PlanningOutcome | None]
"""The name of an engine and an outcome; `None` instead of an outcome marks the end of the engine's search."""

_Failing = PlanFound | ProvenUnsolvable | NoneFound | TimedOut
"""The outcomes that can contain failures of other engines."""


class PlannerRace:
    """A planner that races at most two engines, chosen by the features and the size of the problem.

    Each engine stays ready in a separate process. A new problem ends a search that only improves the plan of the
    previous problem. The new problem waits if the previous problem has no plan yet.

    Args:
        choose: returns the engines for a problem, the preferred engine first.
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

        The attribute `failures` of the outcome lists the engines that failed. If all engines failed, the outcome is
        `EngineFailed`; its attributes `engine` and `message` contain all of them.
        """
        async with aclosing(self.plans(problem, seconds)) as plans:
            return await anext(plans)

    async def plans(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """Yield the outcome of `solve`, then each cheaper plan that an engine finds in the remaining time.

        Temporal engines first try a problem with durations. If they find no plan in half the time, other engines try
        the problem with one action at a time.

        Closing the generator ends all searches; use `async with contextlib.aclosing(...)`.
        """
        failures: tuple[EngineFailed, ...] = ()
        engines = [] if problem.timed is None else self._choose(problem.timed)
        if problem.timed is not None and engines:
            started, limit = time.monotonic(), seconds if problem.unreachable else seconds / 2
            async with aclosing(self._race(engines, problem.timed, limit)) as outcomes:
                outcome = await anext(outcomes)
                if isinstance(outcome, PlanFound) or problem.unreachable:
                    yield outcome
                    async for outcome in outcomes:
                        yield outcome
                    return
            seconds -= min(time.monotonic() - started, limit)
            failures = _failures(outcome)
        problem = problem if problem.timed is None else replace(problem, timed=None)
        async with aclosing(self._race(self._choose(problem), problem, seconds)) as outcomes:
            async for outcome in outcomes:
                yield outcome if isinstance(outcome, EngineFailed | Unsupported) else _with(failures, outcome)

    async def _race(
        self, engines: Sequence[Engine], problem: Problem, seconds: float
    ) -> AsyncGenerator[PlanningOutcome, None]:
        """Yield the outcomes of a race of `engines` for one form of a problem, e.g. its temporal form."""
        if not engines:
            yield refusal(problem.features)
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
        """Start the engines for `problem` (by default for a STRIPS problem), so that the first search has no delay."""
        engines = self._choose(problem or _PLAIN)
        await asyncio.gather(*(self._planner(one.name).warm_up() for one in engines))

    async def close(self) -> None:
        """End all processes; a later `solve` starts new processes."""
        self.kill()

    def kill(self) -> None:
        """End all processes; this method needs no event loop."""
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
    return () if isinstance(outcome, Unsupported) else outcome.failures


async def _run(planner: PlannerProcess, problem: Problem, seconds: float, answers: asyncio.Queue[_Answer]) -> None:
    try:
        async with aclosing(planner.plans(problem, seconds)) as plans:
            async for outcome in plans:
                answers.put_nowait((planner.engine, outcome))
    except Exception as error:  # noqa: BLE001  a failed planner must not stop the other planner
        answers.put_nowait((planner.engine, EngineFailed(planner.engine, described(error))))
    finally:
        answers.put_nowait((planner.engine, None))


async def _better_and_better(
    answers: asyncio.Queue[_Answer], running: int, seconds: float
) -> AsyncGenerator[PlanningOutcome, None]:
    """Yield the first plan or proof, then each cheaper plan; without plan or proof, one outcome with all failures."""
    best: PlanFound | None = None
    failures: list[EngineFailed] = []
    late: list[str] = []
    while running:
        name, outcome = await answers.get()
        match outcome:
            case None:
                running -= 1
            case PlanFound():
                if best is None or outcome.cost < best.cost:
                    best = replace(outcome, failures=tuple(failures))
                    yield best
            case ProvenUnsolvable() | NoneFound():
                if best is None:
                    yield replace(outcome, failures=tuple(failures))
                    return
            case EngineFailed():
                failures.append(outcome)
            case Unsupported():
                failures.append(EngineFailed(name, outcome.message))
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
"""Number of cached problems; a problem with 50 items has about 3,000 ground actions."""


class CachingPlanner:
    """A planner that returns the cached outcome of an equal problem.

    Two problems are equal if their facts, goals, numbers and ground actions are equal by value. A cached plan is
    therefore as valid as a new plan; the caller validates each plan against the present world. Plans and proofs of
    unsolvability are cached; failures and timeouts are not.

    Args:
        planner: solves problems that are not cached.
        largest: the number of cached problems; the least recently used problem is evicted first.
    """

    def __init__(self, planner: PlannerProcess | PlannerRace, largest: int = LARGEST) -> None:
        self._planner = planner
        self._largest = largest
        self._known: OrderedDict[Hashable, PlanFound | ProvenUnsolvable] = OrderedDict()

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        """Return the outcome; a cached plan has `from_cache`, and no search is needed."""
        async with aclosing(self.plans(problem, seconds)) as plans:
            return await anext(plans)

    async def plans(self, problem: Problem, seconds: float) -> AsyncGenerator[PlanningOutcome, None]:
        """Yield the planner's outcomes and cache the last plan or proof; a cached outcome is yielded alone."""
        started, key = time.monotonic(), _key(problem)
        known = self._known.get(key)
        if known is not None:
            self._known.move_to_end(key)
            yield _recall(known, time.monotonic() - started)
            return
        async with aclosing(self._planner.plans(problem, seconds)) as plans:
            async for outcome in plans:
                self._remember(key, outcome)
                yield outcome

    async def close(self) -> None:
        """End the processes of the planner."""
        self.kill()

    def kill(self) -> None:
        """End the processes of the planner; this method needs no event loop."""
        self._planner.kill()

    def _remember(self, key: Hashable, outcome: PlanningOutcome) -> None:
        if isinstance(outcome, PlanFound | ProvenUnsolvable):
            self._known[key] = outcome
            self._known.move_to_end(key)
            if len(self._known) > self._largest:
                self._known.popitem(last=False)


def _recall(known: PlanFound | ProvenUnsolvable, seconds: float) -> PlanFound | ProvenUnsolvable:
    known = replace(known, failures=())
    return replace(known, from_cache=True, seconds=seconds, translated=0.0) if isinstance(known, PlanFound) else known


def _key(problem: Problem) -> Hashable:
    """Return a key that is equal for equal problems, regardless of the order of facts."""
    numbers = frozenset(problem.numbers.items())
    goal = (frozenset(problem.goal), frozenset(problem.bounds))
    timed = None if problem.timed is None else _key(problem.timed)
    return (problem.domain, frozenset(problem.init), numbers, goal, problem.actions, problem.unreachable, timed)
