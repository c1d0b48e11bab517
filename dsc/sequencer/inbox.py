"""The inbox with messages that wait for the sequencer, and the timers that post scheduled messages."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Iterable, Iterator

from dsc.engine.steps import Revoke, SendLater, Start
from dsc.events import EVERY
from dsc.messages import LateMessage, Message, SkillMessage, TimerMessage
from dsc.sequencer.clock import LoopClock, ScheduledCall

MOST_IN_A_TURN = 10_000
"""Upper bound of answers, timers and own events that a run handles at one simulated time.

A long plan of skills without duration needs a few thousand such messages.
"""
_SHOWN = 8
"""Number of events that the message about a livelock lists."""


class Inbox:
    """Messages in the order of their arrival, for one reader.

    An `asyncio.Queue` has more functions (several readers, a bound, `join`), but needs twice the time.

    Attributes:
        waiting: the messages; the reader removes the first one.
    """

    def __init__(self) -> None:
        self.waiting: deque[Message] = deque()
        self._arrival: asyncio.Future[None] | None = None

    def put(self, message: Message) -> None:
        """Append a message; call it in the loop's own thread."""
        self.waiting.append(message)
        self.wake()

    def arrival(self) -> asyncio.Future[None]:
        """Return a future that resolves when the next message arrives."""
        self._arrival = asyncio.get_running_loop().create_future()
        return self._arrival

    def wake(self) -> None:
        """Let the reader look again, although no message has arrived."""
        if self._arrival is not None and not self._arrival.done():
            self._arrival.set_result(None)

    def rearrange(self, order: Callable[[Iterable[Message]], Iterable[Message]]) -> None:
        """Replace the waiting messages by the result of `order`."""
        self.waiting = deque(order(tuple(self.waiting)))

    def drop_answers(self, start: Start) -> None:
        """Remove further answers of a skill that has failed."""
        self.waiting = deque(m for m in self.waiting if not (isinstance(m, SkillMessage) and m.start == start))


class Timers:
    """Scheduled messages: timeouts and periods of states, delayed events, and input from outside.

    Args:
        clock: run time.
        post: receives each message at its scheduled time.
    """

    def __init__(self, clock: LoopClock, post: Callable[[TimerMessage | SendLater | LateMessage], None]) -> None:
        self._clock = clock
        self._post = post
        self._pending: dict[int, tuple[TimerMessage | SendLater | LateMessage, float, ScheduledCall]] = {}
        self._last = 0

    @property
    def waiting(self) -> bool:
        """Whether a message is scheduled; periods do not count, as they are always scheduled."""
        return any(not (isinstance(one, TimerMessage) and one.timer.event == EVERY) for one, _, _ in self)

    @property
    def periods(self) -> frozenset[tuple[int, int]]:
        """Activation and number of every scheduled period."""
        timers = [one.timer for one, _, _ in self if isinstance(one, TimerMessage)]
        return frozenset((timer.activation, timer.index) for timer in timers if timer.event == EVERY)

    def __iter__(self) -> Iterator[tuple[TimerMessage | SendLater | LateMessage, float, ScheduledCall]]:
        """Iterate over scheduled messages, each with its second of run time and its handle."""
        return iter(self._pending.values())

    def schedule(self, message: TimerMessage | SendLater | LateMessage, due: float) -> None:
        """Schedule the message for second `due` of run time; `cancel`, `revoke` and `close` prevent it."""
        number = self._last = self._last + 1

        def arrive() -> None:
            del self._pending[number]
            self._post(message)

        self._pending[number] = message, due, self._clock.call_at(due, arrive)

    def cancel(self, activation: int) -> None:
        """Cancel the timers of a state that was exited."""
        self._drop(lambda one: isinstance(one, TimerMessage) and one.timer.activation == activation)

    def revoke(self, revoke: Revoke) -> None:
        """Cancel the delayed events with the id and frame of `revoke`."""
        which = revoke.frame, revoke.id
        self._drop(lambda one: isinstance(one, SendLater) and (one.event.frame, one.id) == which)

    def close(self) -> None:
        """Cancel all scheduled messages."""
        self._drop(lambda _: True)

    def _drop(self, wanted: Callable[[Message], bool]) -> None:
        for number, (message, _, handle) in tuple(self._pending.items()):
            if wanted(message):
                handle.cancel()
                del self._pending[number]


class LivelockGuard:
    """Counter of the messages that a run causes itself at one simulated time.

    In real time, no guard is needed: time always advances, and an operator can stop a robot in a livelock.
    """

    def __init__(self, clock: LoopClock) -> None:
        self._clock = clock
        self._moment = clock.now()
        self._count = 0
        self._latest: deque[str] = deque(maxlen=_SHOWN)

    def problem(self, message: Message) -> str | None:
        """Return the reason to end the run at this message, or `None`."""
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
        if self._count <= MOST_IN_A_TURN:
            return None
        return f"no time has passed for {MOST_IN_A_TURN} macrosteps; the plot goes round: {' -> '.join(self._latest)}"
