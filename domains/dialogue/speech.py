"""The voice and the ear of a robot: each sentence by all channels, and the first answer counts (S4.5)."""

from __future__ import annotations

import asyncio

from domains.dialogue.channels import Channel
from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.errors import SkillError
from dsc.outcomes import Outcome
from dsc.skills import skill
from knowledge_base.language.checking.inputs import require_methods


class Said(Outcome):
    """The words were spoken."""


class Sentence(Outcome):
    """The words of a person."""

    words: str


class Silence(Outcome):
    """No channel has an answer."""


class Dialogue(Component):
    """The component that speaks, asks and listens; its plot is `serve_dialogue`.

    A skill that a crash has interrupted is executed again. So words may be spoken twice, while each arc is served once.

    Args:
        channels: the ways to the persons, e.g. a voice and a tablet.

    Attributes:
        questions: the number of questions so far.
    """

    name = "dialogue"

    def __init__(self, *channels: Channel) -> None:
        super().__init__()
        self._channels = tuple([require_methods(channel, Channel) for channel in channels])
        self.questions = 0

    @skill(after_crash="repeat")
    async def say(self, call: SkillCall, to: str, words: str) -> Said:
        """Show words for a person on all channels."""
        await asyncio.gather(*(channel.show(call, to, words) for channel in self._channels))
        return Said()

    @skill(after_crash="repeat", unlimited=True)
    async def ask(self, call: SkillCall, to: str, topic: str) -> Sentence | Silence:
        """Show a question on all channels, and wait for the first answer."""
        self.questions += 1
        await self.say(call, to, topic)
        return await self._first_sentence(call, to, topic)

    @skill(after_crash="repeat", unlimited=True)
    async def listen(self, call: SkillCall) -> Sentence | Silence:
        """Wait for the next sentence of any person."""
        return await self._first_sentence(call, "", "")

    async def _first_sentence(self, call: SkillCall, to: str, topic: str) -> Sentence | Silence:
        """Return the first answer; a channel that fails does not end the others."""
        failure: SkillError | None = None
        waits = [asyncio.create_task(channel.receive(call, to, topic)) for channel in self._channels]
        try:
            for answer in asyncio.as_completed(waits):
                try:
                    words = await answer
                except SkillError as error:
                    failure = error
                    continue
                if words is not None:
                    return Sentence(words=words)
        finally:
            for wait in waits:
                wait.cancel()
            await asyncio.gather(*waits, return_exceptions=True)
        if failure is not None:
            raise failure
        return Silence()
