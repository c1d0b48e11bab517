"""Runs that go round and round without any time passing: in simulated time nothing else would ever come."""

from __future__ import annotations

from collections import deque

from dsc.engine.steps import SendLater
from dsc.messages import Message, SkillMessage, TimerMessage
from dsc.sequencer.clock import LoopClock

MOST = 10_000
"""Answers, timers and events of its own that a run may take at one moment; a few thousand for a long plan of skills
that take no time, never so many for a run that comes to an end."""
_SHOWN = 8


class LivelockGuard:
    """Counts what a run brings about itself while its simulated time stands still.

    Real time passes anyhow; whoever watches a robot go round can stop it.
    """

    def __init__(self, clock: LoopClock) -> None:
        self._clock = clock
        self._moment = clock.now()
        self._count = 0
        self._latest: deque[str] = deque(maxlen=_SHOWN)

    def problem(self, message: Message) -> str | None:
        """Why the run cannot go on with this message; `None` as long as it can."""
        if (now := self._clock.now()) != self._moment:
            self._moment, self._count = now, 0
        match message:
            case SkillMessage():
                event = message.outcome.event
            case TimerMessage():
                event = message.timer.event
            case SendLater():
                event = message.event.name
            case _:  # from outside
                return None
        self._count += 1
        self._latest.append(event)
        if self._count <= MOST:
            return None
        return f"no time has passed for {MOST} macrosteps; the plot goes round: {' -> '.join(self._latest)}"
