"""Inbox holds messages until the sequencer takes them, now or at a later time."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Iterable, Iterator

from dsc.engine.steps import Start
from dsc.messages import LateMessage, Message, SkillMessage
from dsc.sequencer.clock import LoopClock


class Inbox:
    """Messages in the order of their arrival, for one reader.

    An `asyncio.Queue` can do more (several readers, a bound, `join`), and takes twice the time.

    Attributes:
        waiting: the messages; the reader takes the first.
    """

    def __init__(self) -> None:
        self.waiting: deque[Message] = deque()
        self._arrival: asyncio.Future[None] | None = None

    def put(self, message: Message) -> None:
        """Add a message, from the loop's own thread."""
        self.waiting.append(message)
        if self._arrival is not None and not self._arrival.done():
            self._arrival.set_result(None)

    def arrival(self) -> asyncio.Future[None]:
        """Resolves when the next message arrives."""
        self._arrival = asyncio.get_running_loop().create_future()
        return self._arrival

    def rearrange(self, order: Callable[[Iterable[Message]], Iterable[Message]]) -> None:
        """Put the waiting messages in another order."""
        self.waiting = deque(order(tuple(self.waiting)))

    def drop_answers(self, start: Start) -> None:
        """Remove further answers of a skill that has failed."""
        self.waiting = deque(m for m in self.waiting if not (isinstance(m, SkillMessage) and m.start == start))


class ScheduledInput:
    """Messages of later moments.

    Args:
        clock: run time.
        post: receives each message when it is due.
    """

    def __init__(self, clock: LoopClock, post: Callable[[LateMessage], None]) -> None:
        self._clock = clock
        self._post = post
        self._scheduled: dict[int, tuple[LateMessage, float, asyncio.TimerHandle]] = {}

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self._scheduled)

    def __iter__(self) -> Iterator[tuple[LateMessage, float]]:
        """Each message with the second of run time at which it is due."""
        return ((late, due) for late, due, _ in self._scheduled.values())

    def schedule(self, late: LateMessage, due: float) -> None:
        """Post the message at that second of run time."""

        def arrive() -> None:
            del self._scheduled[late.number]
            self._post(late)

        self._scheduled[late.number] = late, due, self._clock.call_at(due, arrive)

    def close(self) -> None:
        """Cancel all messages."""
        for _, _, handle in self._scheduled.values():
            handle.cancel()
