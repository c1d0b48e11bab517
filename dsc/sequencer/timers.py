"""Timers of a run: timeouts and periods of states, and events that the chart sends to itself later."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from dsc.engine.steps import Revoke, SendLater, StartTimer
from dsc.events import EVERY
from dsc.messages import TimerMessage
from dsc.sequencer.clock import LoopClock


class Timers:
    """Pending timers; `post` receives each when it is due."""

    def __init__(self, clock: LoopClock, post: Callable[[TimerMessage | SendLater], None]) -> None:
        self._clock = clock
        self._post = post
        self._timers: dict[tuple[int, str, int], asyncio.TimerHandle] = {}
        self._sent: dict[int, tuple[SendLater, asyncio.TimerHandle]] = {}
        self._last_sent = 0

    @property
    def waiting(self) -> bool:
        """Whether a timer is pending; periods, which are always pending, do not count."""
        return bool(self._sent) or any(event != EVERY for _, event, _ in self._timers)

    @property
    def periods(self) -> frozenset[tuple[int, int]]:
        """Activation and number of every pending period."""
        return frozenset((activation, number) for activation, event, number in self._timers if event == EVERY)

    def start(self, timer: StartTimer, due: float) -> None:
        """Post a `TimerMessage` at that second of run time, if the activation is not cancelled before."""
        handle = self._clock.call_at(due, lambda: self._due(timer))
        self._timers[timer.activation, timer.event, timer.index] = handle

    def send(self, later: SendLater, due: float) -> None:
        """Post it at that second of run time, if it is not revoked before."""
        number = self._last_sent = self._last_sent + 1

        def arrive() -> None:
            del self._sent[number]
            self._post(later)

        self._sent[number] = (later, self._clock.call_at(due, arrive))

    def cancel(self, activation: int) -> None:
        """Cancel the timers of a state that was left."""
        for key in tuple(self._timers):
            if key[0] == activation:
                self._timers.pop(key).cancel()

    def revoke(self, revoke: Revoke) -> None:
        """Cancel the events of that id."""
        for number, (later, handle) in list(self._sent.items()):
            if (later.event.frame, later.id) == (revoke.frame, revoke.id):
                handle.cancel()
                del self._sent[number]

    def close(self) -> None:
        """Cancel all timers."""
        for handle in (*self._timers.values(), *[handle for _, handle in self._sent.values()]):
            handle.cancel()
        self._timers.clear()
        self._sent.clear()

    def _due(self, timer: StartTimer) -> None:
        del self._timers[timer.activation, timer.event, timer.index]
        self._post(TimerMessage(timer))
