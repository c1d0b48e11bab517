"""Broadcast of records to browsers: at most 30 rounds per second, each browser's socket at its own speed."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from starlette.websockets import WebSocket, WebSocketDisconnect

from dsc.viewer.records import MOST_RECORDS, RecordLog

FORMAT = "dsc-view/1"
UNSUPPORTED = 1003
"""Close code of a socket after a message that the page protocol does not define."""


class BrowserStream:
    """Sender of records and status to one browser.

    The stream reads records from the log when the socket can send them, and sends only the latest status. So a slow or
    vanished browser delays no other browser.
    """

    def __init__(self, socket: WebSocket, log: RecordLog, rounds: Broadcast, *, control: bool) -> None:
        self._socket, self._log, self._rounds, self._control = socket, log, rounds, control
        self._cursor: int | None = None
        self._sending: asyncio.Task[None] | None = None
        self._said: tuple[object, ...] | None = None

    async def serve(self) -> None:
        """Serve until the browser leaves."""
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
            except (ValueError, KeyError, RecursionError):  # not JSON, not text, or nested too deeply
                wanted = None
            seq = wanted.get("want") if isinstance(wanted, dict) else None
            if isinstance(seq, bool) or not isinstance(seq, int) or seq < 1:
                await self._socket.close(UNSUPPORTED, 'the page says {"want": NUMBER} and nothing else')
                return
            self._cursor = seq
            self._rounds.wake()

    def offer(self, status: dict[str, Any]) -> None:
        """Start sending new records and the status, unless the last message is still being sent."""
        if self._sending is None and (news := self._news(status)):
            self._sending = asyncio.create_task(self._send(news))
            self._sending.add_done_callback(self._sent)

    async def _send(self, news: list[str]) -> None:
        for text in news:
            await self._socket.send_text(text)

    def _sent(self, sending: asyncio.Task[None]) -> None:
        if not sending.cancelled() and sending.exception() is None:  # otherwise the browser has left, and `serve` ends
            self._sending = None
            self._rounds.wake()

    def _news(self, status: dict[str, Any]) -> list[str]:
        """Return the next messages; empty if nothing is new."""
        last = len(self._log)
        # The records show the progress of the run, unless one message cannot include all of them.
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
"""Minimum number of seconds between two rounds of a live run; people could not see more."""
Sleep = Callable[[float], Awaitable[object]]


class Served(Protocol):
    """A browser's stream, which may still be sending its last message."""

    def offer(self, status: dict[str, Any]) -> None:
        """Start sending new records and the status; must not wait."""


class Broadcast:
    """Offer of new records to all browsers, at most 30 times per second during a live run.

    Args:
        log: the records.
        status: returns the status of the run.
        sleep: waits for a number of seconds.
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
        """Offer new records to this stream during the block; call it in the loop's thread, like `wake`."""
        self._served.append(one)
        if self._going is None:
            self._going = asyncio.create_task(self._send_rounds())
        self.wake()
        try:
            yield
        finally:
            self._served.remove(one)
            if not self._served:
                self._going.cancel()
                self._going = None

    def wake(self) -> None:
        """Start a round after new records, or after a socket has finished sending."""
        self._more.set()

    async def _send_rounds(self) -> None:
        loop = asyncio.get_running_loop()

        def heard() -> None:
            if not self._woken:  # one wake-up for all records of a round
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
        """Serve browsers in sequence, distributed over the interval, to bound the load on the processor."""
        served = tuple(self._served)
        status = {"type": "status", "live": self._log.live, **self._status()}
        for one in served:
            if one in self._served:  # the browser may have left during the round
                one.offer(status)
            await self._sleep(INTERVAL_S / len(served) if self._log.live else 0)
