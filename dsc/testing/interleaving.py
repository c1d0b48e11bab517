"""What reaches a sequencer at one moment, in another order in which it might have come as well."""

from __future__ import annotations

from collections.abc import Iterable

from dsc.chance import uniform
from dsc.engine.steps import SendLater
from dsc.events import Event
from dsc.messages import KnowledgeMessage, LateMessage, Message, ParameterMessage, SkillMessage, TimerMessage
from dsc.sequencer.sequencer import Sequencer


class Interleaving:
    """Shuffles from a seed what simulated time lets come at one moment.

    Before each macrostep it waits until nothing more happens at the moment, and draws whose message is taken first.
    What comes from one place keeps its order, as every communication pattern promises: the events and the answer of
    one action, the chart's timers, the changes that one author makes, what comes from outside. All else may come in
    any order: answers of different actions, an answer and the timeout that is due with it, a change that somebody
    else makes and what the robot sees itself.

    Args:
        seed: of all draws.

    Attributes:
        turned: how often another message was taken than the one that came first.
    """

    def __init__(self, seed: int) -> None:
        self.turned = 0
        self._seed = seed
        self._turn = 0

    def attach(self, sequencer: Sequencer) -> None:
        """Shuffle what this sequencer takes, from before its run starts or is resumed."""

        async def settle() -> None:
            await sequencer.clock.settled()
            sequencer.rearrange(self._shuffled)

        sequencer.wait_before_events(settle)

    def _shuffled(self, waiting: Iterable[Message]) -> Iterable[Message]:
        """One source goes first, and all others keep their places: they are drawn anew before the next macrostep."""
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
    """Where it comes from; what comes from one source comes in its order."""
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
