"""Livelock: messages of the run itself come without end while simulated time stands still."""

from __future__ import annotations

from collections import deque

from dsc.engine.steps import SendLater
from dsc.messages import Message, SkillMessage, TimerMessage
from dsc.sequencer.clock import LoopClock

MOST = 10_000
"""Answers, timers and own events that a run may take at one moment.

A long plan of skills that take no time needs a few thousand.
"""
_SHOWN = 8


class LivelockGuard:
    """Counts the messages that a run causes itself at one moment of simulated time.

    Real time passes anyway, and an operator can stop a robot in a livelock.
    """

    def __init__(self, clock: LoopClock) -> None:
        self._clock = clock
        self._moment = clock.now()
        self._count = 0
        self._latest: deque[str] = deque(maxlen=_SHOWN)

    def problem(self, message: Message) -> str | None:
        """The reason to end the run at this message, or `None`."""
        match message:
            case SkillMessage():
                event = message.outcome.event
            case TimerMessage():
                event = message.timer.event
            case SendLater():
                event = message.event.name
            case _:  # from outside
                return None
        if (now := self._clock.now()) != self._moment:
            self._moment, self._count = now, 0
        self._count += 1
        self._latest.append(event)
        if self._count <= MOST:
            return None
        return f"no time has passed for {MOST} macrosteps; the plot goes round: {' -> '.join(self._latest)}"
