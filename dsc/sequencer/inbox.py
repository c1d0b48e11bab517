"""Inbox holds messages until the sequencer takes them, now or at a later time."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Iterable, Iterator

from dsc.engine.steps import Start
from dsc.messages import LateMessage, Message, SkillMessage
from dsc.sequencer.clock import LoopClock


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


class ScheduledInput:
    """Messages that are still to come; `post` receives each when its time is there."""

    def __init__(self, clock: LoopClock, post: Callable[[LateMessage], None]) -> None:
        self._clock = clock
        self._post = post
        self._coming: dict[int, tuple[LateMessage, float, asyncio.TimerHandle]] = {}

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self._coming)

    def __iter__(self) -> Iterator[tuple[LateMessage, float]]:
        """Each with the second of run time at which it comes."""
        return ((late, due) for late, due, _ in self._coming.values())

    def wait_for(self, late: LateMessage, due: float) -> None:
        """Post it at that second of run time."""

        def arrive() -> None:
            del self._coming[late.number]
            self._post(late)

        self._coming[late.number] = late, due, self._clock.call_at(due, arrive)

    def close(self) -> None:
        """Nothing comes any more."""
        for _, _, handle in self._coming.values():
            handle.cancel()
