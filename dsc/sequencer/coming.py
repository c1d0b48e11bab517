"""What is handed in from outside to come later."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator

from dsc.sequencer.clock import LoopClock
from dsc.sequencer.messages import LateMessage


class Coming:
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
