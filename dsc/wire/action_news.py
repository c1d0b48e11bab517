"""Messages about an action that its host pushes; pushes may be lost, doubled and reordered."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import Any

MOST_AHEAD = 100
"""Maximum number of pushed messages that wait for a lost one; the others are dropped, and fetched by `how`."""


class ActionNews:
    """The pushed messages about one action, by number, for one reader.

    Args:
        host: the address of the host; pushes of other senders are dropped.
    """

    def __init__(self, host: str) -> None:
        self._host = host
        self._messages: dict[int, Any] = {}
        self._arrived = asyncio.Event()

    def receive(self, sender: str, body: Any) -> None:
        """Store a pushed message; a malformed one is dropped."""
        match body:
            case {"n": int(number), "message": dict(message)} if sender == self._host:
                if len(self._messages) < MOST_AHEAD:
                    self._messages[number] = message
                self._arrived.set()
            case _:
                pass

    def take_after(self, received: int) -> list[Any]:
        """Return the messages that follow the first `received` ones without a gap, and drop all older ones."""
        found: list[Any] = []
        while received + len(found) + 1 in self._messages:
            found.append(self._messages[received + len(found) + 1])
        last = received + len(found)
        self._messages = {number: one for number, one in self._messages.items() if number > last}
        return found

    async def wait(self, seconds: float) -> None:
        """Wait until a message has arrived since the last wait, at most that many seconds."""
        with suppress(TimeoutError):
            await asyncio.wait_for(self._arrived.wait(), seconds)
        self._arrived.clear()
