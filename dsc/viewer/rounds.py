"""All browsers are served in rounds, which leave nearly all of the time to a run in the same process."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from dsc.viewer.records import RecordLog

INTERVAL_S = 1 / 30
"""Between two rounds of a live run at least: more could not be seen."""
SHARE = 1 / 50
"""Of what a run computes, what all browsers together may at most, while it does."""
IDLE = 1 / 10
"""Of the time: who computes less than that has no use for what would be left to it."""
LOOK_EVERY_S = 0.1

Clock = Callable[[], float]
Sleep = Callable[[float], Awaitable[object]]


class Pace:
    """How long to rest after a round.

    Run and viewer are threads of one process, of which one computes at a time. After a round the viewer rests until
    what it computed is a fiftieth of what the others did, but not while nobody else computes: a run in real time mostly
    waits, one that is held or over does nothing, and that of another process is not slowed from here.

    Args:
        now: tells the time, in seconds as the others.
        own: tells how long this thread has computed.
        total: tells how long all threads of this process have.
    """

    def __init__(
        self, now: Clock = time.monotonic, own: Clock = time.thread_time, total: Clock = time.process_time
    ) -> None:
        self._now, self._own, self._total = now, own, total
        self.begin()

    def begin(self) -> None:
        """A round begins."""
        self._looked, self._own_before = self._now(), self._own()
        self._others_before = self._others_looked = self._total() - self._own_before

    def rest(self) -> float:
        """Seconds to rest before this is asked again; 0 if it was enough."""
        now, own = self._now(), self._own()
        others = self._total() - own
        enough = own - self._own_before <= SHARE * (others - self._others_before)
        busy = others - self._others_looked > IDLE * (now - self._looked)
        self._looked, self._others_looked = now, others
        return LOOK_EVERY_S if busy and not enough else 0.0


class Served(Protocol):
    """A browser that takes what is new, or is still busy with what it got."""

    def offer(self, status: dict[str, Any]) -> None:
        """Begin to send what is new; must not wait."""


class Rounds:
    """Offers all browsers what is new, at most 30 times a second while a run is live.

    Args:
        log: the records.
        status: how the run is.
        pace: how long to rest between rounds besides.
        sleep: waits so many seconds.
    """

    def __init__(
        self,
        log: RecordLog,
        status: Callable[[], dict[str, Any]],
        pace: Callable[[], Pace] = Pace,
        sleep: Sleep = asyncio.sleep,
    ) -> None:
        self._log, self._status, self._pace, self._sleep = log, status, pace, sleep
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
        loop, pace = asyncio.get_running_loop(), self._pace()  # a thread's own time is that of who asks for it

        def heard() -> None:
            if not self._woken:  # the run's thread pays for waking this one once a round, however many records follow
                self._woken = True
                loop.call_soon_threadsafe(self._more.set)

        forget = self._log.on_more(heard)
        try:
            while True:
                await self._more.wait()
                self._more.clear()
                self._woken = False
                pace.begin()
                self._round()
                await self._sleep(INTERVAL_S if self._log.live else 0)
                while (rest := pace.rest()) > 0:
                    await self._sleep(rest)
        finally:
            forget()

    def _round(self) -> None:
        status = {"type": "status", "live": self._log.live, **self._status()}
        for one in tuple(self._served):
            one.offer(status)
