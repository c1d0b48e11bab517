"""What goes to one browser, however slow it is: nothing is lost, nothing piles up, and of a status only the latest."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra `viewer` is not installed")

from starlette.websockets import WebSocketDisconnect

from dsc.trace import Record, header
from dsc.viewer.broadcast import Broadcast, BrowserStream
from dsc.viewer.records import MOST_RECORDS, RecordLog


class Browser:
    """A socket whose other end takes in a message only when `takes` says so."""

    def __init__(self) -> None:
        self.wants: asyncio.Queue[dict[str, int] | None] = asyncio.Queue()
        self.room = asyncio.Semaphore(0)
        self.got: list[dict[str, Any]] = []
        self.waiting = 0

    async def receive_json(self) -> dict[str, int]:
        wanted = await self.wants.get()
        if wanted is None:
            raise WebSocketDisconnect
        return wanted

    async def send_text(self, text: str) -> None:
        self.waiting += 1
        await self.room.acquire()
        self.waiting -= 1
        self.got.append(json.loads(text))

    async def takes(self, messages: int) -> None:
        for _ in range(messages):
            self.room.release()
        for _ in range(20 * messages + 20):
            await asyncio.sleep(0)

    @property
    def records(self) -> list[int]:
        return [record["seq"] for said in self.got for record in said.get("records", ())]


def feed(log: RecordLog, count: int) -> None:
    for _ in range(count):
        log.receive(Record(len(log) + 1, 0.0, "log", None, {"text": "x"}))


def streamed(use) -> None:
    """Let `use(browser, log, how)` go on beside a stream to that browser; the stream does not sleep between messages."""

    async def going() -> None:
        browser, log, how = Browser(), RecordLog(header(), live=True), {"paused": None}
        rounds = Broadcast(log, lambda: dict(how), sleep=lambda _: asyncio.sleep(0))
        stream = BrowserStream(browser, log, rounds, control=False)  # type: ignore[arg-type]
        serving = asyncio.create_task(stream.serve())
        await use(browser, log, how)
        browser.wants.put_nowait(None)
        await asyncio.wait_for(serving, 10)

    asyncio.run(going())


def test_for_a_browser_that_takes_nothing_one_message_waits_and_no_more():
    async def use(browser: Browser, log: RecordLog, how: dict[str, Any]) -> None:
        del how
        browser.wants.put_nowait({"want": 1})
        await browser.takes(1)
        for _ in range(50):
            feed(log, 100)
            await asyncio.sleep(0)
        assert browser.waiting == 1
        assert browser.records == []
        while browser.records[-1:] != [len(log)]:
            await browser.takes(1)
        assert browser.records == list(range(1, len(log) + 1))
        assert max(len(said.get("records", ())) for said in browser.got) <= MOST_RECORDS

    streamed(use)


def test_a_browser_that_lost_track_asks_again_and_gets_what_it_missed():
    async def use(browser: Browser, log: RecordLog, how: dict[str, Any]) -> None:
        del how
        feed(log, 30)
        browser.wants.put_nowait({"want": 1})
        await browser.takes(3)
        browser.wants.put_nowait({"want": 11})
        await browser.takes(2)
        assert browser.records == [*range(1, 31), *range(11, 31)]

    streamed(use)


def test_of_a_status_only_the_latest_is_said_and_only_if_it_is_new():
    async def use(browser: Browser, log: RecordLog, how: dict[str, Any]) -> None:
        browser.wants.put_nowait({"want": 1})
        await browser.takes(3)
        for reason in ("on request", "state a", "state b"):
            how["paused"] = reason
            log.wake()
        feed(log, 1)
        await browser.takes(3)
        feed(log, 1)
        await browser.takes(3)
        said = [one["paused"] for one in browser.got if one["type"] == "status"]
        assert said == [None, "state b"]
        assert browser.records == [1, 2]

    streamed(use)


def test_all_browsers_are_offered_the_same_in_a_round_and_one_that_takes_nothing_holds_up_nobody():
    async def going() -> None:
        log, made = RecordLog(header(), live=True), []
        rounds = Broadcast(log, lambda: {"paused": None}, sleep=lambda _: asyncio.sleep(0))
        browsers = [Browser() for _ in range(3)]
        slow, *quick = browsers
        for browser in browsers:
            made.append(asyncio.create_task(BrowserStream(browser, log, rounds, control=False).serve()))  # type: ignore[arg-type]
            browser.wants.put_nowait({"want": 1})
        for count in (5, 10, 15):
            feed(log, 5)
            for browser in quick:
                await browser.takes(4)
                assert browser.records == list(range(1, count + 1))
        assert slow.got == []
        await slow.takes(4)
        assert slow.records == list(range(1, 16))
        for browser in browsers:
            browser.wants.put_nowait(None)
        await asyncio.wait_for(asyncio.gather(*made), 10)

    asyncio.run(going())
