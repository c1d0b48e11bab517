"""All records of a run as the lines of its trace: appended while it goes on, read at any place by anybody."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from threading import Lock
from typing import Any

from dsc.trace import FORMAT, Record, header
from knowledge_base.errors import InputError, ParseError, Place
from knowledge_base.pddl.files import read_text

MOST_RECORDS = 2000
MOST_CHARACTERS = 400_000
"""What goes out at once at most: a browser takes it in without a stutter."""


class RecordLog:
    """The lines of a trace; the record with number `seq` is line `seq`, counted from 1 behind the header.

    One thread appends, any thread reads. Nothing is ever taken away, so that readers need no queues of their own.
    """

    def __init__(self, first_line: str | None = None, lines: Iterable[str] = (), *, live: bool = False) -> None:
        self.header: dict[str, Any] = json.loads(first_line or header())
        self._lines = list(lines)
        self._live = live
        self._lock = Lock()
        self._wakers: tuple[Callable[[], None], ...] = ()
        self._batch: tuple[int, int, str] = (0, 0, "")

    def __len__(self) -> int:
        """The number of the last record."""
        return len(self._lines)

    @property
    def live(self) -> bool:
        """Whether there may be more records."""
        return self._live

    def hear(self, record: Record) -> None:
        """Take in a record; a `Listener` of a trace."""
        self.append(record.to_line())

    def append(self, line: str) -> None:
        """Take in a record as its line, which nobody looks at."""
        self._lines.append(line)
        self.wake()

    def end(self) -> None:
        """There are no more records."""
        self._live = False
        self.wake()

    def on_more(self, waker: Callable[[], None]) -> Callable[[], None]:
        """Call `waker` whenever there is more to read, from whatever thread; the function returned ends that."""
        with self._lock:
            self._wakers = (*self._wakers, waker)

        def forget() -> None:
            with self._lock:
                self._wakers = tuple(one for one in self._wakers if one is not waker)

        return forget

    def wake(self) -> None:
        """Tell everybody who waits that there is something new."""
        for waker in self._wakers:  # a tuple that nobody changes: no record needs a lock
            waker()

    def batch(self, seq: int) -> tuple[str, int]:
        """The message with the records from `seq` on, as many as go at once, and the seq that follows them."""
        end, characters = seq - 1, 0
        last = min(len(self._lines), seq - 1 + MOST_RECORDS)
        while end < last and characters < MOST_CHARACTERS:
            end += 1
            characters += len(self._lines[end - 1])
        kept = self._batch
        if kept[:2] != (seq, end):  # browsers that have caught up get the same: it is put together once
            # The lines are JSON already; writing them anew would cost more than everything else here.
            lines = ",\n".join(self._lines[seq - 1 : end])
            text = f'{{"type":"records","from":{seq},"records":[\n{lines}\n]}}'
            kept = self._batch = (seq, end, text)
        return kept[2], end + 1

    def line(self, seq: int) -> str:
        """The record as its line.

        Raises:
            InputError: there is no such record.
        """
        if not 1 <= seq <= len(self._lines):
            raise InputError(f"there is no record {seq}; the last one is {len(self._lines)}")
        return self._lines[seq - 1]

    def record(self, seq: int) -> dict[str, Any]:
        """The record as data; errors as for `line`."""
        found: dict[str, Any] = json.loads(self.line(seq))
        return found


def read_trace(path: Path) -> RecordLog:
    """The records of a trace file.

    Raises:
        InputError: there is no such file, or it cannot be read.
        ParseError: it is no trace, or a line of it is damaged.
    """
    first, *lines = read_text(path).split("\n")
    _require_header(first, path)
    while lines and not lines[-1]:
        lines.pop()
    for number, line in enumerate(lines, 1):
        if not (line.startswith(f'{{"seq": {number}, ') and line.endswith("}")):
            raise ParseError(f"this is not record {number} of a trace", place=Place(str(path), number + 1))
    return RecordLog(first, lines)


def _require_header(line: str, path: Path) -> None:
    try:
        said = json.loads(line)
    except ValueError:
        said = None
    if not isinstance(said, dict) or said.get("format") != FORMAT:
        begins = f'{{"format": "{FORMAT}", …}}'
        raise ParseError(f"neither a store nor a trace, which begins with {begins}", place=Place(str(path), 1))
