"""The record of a run: one format for files, tests, listeners and the viewer (JSON lines).

Every record is `{seq, t, type, cause, …}`: `t` in seconds of run time, `cause` the seq that led to it. No wall
time, process id or random id is in it, so that equal runs give equal bytes.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import IO, Any, NamedTuple

from pydantic_core import PydanticSerializationError, to_json

FORMAT = "dsc-trace"
VERSION = 2
BEGINS = f'{{"format": "{FORMAT}"'
"""The beginning of each trace file."""


class Record(NamedTuple):
    """One thing that happened; a named tuple, as `Event` is one.

    Attributes:
        seq: its number, from 1.
        t: seconds of run time.
        type: `world`, `plot`, `event`, `step`, `rule`, `decision`, `knowledge`, `action`, `log`, `end`, or an upper
            room's (`plan.found`, `scene`, …).
        cause: seq of the record that led to it; `None` for the first.
        data: its content, plain data.
    """

    seq: int
    t: float
    type: str
    cause: int | None
    data: Mapping[str, Any] = MappingProxyType({})

    def to_line(self) -> str:
        """One line of JSON, keys in a fixed order."""
        seq, t, type_, cause, data = self
        head = f'{{"seq": {seq}, "t": {round(t, 6)}, "type": "{type_}", "cause": {"null" if cause is None else cause}'
        return f"{head}, {text_of(data)[1:]}" if data else f"{head}}}"

    @staticmethod
    def from_line(line: str) -> Record:
        """The inverse of `to_line`; the time is rounded."""
        data = json.loads(line)
        return Record(data.pop("seq"), data.pop("t"), data.pop("type"), data.pop("cause"), data)


Listener = Callable[[Record], None]
"""Receives every record immediately; must not block. It may keep the record, which is immutable."""


class Trace:
    """Numbers records and hands them to listeners; keeps none itself.

    Args:
        now: tells the seconds of run time.
        last: number of the last record of a run that is resumed.

    Attributes:
        heard: whether there is a listener.
        cause: seq of the record that leads to the next ones.
    """

    def __init__(self, now: Callable[[], float], last: int = 0) -> None:
        self._now = now
        self._listeners: list[Listener] = []
        self._seq = last
        self.heard = False
        self.cause: int | None = None

    def listen(self, listener: Listener) -> None:
        """Tell `listener` every record from now on."""
        self._listeners.append(listener)
        self.heard = True

    def record(self, type_: str, /, **data: Any) -> int:
        """Add a record, caused by the current `cause`; returns its seq."""
        self._seq += 1
        if not self.heard:
            return self._seq
        made = Record(self._seq, self._now(), type_, self.cause, data)
        for listener in self._listeners:
            listener(made)
        return self._seq


def header(**data: Any) -> str:
    """The first line of a trace file: format, version, and what determines the run (seed, hashes)."""
    return json.dumps({"format": FORMAT, "version": VERSION, **data}, ensure_ascii=False)


def write_to(stream: IO[str]) -> Listener:
    """A listener that writes each record as a line."""

    def write(record: Record) -> None:
        stream.write(record.to_line() + "\n")

    return write


def text_of(value: Any) -> str:
    """JSON without spaces, on one line; numbers that JSON lacks (`Infinity`) are written as Python reads them.

    Raises:
        TypeError: a part of it is not plain data.
        RecursionError: it is nested too deeply.
    """
    try:
        return to_json(value, inf_nan_mode="constants").decode()
    except PydanticSerializationError:  # half a character, which no encoding has; or nested more than 255 times
        return json.dumps(value, separators=(",", ":"))
