"""*Push newest* and *push timed*: one component hands values on to many, none older than the last (S1.1, S1.15).

A subscriber asks for the value again and again, so that it has the newest even if a push was lost, and a publisher
that came late or came back finds its subscribers; a publisher forgets who has not asked for a while.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Any

from dsc.components.endpoint import Endpoint, NoAnswerError, RefusedError

RENEWED = 1.0
"""Seconds after which a subscriber asks again."""
FORGOTTEN = 5.0
"""Seconds after which a publisher forgets a subscriber that does not."""


class Publisher:
    """A push port.

    Args:
        endpoint: whose port it is.
        port: its name.
        period: push the newest value every so many seconds (*push timed*); without, whenever there is a new one.

    Attributes:
        newest: the newest value as subscribers `take` it, with its number.
    """

    def __init__(self, endpoint: Endpoint, port: str, period: float | None = None) -> None:
        self._endpoint = endpoint
        self._kind = f"push {port}"
        self._period = period
        self.newest: dict[str, Any] = {"life": endpoint.life, "n": 0, "value": None}
        self._subscribers: dict[str, float] = {}
        endpoint.answer(f"subscribe {port}", self._subscribe)

    def put(self, value: Any) -> None:
        """A new value; raises `InputError` if it is no plain data."""
        self.newest = {"life": self._endpoint.life, "n": self.newest["n"] + 1, "value": value}
        if self._period is None:
            self._push()

    async def run(self) -> None:
        """Push periodically until cancelled; only for *push timed*."""
        while True:
            await asyncio.sleep(self._period or math.inf)
            if self.newest["n"]:
                self._push()

    def _push(self) -> None:
        now = asyncio.get_running_loop().time()
        self._subscribers = {who: until for who, until in self._subscribers.items() if until > now}
        for who in self._subscribers:
            self._endpoint.push(who, self._kind, self.newest)

    async def _subscribe(self, sender: str, _: Any) -> dict[str, Any]:
        self._subscribers[sender] = asyncio.get_running_loop().time() + FORGOTTEN
        return self.newest


class Subscription:
    """The newest value of another component's push port; `run` keeps it so.

    Args:
        endpoint: who subscribes.
        publisher: whose port it is.
        port: its name.
        heard: is told each value that is newer than those known.

    Attributes:
        value: the newest one that is known; `None` before the first.
    """

    def __init__(
        self, endpoint: Endpoint, publisher: str, port: str, heard: Callable[[Any], None] | None = None
    ) -> None:
        self.value: Any = None
        self._tell = heard
        self._endpoint = endpoint
        self._publisher = publisher
        self._port = port
        self._numbers: dict[str, int] = {}  # the newest number of each life of the publisher, the present one last
        self._at = -math.inf
        self._news = asyncio.Event()
        endpoint.hear(f"push {port}", self._heard)

    @property
    def age(self) -> float:
        """Seconds since anything was heard from the publisher; infinite before the first time."""
        return asyncio.get_running_loop().time() - self._at

    async def next(self, within: float) -> Any:
        """Wait for a value that is newer than those known.

        Raises:
            NoAnswerError: none has come within so many seconds.
        """
        self._news.clear()
        try:
            async with asyncio.timeout(within):
                await self._news.wait()
        except TimeoutError:
            raise NoAnswerError(f"'{self._publisher}' has pushed no '{self._port}' within {within:g} s") from None
        return self.value

    async def run(self) -> None:
        """Subscribe, and again whenever the publisher may have forgotten, until cancelled."""
        while True:
            try:
                newest = await self._endpoint.call(self._publisher, f"subscribe {self._port}", within=FORGOTTEN)
            except (NoAnswerError, RefusedError):
                pass  # not there yet, or not there any more: it may come
            else:
                self.take(newest)
            await asyncio.sleep(RENEWED)

    def _heard(self, sender: str, newest: dict[str, Any]) -> None:
        if sender == self._publisher:
            self.take(newest)

    def take(self, newest: dict[str, Any]) -> None:
        """Hear what the publisher has said, `Publisher.newest`, on whatever way; nothing older than known is taken."""
        self._at = asyncio.get_running_loop().time()
        life, number = newest["life"], newest["n"]
        present = life not in self._numbers or next(reversed(self._numbers)) == life
        if present and number > self._numbers.setdefault(life, 0):
            self._numbers[life], self.value = number, newest["value"]
            self._news.set()
            if self._tell is not None:
                self._tell(self.value)
