"""Planner calls that end within a bound of real time, even if the planner ignores its limit and its cancellation."""

from __future__ import annotations

import asyncio
import contextlib
import math
from typing import TYPE_CHECKING, Any, Self, TypeVar

from dsc.components.hooks import contained
from knowledge_base.user_objects import described, text_of
from planning.engines.planner import Improving
from planning.model.cancellable_work import alarm
from planning.model.plan import EngineFailed, PlanFound, PlanningOutcome, TimedOut

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Awaitable

    from dsc.sequencer.clock import LoopClock
    from planning.engines.planner import Planner
    from planning.model.problem import Problem


STOPPING = 10.0
"""The seconds in which a cancelled planner must stop; the processes of an engine stop within one second."""

_Result = TypeVar("_Result")


class LateError(Exception):
    """Error: a planner has returned no result in time.

    Attributes:
        obeyed: whether the planner stopped when it was cancelled.
    """

    def __init__(self, *, obeyed: bool) -> None:
        super().__init__()
        self.obeyed = obeyed


async def bounded(work: Awaitable[_Result], seconds: float, name: str) -> _Result:
    """Return the result of `work` within a bound of real time; cancel `work` at the bound or with the caller.

    Args:
        work: the call of a planner.
        seconds: the bound of real time.
        name: the name of the planner, for reports of faults.

    Raises:
        LateError: the work has no result at the bound.
    """
    task = asyncio.ensure_future(_contain(work))
    try:
        in_time = await _ends(task, seconds)
    except asyncio.CancelledError:
        await _stop(task, name)
        raise
    if not (in_time or await _stop(task, name)):
        raise LateError(obeyed=False)
    if task.cancelled():
        if in_time:
            raise RuntimeError("it has cancelled itself")
        raise LateError(obeyed=True)
    return task.result()


async def _contain(work: Awaitable[_Result]) -> _Result:
    with contained():
        return await work


async def _ends(task: asyncio.Future[Any], seconds: float) -> bool:
    over = asyncio.get_running_loop().create_future()
    with alarm(seconds, over.cancel):
        try:
            await asyncio.wait((task, over), return_when=asyncio.FIRST_COMPLETED)
        finally:
            over.cancel()
    return task.done()


async def _stop(task: asyncio.Future[Any], name: str) -> bool:
    """Cancel the work; return whether it stopped within `STOPPING` seconds."""
    task.cancel()
    try:
        ended = await _ends(task, STOPPING)
    except asyncio.CancelledError:  # the program ends, and would otherwise wait for the task
        if not task.done():
            _throw_away(task, name)
        raise
    if not ended:
        _throw_away(task, name)
    return ended


def _throw_away(task: asyncio.Future[Any], name: str) -> None:
    """Report and abandon work that ignores its cancellation."""
    blame(name, "it ignores its cancellation")
    task.add_done_callback(lambda task: task.cancelled() or task.exception())  # marks its exception as retrieved
    if isinstance(task, asyncio.Task):
        with contextlib.suppress(Exception):
            task.get_coro().close()
    task.cancel()


def blame(name: str, what: str) -> None:
    """Report a planner's fault that affects no outcome to the exception handler of the event loop."""
    asyncio.get_running_loop().call_exception_handler({"message": f"planner {name}: {what}"})


class Improvements:
    """Better plans after the first plan: an asynchronous iterator, which the caller must close.

    Args:
        better: the plans of the planner (`Improving.plans`).
        name: the name of the planner, for reports of faults.
    """

    def __init__(self, better: AsyncGenerator[PlanningOutcome, None], name: str) -> None:
        self._better = better
        self._name = name

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> PlanningOutcome:
        return await bounded(anext(self._better), math.inf, self._name)

    async def aclose(self) -> None:
        """End the search for better plans; a fault of the planner is reported and raises no error."""
        try:
            await bounded(self._better.aclose(), STOPPING, self._name)
        except LateError:  # `bounded` has already reported a planner that ignores its cancellation
            return
        except Exception as error:  # noqa: BLE001  no fault of a planner may end the run
            blame(self._name, f"it cannot be closed: {described(error)}")


PATIENCE = 90.0
"""The seconds of real time by which a planner may exceed its limit; the start of an engine may take a minute."""

Answer = tuple[PlanningOutcome, Improvements | None]
"""The outcome of a planner, and its better plans, which the caller must close; `None` if there are none."""


class PlannerCalls:
    """Calls of one planner, with limits in real time and in the time of the run.

    Attributes:
        name: the name of the planner's class, for reports of faults.
    """

    def __init__(self, planner: Planner, clock: LoopClock) -> None:
        self._planner = planner
        self._clock = clock
        self.name = type(planner).__name__

    def abandon_at(self, seconds: float) -> asyncio.Timeout:
        """Return a timeout in simulated time for all calls of a block.

        A search stops simulated time. A planner that is itself simulated may let time pass up to this timeout.
        """
        return self._clock.timeout_at(self._clock.now() + seconds + PATIENCE if self._clock.simulated else math.inf)

    async def solve(self, problem: Problem, seconds: float, *, improving: bool = True) -> Answer:
        """Return the outcome of the planner, in real time with its better plans, which are not repeatable."""
        if improving and not self._clock.simulated and isinstance(self._planner, Improving):
            plans = self._planner.plans(problem, seconds)
            better = Improvements(plans, self.name)
            answer = await self._call_in_time(anext(plans), seconds)
            if isinstance(answer, PlanFound):
                return answer, better
            await better.aclose()
            return answer, None
        return await self._call_in_time(self._planner.solve(problem, seconds), seconds), None

    async def _call_in_time(self, answering: Awaitable[object], seconds: float) -> PlanningOutcome:
        """Return the outcome of a call within a bound of real time; a fault of the planner is an `EngineFailed`."""
        engine = self.name
        try:
            with self._clock.hold():
                answer = await bounded(answering, seconds + PATIENCE, engine)
        except LateError as late:
            if late.obeyed:
                return TimedOut(engine, seconds)
            return EngineFailed(engine, "no answer in time, and it ignores its cancellation")
        except Exception as error:  # noqa: BLE001  no fault of a planner may end the run
            return EngineFailed(engine, described(error))
        if isinstance(answer, PlanningOutcome):
            return answer
        return EngineFailed(engine, f"no answer: {text_of(answer, repr):.80}")
