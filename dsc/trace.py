"""The record of a run: one format for files, tests, listeners and the viewer (JSON lines).

Every record is `{seq, t, type, cause, …}`. `t` is in seconds of run time, and `cause` is the `seq` of the record that
led to this one. In simulated time a record contains no wall time, process id or random id, so that equal runs produce
equal bytes. In real time, action ids contain the run.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import IO, Any, NamedTuple

from pydantic_core import PydanticSerializationError, to_json

from knowledge_base.errors import InputError
from knowledge_base.user_objects import as_exception

FORMAT = "dsc-trace"
VERSION = 2
BEGINS = f'{{"format": "{FORMAT}"'
"""The beginning of each trace file."""


class Record(NamedTuple):
    """An entry of the trace; a named tuple for speed, like `Event`.

    Attributes:
        seq: the record's number, from 1.
        t: seconds of run time.
        type: `world`, `plot`, `event`, `step`, `rule`, `decision`, `knowledge`, `action`, `log`, `end`, or a type of a
            higher package (`plan.found`, `scene`, …).
        cause: `seq` of the record that led to this one; `None` for the first.
        data: the record's content, as plain data.
    """

    seq: int
    t: float
    type: str
    cause: int | None
    data: Mapping[str, Any] = MappingProxyType({})

    def to_line(self) -> str:
        """Return one line of JSON, with the keys in a fixed order."""
        seq, t, type_, cause, data = self
        head = f'{{"seq": {seq}, "t": {round(t, 6)}, "type": "{type_}", "cause": {"null" if cause is None else cause}'
        return f"{head}, {text_of(data)[1:]}" if data else f"{head}}}"

    @staticmethod
    def from_line(line: str) -> Record:
        """Return the record of a line that `to_line` wrote; its time has six decimal places."""
        data = json.loads(line)
        return Record(data.pop("seq"), data.pop("t"), data.pop("type"), data.pop("cause"), data)


Listener = Callable[[Record], None]
"""Function that receives every record immediately; it must not block.

The function may store the record, which is immutable.
"""


class Trace:
    """Source of numbered records for listeners; the trace itself stores no record.

    Args:
        now: returns the seconds of run time.
        last: number of the last record of a resumed run.

    Attributes:
        now: returns the seconds of run time.
        heard: whether there is a listener.
        blame: receives an error of a listener, which is then not called again; `None` raises the error. An `OSError`,
            e.g. of a full disk, and an `InputError` are always raised.
        cause: `seq` of the record that leads to the next records.
    """

    def __init__(self, now: Callable[[], float], last: int = 0) -> None:
        self.now = now
        self._listeners: list[Listener] = []
        self._seq = last
        self.heard = False
        self.cause: int | None = None
        self.blame: Callable[[Exception], None] | None = None

    def listen(self, listener: Listener) -> Callable[[], None]:
        """Send `listener` every later record; return a function that ends this."""
        self._listeners.append(listener)
        self.heard = True
        return partial(self.ignore, listener)

    def ignore(self, listener: Listener) -> None:
        """Send `listener` no further record; a listener that was removed before is ignored."""
        if listener in self._listeners:  # one with an error was removed before
            self._listeners.remove(listener)
        self.heard = bool(self._listeners)

    def record(self, type_: str, /, **data: Any) -> int:
        """Send a record with the current `cause` to the listeners; return its `seq`."""
        self._seq += 1
        if not self.heard:
            return self._seq
        made = Record(self._seq, self.now(), type_, self.cause, data)
        for listener in tuple(self._listeners):
            try:
                listener(made)
            except (OSError, InputError):
                raise
            except (Exception, SystemExit, GeneratorExit) as error:
                if self.blame is None:
                    raise
                self._listeners.remove(listener)
                self.blame(as_exception(error))
        return self._seq


def header(**data: Any) -> str:
    """Return the first line of a trace file: format, version, and the inputs that determine the run (seed, hashes)."""
    return json.dumps({"format": FORMAT, "version": VERSION, **data}, ensure_ascii=False)


def write_to(stream: IO[str]) -> Listener:
    """Return a listener that writes each record as a line to `stream`."""

    def write(record: Record) -> None:
        stream.write(record.to_line() + "\n")

    return write


def text_of(value: Any) -> str:
    """Return the value as JSON without spaces, on one line.

    A number that JSON lacks, e.g. `Infinity`, is written as Python's `json` reads it.

    Raises:
        TypeError: a part of the value is not plain data.
        RecursionError: the value is nested too deeply.
    """
    try:
        return to_json(value, inf_nan_mode="constants").decode()
    except PydanticSerializationError:  # half a surrogate pair, or more than 255 levels of nesting
        return json.dumps(value, separators=(",", ":"))
