"""What waits to be taken by the sequencer."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Iterable

from dsc.engine.steps import Start
from dsc.sequencer.messages import Message, SkillMessage


class Inbox:
    """Messages in the order in which they came, for one reader.

    An `asyncio.Queue` can do more (many readers, a bound, `join`), and takes twice as long for it.
    """

    def __init__(self) -> None:
        self._messages: deque[Message] = deque()
        self._wake: asyncio.Future[None] | None = None

    def __len__(self) -> int:
        """How many wait."""
        return len(self._messages)

    @property
    def first(self) -> Message:
        """What is taken next; there has to be one."""
        return self._messages[0]

    def put(self, message: Message) -> None:
        """Add one, from the loop's own thread."""
        self._messages.append(message)
        if self._wake is not None and not self._wake.done():
            self._wake.set_result(None)

    def take(self) -> Message:
        """The first one; there has to be one."""
        return self._messages.popleft()

    def rearrange(self, order: Callable[[Iterable[Message]], Iterable[Message]]) -> None:
        """Put what waits in another order."""
        self._messages = deque(order(tuple(self._messages)))

    def drop_answers(self, start: Start) -> None:
        """Forget what else a skill has said that counts as ended."""
        self._messages = deque(m for m in self._messages if not (isinstance(m, SkillMessage) and m.start == start))

    async def filled(self) -> None:
        """Wait until there is one."""
        while not self._messages:
            self._wake = asyncio.get_running_loop().create_future()
            try:
                await self._wake
            finally:
                self._wake = None
