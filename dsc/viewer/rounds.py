"""All browsers are served in rounds: what comes between two of them goes out together, at most 30 times a second."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from dsc.viewer.records import RecordLog

INTERVAL_S = 1 / 30
"""Between two rounds of a live run at least: more could not be seen."""
Sleep = Callable[[float], Awaitable[object]]


class Served(Protocol):
    """A browser that takes what is new, or is still busy with what it got."""

    def offer(self, status: dict[str, Any]) -> None:
        """Begin to send what is new; must not wait."""


class Rounds:
    """Offers all browsers what is new, at most 30 times a second while a run is live.

    Args:
        log: the records.
        status: how the run is.
        sleep: waits so many seconds.
    """

    def __init__(
        self,
        log: RecordLog,
        status: Callable[[], dict[str, Any]],
        sleep: Sleep = asyncio.sleep,
    ) -> None:
        self._log, self._status, self._sleep = log, status, sleep
        self._served: list[Served] = []
        self._more = asyncio.Event()
        self._woken = False
        self._going: asyncio.Task[None] | None = None

    @contextmanager
    def serving(self, one: Served) -> Iterator[None]:
        """Offer this one what is new while the block lasts; in the loop's thread, as `wake`."""
        self._served.append(one)
        if self._going is None:
            self._going = asyncio.create_task(self._go_on())
        self.wake()
        try:
            yield
        finally:
            self._served.remove(one)
            if not self._served:
                self._going.cancel()
                self._going = None

    def wake(self) -> None:
        """There is something new, or somebody has room for more."""
        self._more.set()

    async def _go_on(self) -> None:
        loop = asyncio.get_running_loop()

        def heard() -> None:
            if not self._woken:  # who adds records wakes this thread once a round, however many follow
                self._woken = True
                loop.call_soon_threadsafe(self._more.set)

        forget = self._log.on_more(heard)
        try:
            while True:
                await self._more.wait()
                self._more.clear()
                self._woken = False
                await self._round()
        finally:
            forget()

    async def _round(self) -> None:
        """One browser after the other, spread over the interval: all at once they would want every processor."""
        served = tuple(self._served)
        status = {"type": "status", "live": self._log.live, **self._status()}
        for one in served:
            if one in self._served:  # else it has left meanwhile
                one.offer(status)
            await self._sleep(INTERVAL_S / len(served) if self._log.live else 0)
