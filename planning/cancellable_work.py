"""Work on a problem that ends when its time is up, or as soon as nobody waits for it any more.

The event loop may run in simulated time and must never wait for a thread at its end. So blocking work is done in a
daemon thread of its own, a timer watches real time, and the work itself asks its `WorkLimit` now and then.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import threading
import time
from typing import TYPE_CHECKING, TypeVar

from knowledge_base.errors import described

if TYPE_CHECKING:
    from collections.abc import Callable

T = TypeVar("T")

_SPARINGLY = 256  # a look at the clock costs more than a binding


class WorkLimitError(Exception):
    """The time for a piece of work is up, or nobody waits for it.

    Attributes:
        doing: what was done then, e.g. `grounding action 'a'`.
    """

    def __init__(self, doing: str) -> None:
        super().__init__(f"out of time while {doing}")
        self.doing = doing


class WorkLimit:
    """How long a piece of work may take.

    Attributes:
        doing: what is being done, for whoever asks why it took too long.

    Args:
        seconds: of real time from now on; without a limit if left out.
    """

    def __init__(self, seconds: float = math.inf) -> None:
        self.doing = "posing the problem"
        self._deadline = time.monotonic() + seconds
        self._cancelled = False
        self._spent = 0

    @property
    def left(self) -> float:
        """The seconds that are left; infinite without a limit."""
        return max(0.0, self._deadline - time.monotonic())

    def cancel(self) -> None:
        """Nobody waits any more; may be called from any thread."""
        self._cancelled = True

    def spend(self) -> None:
        """To be called once for each small piece of work.

        Raises:
            WorkLimitError: that was the last.
        """
        self._spent += 1
        if self._cancelled or (self._spent % _SPARINGLY == 0 and not self.left):
            raise WorkLimitError(self.doing)


async def aside(work: Callable[[], T], patience: WorkLimit | None = None) -> T:
    """What the work returns or raises; done in a thread, which nobody waits for after the end of the patience.

    Args:
        work: may block. To end early it has to ask the patience itself; if it does not, it is left alone.
        patience: cancelled in the end, also if the caller is; a new one for what comes next.

    Raises:
        WorkLimitError: the time was up.
    """
    patience = patience or WorkLimit()
    loop = asyncio.get_running_loop()
    result: asyncio.Future[T] = loop.create_future()

    def settle(value: Callable[[], None]) -> None:
        with contextlib.suppress(RuntimeError):  # the loop is closed: nobody waits any more
            loop.call_soon_threadsafe(lambda: None if result.done() else value())

    def run() -> None:
        try:
            done = work()
        except BaseException as error:  # noqa: BLE001  carried over to the one who waits
            failure = error if isinstance(error, Exception) else RuntimeError(described(error))
            settle(lambda: result.set_exception(failure))
        else:
            settle(lambda: result.set_result(done))

    def expire() -> None:
        settle(lambda: result.set_exception(WorkLimitError(patience.doing)))

    watch = None if math.isinf(patience.left) else threading.Timer(patience.left, expire)
    threading.Thread(target=run, daemon=True).start()
    if watch is not None:
        watch.daemon = True
        watch.start()
    try:
        return await result
    finally:
        patience.cancel()
        if watch is not None:
            watch.cancel()
