"""Broadcast of records to browsers: rounds of at most 30 a second, each browser's socket at its own pace."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

from starlette.websockets import WebSocket, WebSocketDisconnect

from dsc.viewer.records import MOST_RECORDS, RecordLog

if TYPE_CHECKING:
    from dsc.viewer.records import RecordLog


FORMAT = "dsc-view/1"
UNSUPPORTED = 1003
"""The code with which a socket is closed on which something else is said than can be answered."""


class BrowserStream:
    """What goes to one browser.

    Records are read from the log when the socket has room for them, and of a status only the latest goes out. So a
    slow browser costs nobody anything, and one that is gone even less.
    """

    def __init__(self, socket: WebSocket, log: RecordLog, rounds: Broadcast, *, control: bool) -> None:
        self._socket, self._log, self._rounds, self._control = socket, log, rounds, control
        self._cursor: int | None = None
        self._sending: asyncio.Task[None] | None = None
        self._said: tuple[object, ...] | None = None

    async def serve(self) -> None:
        """Until the browser goes away."""
        hello = {
            "type": "hello", "format": FORMAT, "header": self._log.header, "first": 1, "last": len(self._log),
            "live": self._log.live, "control": self._control,
        }  # fmt: skip
        try:
            await self._socket.send_text(json.dumps(hello))
            with self._rounds.serving(self):
                await self._read()
        except WebSocketDisconnect:
            pass
        finally:
            if self._sending is not None:
                self._sending.cancel()
                await asyncio.gather(self._sending, return_exceptions=True)

    async def _read(self) -> None:
        while True:
            try:
                wanted = await self._socket.receive_json()
            except (ValueError, KeyError, RecursionError):  # no JSON, no text, nested too deeply
                wanted = None
            seq = wanted.get("want") if isinstance(wanted, dict) else None
            if isinstance(seq, bool) or not isinstance(seq, int) or seq < 1:
                await self._socket.close(UNSUPPORTED, 'the page says {"want": NUMBER} and nothing else')
                return
            self._cursor = seq
            self._rounds.wake()

    def offer(self, status: dict[str, Any]) -> None:
        """Begin to send what is new, records and how the run is, unless something is still on its way."""
        if self._sending is None and (news := self._news(status)):
            self._sending = asyncio.create_task(self._send(news))
            self._sending.add_done_callback(self._sent)

    async def _send(self, news: list[str]) -> None:
        for text in news:
            await self._socket.send_text(text)

    def _sent(self, sending: asyncio.Task[None]) -> None:
        if not sending.cancelled() and sending.exception() is None:  # else the browser is gone, as `serve` will hear
            self._sending = None
            self._rounds.wake()

    def _news(self, status: dict[str, Any]) -> list[str]:
        """The messages that go next, if there is anything to say."""
        last = len(self._log)
        # How far the run is can be seen from the records, unless more is to come than goes at once.
        behind = self._cursor is None or last - self._cursor >= MOST_RECORDS
        said = (status, last if behind else None)
        news = []
        if said != self._said:
            self._said = said
            news.append(json.dumps({"type": "status", **status, "last": last}))
        if self._cursor is not None and self._cursor <= last:
            text, self._cursor = self._log.batch(self._cursor)
            news.append(text)
        return news


INTERVAL_S = 1 / 30
"""Between two rounds of a live run at least: more could not be seen."""
Sleep = Callable[[float], Awaitable[object]]


class Served(Protocol):
    """A browser that takes what is new, or is still busy with what it got."""

    def offer(self, status: dict[str, Any]) -> None:
        """Begin to send what is new; must not wait."""


class Broadcast:
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
