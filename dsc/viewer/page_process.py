"""Process that serves the page of a run in another process: it reads lines of the trace, and writes commands.

Lines on standard input are records as in a trace, or messages:

- `begin` is the first message, with the `socket` to serve, its keys `token` and `code`, the truth value
  `control`, and the folder `data` or `null`.
- Later messages are `paused`, an `answer` to a command, and `end`.

Lines on standard output are the page's commands, each with a number. The end of the input ends the page.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from io import TextIOWrapper
from itertools import count
from pathlib import Path
from socket import socket
from typing import IO, Any

from dsc.viewer.access import PageAddress
from dsc.viewer.records import RecordLog
from dsc.viewer.server import Viewer
from knowledge_base.errors import InputError

NICENESS = 5
"""Niceness of the page's process, so that the run has priority over its page on a busy processor."""
_RECORD = '{"seq": '


class FarHands:
    """Control of a run in another process.

    Args:
        to: receives the commands.
        changed: is called after a change of `paused`.
    """

    def __init__(self, to: IO[str], changed: Callable[[], None]) -> None:
        self._to, self._changed = to, changed
        self._numbers = count(1)
        self._asked: dict[int, Future[dict[str, Any]]] = {}
        self.paused: str | None = None

    def obey(self, command: Mapping[str, Any]) -> dict[str, Any]:
        """Return the run's answer to a command; raise `InputError` if the run refuses the command."""
        number = next(self._numbers)
        answer = self._asked[number] = Future()
        self._to.write(json.dumps({"number": number, "command": command}) + "\n")
        self._to.flush()
        return answer.result()

    def hold(self, why: str | None) -> None:
        """Store the reason of a pause; `None` means that the run continues."""
        self.paused = why
        self._changed()

    def answer(self, number: int, said: dict[str, Any] | None, wrong: str) -> None:
        """Store the answer to a command, which resumes the waiting caller."""
        asked = self._asked.pop(number)
        if said is not None:
            asked.set_result(said)
        else:
            asked.set_exception(InputError(wrong))


def take_in(lines: Iterable[str], log: RecordLog, hands: FarHands) -> None:
    """Handle all messages of a run, until the input ends."""
    for line in lines:
        if line.startswith(_RECORD):
            log.append(line.rstrip("\n"))
            continue
        match told := json.loads(line):
            case {"paused": why}:
                hands.hold(why)
            case {"answer": number}:
                hands.answer(number, told.get("said"), told.get("wrong", ""))
            case {"end": True}:
                log.end()
            case _:
                pass  # of a newer version


def main() -> None:
    """Serve until the run's process closes the pipe or ends."""
    os.nice(NICENESS)
    lines = TextIOWrapper(sys.stdin.buffer, encoding="utf-8")
    begin = json.loads(lines.readline())
    log = RecordLog(begin["begin"], live=True)
    hands = FarHands(sys.stdout, log.wake)
    entrance = PageAddress(socket(fileno=begin["socket"]), begin["token"], begin["code"])
    data = Path(begin["data"]) if begin["data"] else None
    viewer = Viewer(log, entrance, hands if begin["control"] else None, data)
    viewer.start()
    take_in(lines, log, hands)
    viewer.close()


if __name__ == "__main__":
    main()
