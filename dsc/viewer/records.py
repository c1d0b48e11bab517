"""Records of a run as the lines of its trace: one writer appends, readers read at any position."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from threading import Lock
from typing import Any

from pydantic_core import from_json

from dsc.trace import FORMAT, VERSION, Record, header
from knowledge_base.errors import InputError, ParseError, Place
from knowledge_base.pddl.files import read_lines

MOST_RECORDS = 2000
MOST_CHARACTERS = 400_000
"""Maximum number of characters of one message, so that a browser handles it without a visible delay."""
DAMAGED = "damaged"
"""Type of a record that replaces an unreadable one."""
MOST_SHOWN = 200
"""Maximum number of characters that are shown of a damaged line."""
_T = re.compile(r'"t": (-?\d+(?:\.\d+)?(?:e[+-]?\d+)?)')
_NO_CHARACTER = re.compile("[\ud800-\udfff]")
MAX_TRACE_BYTES = 1024 * 1024 * 1024
"""Maximum number of bytes of a trace, as all its lines are kept in memory."""
MAX_LINE_BYTES = 64 * 1024 * 1024
"""Maximum number of bytes of one line of a trace; the longest record is the first, with the whole world."""


class RecordLog:
    """The lines of a trace; the record with number `seq` is line `seq`, counted from 1 after the header.

    One thread appends records, any thread reads them. Records are never removed, so that readers need no queues.

    Attributes:
        header: the first line of the trace, as data.
        complaints: descriptions of the damaged records in the file, one line for each.
    """

    def __init__(
        self,
        first_line: str | None = None,
        lines: Iterable[str] = (),
        *,
        live: bool = False,
        complaints: Sequence[str] = (),
    ) -> None:
        self.complaints = complaints
        self.header: dict[str, Any] = json.loads(first_line or header())
        self._lines = list(lines)
        self._live = live
        self._lock = Lock()
        self._wakers: tuple[Callable[[], None], ...] = ()
        self._batch: tuple[int, int, str] = (0, 0, "")

    def __len__(self) -> int:
        """Return the number of the last record."""
        return len(self._lines)

    @property
    def live(self) -> bool:
        """Whether more records may be appended."""
        return self._live

    def receive(self, record: Record) -> None:
        """Append a record; the method is a `Listener` of a trace."""
        self.append(record.to_line())

    def append(self, line: str) -> None:
        """Append a record as its line, without a check."""
        self._lines.append(line)
        self.wake()

    def end(self) -> None:
        """Mark the end of the records."""
        self.mark(live=False)

    def mark(self, *, live: bool) -> None:
        """Note whether more records may be appended: a killed run is over, until a program resumes it."""
        self._live = live
        self.wake()

    def on_more(self, waker: Callable[[], None]) -> Callable[[], None]:
        """Call `waker` after new records, from any thread; the returned function ends these calls."""
        with self._lock:
            self._wakers = (*self._wakers, waker)

        def forget() -> None:
            with self._lock:
                self._wakers = tuple(one for one in self._wakers if one is not waker)

        return forget

    def wake(self) -> None:
        """Notify all readers of new records."""
        for waker in self._wakers:  # the tuple is immutable: appending a record needs no lock
            waker()

    def batch(self, seq: int) -> tuple[str, int]:
        """Return a message with the records from `seq` on, up to the bound, and the next `seq`."""
        end, characters = seq - 1, 0
        last = min(len(self._lines), seq - 1 + MOST_RECORDS)
        while end < last and characters < MOST_CHARACTERS:
            end += 1
            characters += len(self._lines[end - 1])
        kept = self._batch
        if kept[:2] != (seq, end):  # browsers at equal positions share one message
            # The lines are already JSON: a second encoding would cost more than the rest of the viewer.
            lines = ",\n".join(self._lines[seq - 1 : end])
            text = f'{{"type":"records","from":{seq},"records":[\n{lines}\n]}}'
            kept = self._batch = (seq, end, text)
        return kept[2], end + 1

    def line(self, seq: int) -> str:
        """Return the line of a record.

        Raises:
            InputError: there is no such record.
        """
        if not 1 <= seq <= len(self._lines):
            raise InputError(f"there is no record {seq}; the last one is {len(self._lines)}")
        return self._lines[seq - 1]

    def record(self, seq: int) -> dict[str, Any]:
        """Return a record as data.

        Raises:
            InputError: there is no such record, or its line is not JSON.
        """
        try:
            found: dict[str, Any] = json.loads(self.line(seq))
        except (ValueError, RecursionError) as error:
            raise InputError(f"record {seq} is damaged: {error}") from None
        return found


def read_trace(path: Path) -> RecordLog:
    """Return the records of a trace file.

    A damaged line becomes a record of type `damaged`, and is listed in `complaints`.

    Raises:
        InputError: the file is missing, or cannot be read.
        ParseError: the file is not a trace, has another version, or its records are missing, duplicated or reordered.
    """
    lines = read_lines(path, MAX_TRACE_BYTES, MAX_LINE_BYTES, errors="surrogateescape")
    first = next(lines, "")
    _require_header(first, path)
    complaints: list[str] = []
    return RecordLog(first, _number_lines(lines, path, complaints), complaints=complaints)


def damaged(seq: int, t: float, line: int, why: str, text: str) -> str:
    """Return the line of a record that replaces an unreadable one."""
    data = {"line": line, "why": why, "text": text[:MOST_SHOWN]}
    return json.dumps({"seq": seq, "t": t, "type": DAMAGED, "cause": None, **data})


def _number_lines(lines: Iterable[str], path: Path, complaints: list[str]) -> Iterator[str]:
    """Yield the lines of records without a gap; records of type `damaged` replace lost ones."""
    last, before, lost = 0, "", list[tuple[int, str]]()

    def substitutes(count: int) -> Iterator[str]:
        found = _T.search(before, 0, MOST_SHOWN)
        t = float(found[1]) if found else 0.0
        for place, (number, line) in enumerate(lost, 1):
            why = _why_unreadable(line)
            name = f"record {last + place}" if place <= count else "a line that is no record"
            complaints.append(f"{path}:{number}: {name} is damaged: {why}")
            if place <= count:
                yield damaged(last + place, t, number, why, line.encode(errors="replace").decode())

    for number, line in enumerate(lines, 2):
        seq = _seq_of(line, last + 1)
        if seq is not None and 0 <= seq - last - 1 <= len(lost):
            if lost:
                yield from substitutes(seq - last - 1)
                lost = []
            last, before = seq, line
            yield line
        elif line.strip():
            lost.append((number, line))
    for place, (number, line) in enumerate(lost, 1):
        if _seq_of(line, 0) is not None:  # a sound record at a wrong position: the damage exceeds single lines
            raise ParseError(f"this is not record {last + place} of a trace", place=Place(str(path), number))
    yield from substitutes(len(lost))


def _seq_of(line: str, expected: int) -> int | None:
    """Return the number of the record in a line, or `None`; only both ends of the line are checked."""
    if line.endswith("}") and (line.isascii() or not _NO_CHARACTER.search(line)):
        if line.startswith(f'{{"seq": {expected}, '):
            return expected
        seq = parsed.get("seq") if isinstance(parsed := _parse(line), dict) else None
        return seq if isinstance(seq, int) and not isinstance(seq, bool) else None
    return None


def _why_unreadable(line: str) -> str:
    if _NO_CHARACTER.search(line):
        return "it has bytes that are no UTF-8"
    parsed = _parse(line)
    if isinstance(parsed, str):
        return f"it ends in the middle ({parsed})" if not line.endswith("}") else f"it is no JSON ({parsed})"
    return (
        "it is no record with a number"
        if parsed is None
        else f"it says that it is record {parsed.get('seq')}"[:MOST_SHOWN]
    )


def _parse(line: str) -> Any:
    """Return the object in the line, or the reason if the line is not JSON; `None` for other JSON."""
    try:
        parsed = from_json(line)
    except (TypeError, ValueError) as error:  # TypeError: half a surrogate pair
        return str(error)
    return parsed if isinstance(parsed, dict) else None


def _require_header(line: str, path: Path) -> None:
    parsed, begins = _parse(line), f'{{"format": "{FORMAT}", …}}'
    place = Place(str(path), 1)
    if not line.strip():
        raise ParseError(f"the file is empty, or its first line is; a trace begins with {begins}", place=place)
    if isinstance(parsed, str) and FORMAT in line:
        raise ParseError(f"the first line of this trace is damaged: {parsed}", place=place)
    if not isinstance(parsed, dict) or parsed.get("format") != FORMAT:
        raise ParseError(f"neither a store nor a trace, which begins with {begins}", place=place)
    if parsed.get("version") != VERSION:
        found = json.dumps(parsed.get("version"))[:MOST_SHOWN]
        raise ParseError(f"a trace of version {found}; this program reads version {VERSION}", place=place)
