"""The tables of runs in the file of a knowledge store, and how they are read.

`runs` are who ran what with which plots; `steps` every macrostep with the message taken, what it has changed of what
a restart needs (see `run_standing`), and the records of the trace. `memory` is what components of the one run that may
be unfinished remember. `forms` are plots by hash; `fence` says who may write. A commit writes whole pages: a macrostep
is one row of one table, without an index.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dsc.engine.steps import Start
from dsc.sequencer.run_standing import Row, Standing, standing
from dsc.trace import Record
from knowledge_base.errors import Place, StoreError
from knowledge_base.journal.file import is_there, located, reading

TABLES = (
    """CREATE TABLE IF NOT EXISTS runs (run INTEGER PRIMARY KEY, plot TEXT NOT NULL, arguments TEXT NOT NULL,
        version INTEGER NOT NULL, header TEXT NOT NULL, plots TEXT NOT NULL, domain TEXT NOT NULL, ended TEXT)""",
    """CREATE TABLE IF NOT EXISTS steps (place INTEGER PRIMARY KEY, run INTEGER NOT NULL, number INTEGER NOT NULL,
        time REAL NOT NULL, before INTEGER NOT NULL, version INTEGER NOT NULL, serials INTEGER NOT NULL,
        message TEXT NOT NULL, configuration TEXT NOT NULL, change TEXT NOT NULL, records TEXT NOT NULL)""",
    "CREATE TABLE IF NOT EXISTS memory (component TEXT PRIMARY KEY, memory TEXT NOT NULL)",
    "CREATE TABLE IF NOT EXISTS forms (hash TEXT PRIMARY KEY, form TEXT NOT NULL) WITHOUT ROWID",
    "CREATE TABLE IF NOT EXISTS fence (epoch INTEGER NOT NULL, format INTEGER NOT NULL)",
)
FORMAT = 2
"""Of these tables; the first had no number."""
_RUNS = "SELECT run, plot, arguments, version, header, plots, domain, ended FROM runs"


@dataclass(frozen=True, slots=True)
class RunRow:
    """A run in a store.

    Attributes:
        number: the first is 1.
        plot, arguments: what was to be run.
        version: that of the knowledge at the beginning.
        header: what else its program said of it.
        plots: the hashes of all plots of its library by name.
        domain: what else plots rely on, as text by what it is called.
        ended: how it came to its end (`finished`, `problem`); `None` while it has not.
    """

    number: int
    plot: str
    arguments: Mapping[str, Any]
    version: int
    header: Mapping[str, Any]
    plots: Mapping[str, str]
    domain: Mapping[str, str]
    ended: Mapping[str, Any] | None


@dataclass(frozen=True, slots=True)
class StepRow:
    """A macrostep of a run.

    Attributes:
        number: the first is 1.
        time: seconds of run time.
        before, version: those of the knowledge, before and after it.
        serials: the last serial number that was given out.
        message: what was taken, as `run_forms.message_form`; the first one is the start.
        configuration: paths of the active states after it.
        records: of the trace, since the macrostep before.
    """

    number: int
    time: float
    before: int
    version: int
    serials: int
    message: Mapping[str, Any]
    configuration: tuple[str, ...]
    records: tuple[Record, ...]


class RunArchive:
    """The runs of a store, to be looked at; use it inside `archive`."""

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self.connection = connection
        self.path = path
        self._forms: dict[str, Any] = {}

    def runs(self) -> list[RunRow]:
        """All of them, in order."""
        return [_run(row) for row in self.connection.execute(f"{_RUNS} ORDER BY run")]

    def run(self, number: int | None = None) -> RunRow:
        """The run of that number, or the last one; raises `StoreError` if it is not there."""
        found = self.runs()
        for one in reversed(found):
            if number in (None, one.number):
                return one
        there = f"there are {len(found)}" if found else "there is none"
        raise StoreError(f"there is no run {number or 1}; {there}", place=Place(str(self.path)))

    def steps(self, run: int) -> Iterator[StepRow]:
        """The macrosteps of a run, in order."""
        rows = self.connection.execute(
            "SELECT number, time, before, version, serials, message, configuration, records FROM steps "
            "WHERE run = ? ORDER BY place", (run,),
        )  # fmt: skip
        for number, time, before, version, serials, message, configuration, records in rows:
            yield StepRow(
                number, time, before, version, serials, json.loads(message), tuple(json.loads(configuration)),
                tuple([Record.from_line(line) for line in records.split("\n") if line]),
            )  # fmt: skip

    def records(self, run: int, after: int = 0) -> Iterator[Record]:
        """The records of a run's trace that are kept, in order; only those with a higher number than `after`."""
        rows = self.connection.execute("SELECT records FROM steps WHERE run = ? ORDER BY place", (run,))
        for (lines,) in rows:
            for line in lines.split("\n"):
                if line and (record := Record.from_line(line)).seq > after:
                    yield record

    def lines(self, run: int, since: int = 0) -> Iterator[tuple[int, str]]:
        """The lines of a run's trace from the macrostep at place `since` of the file on, each with its place there."""
        rows = self.connection.execute(
            "SELECT place, records FROM steps WHERE run = ? AND place >= ? ORDER BY place", (run, since)
        )
        return ((place, line) for place, lines in rows for line in lines.split("\n") if line)

    def standing(self) -> Standing:
        """What stands after the last macrostep of all."""
        rows = self.connection.execute("SELECT change FROM steps ORDER BY place DESC")
        return standing(text for (text,) in rows)

    def under_way(self) -> list[tuple[Start, float]]:
        """The skills of the unfinished run that have not ended, with the second at which they were started."""
        rows = [Row(*row) for _, row in sorted(self.standing().pending.items())]
        return [(Start(**row.what), row.at) for row in rows if row.kind == Start.__name__ and not row.cancelled]

    def serials_before(self, run: int) -> int:
        """The last serial number given out before a run: no two runs of a store have an action id in common."""
        return serials_before(self.connection, run)

    def form(self, digest: str) -> Any:
        """The plot of that hash, as data; always the same object."""
        if digest not in self._forms:
            (text,) = self.connection.execute("SELECT form FROM forms WHERE hash = ?", (digest,)).fetchone()
            self._forms[digest] = json.loads(text)
        return self._forms[digest]


