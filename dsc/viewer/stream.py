"""One browser's socket: records from where it wants them, as fast as it takes them, never more than it asked for."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from dsc.viewer.records import MOST_RECORDS, RecordLog

FORMAT = "dsc-view/1"
INTERVAL_S = 1 / 30
"""Between two messages to a browser that has caught up."""

Status = Callable[[], dict[str, Any]]
Sleep = Callable[[float], Awaitable[None]]


class Stream:
    """What goes to one browser.

    Records are read from the log when the socket has room for them, and of a status only the latest goes out. So a
    slow browser costs nobody anything, and one that is gone even less.
    """

    def __init__(
        self, socket: WebSocket, log: RecordLog, status: Status, *, control: bool, sleep: Sleep = asyncio.sleep
    ) -> None:
        self._socket, self._log, self._status, self._control, self._sleep = socket, log, status, control, sleep
        self._cursor: int | None = None
        self._more = asyncio.Event()
        self._loop = asyncio.get_running_loop()
        self._woken = False
        self._said: tuple[object, ...] | None = None

    async def serve(self) -> None:
        """Until the browser goes away."""
        forget = self._log.on_more(self._wake)
        writer = asyncio.create_task(self._write())
        try:
            await self._read()
        except WebSocketDisconnect:
            pass
        finally:
            forget()
            writer.cancel()
            await asyncio.gather(writer, return_exceptions=True)

    def _wake(self) -> None:
        """Called by the run's thread for each record: it pays for waking the loop once, however many follow."""
        if not self._woken:
            self._woken = True
            self._loop.call_soon_threadsafe(self._more.set)

    async def _read(self) -> None:
        while True:
            wanted = await self._socket.receive_json()
            seq = wanted.get("want") if isinstance(wanted, dict) else None
            if isinstance(seq, int) and seq >= 1:
                self._cursor = seq
                self._more.set()

    async def _write(self) -> None:
        hello = {
            "type": "hello", "format": FORMAT, "header": self._log.header, "first": 1, "last": len(self._log),
            "live": self._log.live, "control": self._control,
        }  # fmt: skip
        await self._send(hello)
        while True:
            await self._more.wait()
            self._more.clear()
            self._woken = False
            await self._tell_status()
            while self._cursor is not None and self._cursor <= len(self._log):
                start = self._cursor
                text, following = self._log.batch(start)
                await self._socket.send_text(text)
                if self._cursor == start:  # else the page wants others meanwhile
                    self._cursor = following
            await self._sleep(INTERVAL_S)

    async def _tell_status(self) -> None:
        """Say how the run is, if that is new, or how far, if that cannot be seen from the records that follow."""
        status = {"type": "status", "live": self._log.live, **self._status()}
        last = len(self._log)
        behind = self._cursor is None or last - self._cursor >= MOST_RECORDS
        said = (status, last if behind else None)
        if said != self._said:
            self._said = said
            await self._send({**status, "last": last})

    async def _send(self, said: dict[str, Any]) -> None:
        await self._socket.send_text(json.dumps(said))
