"""Spoken commands as events: sentences of any source become `go_to`, `fetch`, `follow` or `not_understood`."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable
from typing import TextIO

from domains.dialogue.channels import Console, Script
from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.outcomes import Outcome
from dsc.skills import skill

Listen = Callable[[SkillCall], Awaitable[str | None]]
"""Function that waits for the next sentence; `None` is the end of all sentences."""
_FILLERS = frozenset({"please", "the", "a", "an", "to", "me", "robot", "butler", "my"})


class GoTo(Outcome):
    """Go to a place, and return."""

    where: str


class Fetch(Outcome):
    """Bring an item to the person."""

    what: str


class Follow(Outcome):
    """Follow the person."""


class NotUnderstood(Outcome):
    """The words are not a command."""

    words: str


class Silence(Outcome):
    """No further sentence will come."""


class Said(Outcome):
    """The sentence was spoken."""


class Speech(Component):
    """The ear and the voice of the butler.

    Args:
        next_sentence: waits for the next sentence, e.g. of a recogniser.
        say: receives the sentences of the robot.
    """

    name = "speech"

    def __init__(self, next_sentence: Listen, say: Callable[[str], None]) -> None:
        super().__init__()
        self._next_sentence = next_sentence
        self._say = say

    @skill(unlimited=True)
    async def listen(self, call: SkillCall) -> GoTo | Fetch | Follow | NotUnderstood | Silence:
        """Wait for a command."""
        words = await self._next_sentence(call)
        return Silence() if words is None else command(words)

    @skill
    async def say(self, call: SkillCall, words: str) -> Said:
        """Speak."""
        await call.clock.sleep(1.0)
        self._say(words)
        return Said()


def command(words: str) -> GoTo | Fetch | Follow | NotUnderstood:
    """Return the command that a sentence means, e.g. `please go to the dining room`."""
    spoken = words.lower().replace(",", " ").replace(".", " ").split()
    match [word for word in spoken if word not in _FILLERS]:
        case ["go" | "drive" | "approach", *name] if name:
            return GoTo(where="_".join(name))
        case ["fetch" | "bring", *name] if name:
            return Fetch(what="_".join(name))
        case ["follow", *_]:
            return Follow()
        case _:
            return NotUnderstood(words=words)


def from_prompt(stream: TextIO) -> Listen:
    """Return a function that waits for the lines of a terminal or pipe, in real time, up to the end of the stream."""
    console = Console(stream)
    return lambda call: console.receive(call, "", "")


def from_list(sentences: Iterable[str]) -> Listen:
    """Return a function that returns these sentences, one after the other."""
    script = Script.of_lines(sentences)
    return lambda call: script.receive(call, "", "")
