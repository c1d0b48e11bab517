"""Blocking work with a time limit, which ends early if its caller is cancelled.

The event loop may use simulated time, and must not wait for a thread when the loop closes. Blocking work therefore runs
in a daemon thread, and a timer measures real time. The work itself checks its `WorkLimit` regularly.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import threading
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from knowledge_base.language.evaluation.world_protocol import Bounds, Meter
from knowledge_base.user_objects import as_exception

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

T = TypeVar("T")


class WorkLimitError(Exception):
    """Error: the time limit of the work has passed, or its caller is cancelled.

    Attributes:
        doing: the work in progress at the end, e.g. `grounding action 'a'`.
    """

    def __init__(self, doing: str) -> None:
        super().__init__(f"out of time while {doing}")
        self.doing = doing


class WorkLimit(Meter):
    """A limit in real time for blocking work, which calls `spend` for each small piece.

    `spend` raises `WorkLimitError` after the limit, and after `cancel`.

    Attributes:
        doing: a description of the work in progress, for error messages.

    Args:
        seconds: the limit, from the construction of this object; unlimited if omitted.
    """

    def __init__(self, seconds: float = math.inf) -> None:
        self.doing = "constructing the problem"
        self._seconds = seconds
        self._cancelled = threading.Event()
        super().__init__(Bounds(seconds=seconds, cancelled=self._cancelled.is_set))

    @property
    def left(self) -> float:
        """The remaining seconds; infinite without a limit."""
        return max(0.0, self._seconds - self.seconds)

    def cancel(self) -> None:
        """Stop the work at its next call of `spend`; any thread may call this method."""
        self._cancelled.set()
        self.check_soon()

    def error(self, reason: str) -> WorkLimitError:  # noqa: ARG002  the caller knows its limit
        """Return the error that names the work in progress."""
        return WorkLimitError(self.doing)


@contextlib.contextmanager
def alarm(seconds: float, ring: Callable[[], object]) -> Iterator[None]:
    """Call `ring` in the event loop after `seconds` of real time, unless the block ends earlier."""
    watch = threading.Timer(min(seconds, threading.TIMEOUT_MAX), _in_loop(ring))
    watch.daemon = True
    if math.isfinite(seconds):
        watch.start()
    try:
        yield
    finally:
        watch.cancel()


async def aside(work: Callable[[], T], patience: WorkLimit | None = None) -> T:
    """Run `work` in a thread and return its result; abandon the thread when the limit has passed.

    Args:
        work: may block. To end early, it must call `spend` of the same limit; otherwise its thread continues.
        patience: the limit; it is cancelled at the end, also if the caller is cancelled. By default there is no limit.

    Raises:
        WorkLimitError: the time limit has passed.
    """
    patience = patience or WorkLimit()
    result: asyncio.Future[T] = asyncio.get_running_loop().create_future()

    def settle(settling: Callable[[Any], None], value: object) -> None:
        if not result.done():
            settling(value)

    def expire() -> None:
        settle(result.set_exception, WorkLimitError(patience.doing))

    answered, failed = _in_loop(partial(settle, result.set_result)), _in_loop(partial(settle, result.set_exception))

    def run() -> None:
        try:
            done = work()
        except BaseException as error:  # noqa: BLE001  the waiting task receives the error
            failed(as_exception(error))
        else:
            answered(done)

    threading.Thread(target=run, daemon=True).start()
    with alarm(patience.left, expire):
        try:
            return await result
        finally:
            patience.cancel()


def _in_loop(call: Callable[..., object]) -> Callable[..., None]:
    """Return a function for other threads that calls `call` in this thread's event loop."""
    loop = asyncio.get_running_loop()

    def called(*values: object) -> None:
        with contextlib.suppress(RuntimeError):  # the loop is closed, so no task waits
            loop.call_soon_threadsafe(call, *values)

    return called
