"""Interleaving of simultaneous messages to a sequencer, in an order that could also have occurred."""

from __future__ import annotations

from collections.abc import Iterable

from dsc.chance import uniform
from dsc.engine.steps import SendLater
from dsc.events import Event
from dsc.messages import KnowledgeMessage, LateMessage, Message, ParameterMessage, SkillMessage, TimerMessage
from dsc.sequencer.sequencer import Sequencer


class Interleaving:
    """Shuffles messages of one moment of simulated time by a seed.

    Before each macrostep it waits for all messages of the moment, and draws the source of the next one. Messages of one
    source keep their order, as every communication pattern promises. Sources are the events and the answer of one
    action, the chart's timers, the changes of one author, and events from outside. Messages of different sources may
    come in any order, such as an answer and its timeout.

    Args:
        seed: of all draws.

    Attributes:
        turned: number of messages taken before an earlier one.
    """

    def __init__(self, seed: int) -> None:
        self.turned = 0
        self._seed = seed
        self._turn = 0

    def attach(self, sequencer: Sequencer) -> None:
        """Shuffle the messages of this sequencer; call it before its run starts or is resumed."""

        async def settle() -> None:
            await sequencer.clock.settled()
            sequencer.rearrange(self._shuffled)

        sequencer.wait_before_events(settle)

    def _shuffled(self, waiting: Iterable[Message]) -> Iterable[Message]:
        """Move one source to the front and keep the order of the others; the next macrostep draws again."""
        messages = list(waiting)
        sources = list(dict.fromkeys(map(_source, messages)))
        if len(sources) > 1:
            self._turn += 1
            turn = str(self._turn)
            first = min(sources, key=lambda source: uniform(self._seed, source, turn))
            self.turned += first != sources[0]
            messages.insert(0, messages.pop(next(n for n, one in enumerate(messages) if _source(one) == first)))
        return messages


def _source(message: Message) -> str:
    """Return the source of a message; messages of one source keep their order."""
    match message:
        case LateMessage():
            return _source(message.message)
        case SkillMessage():
            return f"action {message.start.action_id}"
        case KnowledgeMessage():
            return f"author {message.author}"
        case TimerMessage() | SendLater():
            return "timers"
        case ParameterMessage():
            return "operator"
        case Event():
            return "outside"
