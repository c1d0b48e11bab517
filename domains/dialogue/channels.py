"""Channels between a robot and persons: a console, text files, and a script."""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Protocol, TextIO

from dsc.calls import SkillCall
from dsc.errors import SkillError
from dsc.sequencer.clock import LoopClock

PERIOD = 0.2
"""Seconds between two looks at a text file."""


class Channel(Protocol):
    """A way to persons, e.g. a voice with a recogniser, or a tablet."""

    async def show(self, call: SkillCall, to: str, words: str) -> None:
        """Speak or show words for a person, and return when that is done."""
        ...

    async def receive(self, call: SkillCall, to: str, topic: str) -> str | None:
        """Wait for the next words; `None` if none will come.

        Args:
            call: the execution of the skill, with its clock.
            to: the person who was asked; empty for words of any person.
            topic: the question; empty without one.
        """
        ...


class Console:
    """A terminal or a pipe, in real time.

    Args:
        reads: has a line for each answer; the standard input by default.
        writes: receives the words; the standard output by default.
    """

    def __init__(self, reads: TextIO | None = None, writes: TextIO | None = None) -> None:
        self._reads = reads
        self._writes = writes
        self._left = b""

    async def show(self, call: SkillCall, to: str, words: str) -> None:  # noqa: ARG002
        """Print the words."""
        print(f"to {to}: {words}", file=self._writes, flush=True)

    async def receive(self, call: SkillCall, to: str, topic: str) -> str | None:  # noqa: ARG002
        """Return the next line that is not empty; `None` at the end of the input."""
        if isinstance(call.clock, LoopClock) and call.clock.simulated:
            raise SkillError("a console needs real time: dsc run --real-time")
        reads = (self._reads or sys.stdin).fileno()
        while True:
            line, end, left = self._left.partition(b"\n")
            if end:
                self._left = left
                if words := line.decode("utf-8", "replace").strip():
                    return words
                continue
            await _readable(reads)
            if not (more := os.read(reads, 65536)):
                self._left = b""
                return line.decode("utf-8", "replace").strip() or None
            self._left += more


async def _readable(file: int) -> None:
    """Wait until a file can be read without waiting."""
    loop, ready = asyncio.get_running_loop(), asyncio.Event()
    loop.add_reader(file, ready.set)
    try:
        await ready.wait()
    finally:
        loop.remove_reader(file)


class TextFiles:
    """Two text files: the robot appends its words to one, and other programs append their lines to the other.

    Args:
        said: receives lines such as `anna: Which floor is this?`.
        answers: each line that is appended from now on is one answer; the file may not exist yet.
    """

    def __init__(self, said: Path, answers: Path) -> None:
        self._said = said
        self._answers = answers
        self._count = len(self._lines())

    async def show(self, call: SkillCall, to: str, words: str) -> None:  # noqa: ARG002
        """Append a line."""
        with self._said.open("a", encoding="utf-8") as file:
            file.write(f"{to}: {words}\n")

    async def receive(self, call: SkillCall, to: str, topic: str) -> str:  # noqa: ARG002
        """Return the next line as soon as it is complete."""
        while True:
            lines = self._lines()
            if len(lines) > self._count:
                self._count += 1
                return lines[self._count - 1]
            await call.clock.sleep(PERIOD)

    def _lines(self) -> list[str]:
        """Return the complete lines."""
        text = self._answers.read_text(encoding="utf-8") if self._answers.exists() else ""
        return text.split("\n")[:-1]


class Script:
    """Answers of a function, e.g. of a simulated person.

    Args:
        answer: returns the words for a person and a topic; `None` if this person does not answer.
        seconds: run time until each answer.

    Attributes:
        said: the words of the robot, each with the person.
    """

    def __init__(self, answer: Callable[[str, str], str | None], seconds: float = 2.0) -> None:
        self.said: list[tuple[str, str]] = []
        self._answer = answer
        self._seconds = seconds

    @classmethod
    def of_lines(cls, lines: Iterable[str], seconds: float = 2.0) -> Script:
        """Return a script with lines for all topics, one after the other."""
        left = iter(lines)
        return cls(lambda _to, _topic: next(left, None), seconds)

    async def show(self, call: SkillCall, to: str, words: str) -> None:
        """Note the words; speaking takes a second."""
        await call.clock.sleep(1.0)
        self.said.append((to, words))

    async def receive(self, call: SkillCall, to: str, topic: str) -> str | None:
        """Return the answer after its seconds."""
        await call.clock.sleep(self._seconds)
        return self._answer(to, topic)