@contextmanager
def archive(path: Path) -> Iterator[RunArchive]:
    """A store's runs as they are now, whatever is written meanwhile.

    Raises:
        StoreError: the file is not there, not a store, or cannot be read.
    """
    with reading(located(path)) as connection:
        if not _has_tables(connection):
            raise StoreError("no run was ever kept in this store", place=Place(str(path)))
        require_format(connection, path)
        yield RunArchive(connection, path)


def records_of(
    path: Path | str, run: int | None = None, after: int = 0
) -> tuple[Mapping[str, Any], tuple[Record, ...]]:
    """What a trace file of a kept run would have: its header, and the records so far; also while the run goes on.

    Args:
        path: the store, which is only read.
        run: its number; the last one if left out.
        after: number of the last record that is not wanted.

    Raises:
        StoreError: the file is not there, not a store, or has no such run.
    """
    with archive(Path(path)) as runs:
        row = runs.run(run)
        return row.header, tuple(runs.records(row.number, after))


def has_run(path: Path) -> bool:
    """Whether a run was begun in that file; raises `StoreError` if it is there and no store."""
    if not is_there(place := located(path)):
        return False
    with reading(place) as connection:
        if not _has_tables(connection):
            return False
        require_format(connection, path)
        return bool(RunArchive(connection, path).runs())


def is_unfinished(path: Path) -> bool:
    """Whether a run was begun in that file that has not come to its end; raises `StoreError` as `has_run`."""
    if not has_run(path):
        return False
    with archive(path) as runs:
        return runs.run().ended is None


def unfinished(runs: RunArchive) -> RunRow:
    """The run that has not come to its end; raises `StoreError` if there is none."""
    for run in reversed(runs.runs()):
        if run.ended is None:
            return run
    raise StoreError("there is no unfinished run in this store", place=Place(str(runs.path)))


def serials_before(connection: sqlite3.Connection, run: int) -> int:
    """As of `RunArchive`, for who writes the store."""
    last = connection.execute(
        "SELECT serials FROM steps WHERE run < ? ORDER BY place DESC LIMIT 1", (run,)
    ).fetchone()
    return 0 if last is None else int(last[0])


def require_format(connection: sqlite3.Connection, path: Path) -> None:
    """Raise `StoreError` if the file has runs, or room for them, in tables that are not those of today."""
    if not _has_tables(connection):
        return
    columns = {name for _, name, *_ in connection.execute("PRAGMA table_info(fence)")}
    row = connection.execute("SELECT format FROM fence").fetchone() if "format" in columns else (1,)
    if row is not None and row[0] != FORMAT:
        said = f"the runs in this store have format {row[0]}, this program reads and goes on with format {FORMAT}"
        raise StoreError(said, place=Place(str(path)))


def _has_tables(connection: sqlite3.Connection) -> bool:
    return connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'runs'").fetchone() is not None


def _run(row: Any) -> RunRow:
    number, plot, arguments, version, header, plots, domain, ended = row
    return RunRow(
        number, plot, json.loads(arguments), version, json.loads(header), json.loads(plots), json.loads(domain),
        None if ended is None else json.loads(ended),
    )  # fmt: skip
