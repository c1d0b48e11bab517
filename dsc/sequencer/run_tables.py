"""The tables of runs in the file of a knowledge store, and how they are read.

`runs` are who ran what with which plots; `steps` every macrostep with the message taken, what it has changed of what
a restart needs (see `run_standing`), and the records of the trace. `forms` are plots by hash; `fence` says who may
write. A commit writes whole pages: a macrostep is one row of one table, without an index.

Runs and macrosteps are one chain of digests (`journal.integrity`): a run's row follows the end of the run before
(`seal`), its macrosteps follow the row, and its end follows the last of them, whose place is in `steps`. A macrostep's
`knowledge` is the digest of the version that it left, so that runs and knowledge of two stores never fit.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from dsc.engine.steps import Start
from dsc.sequencer.run_standing import RunSnapshot, SnapshotRow, latest_snapshot
from dsc.trace import Record
from knowledge_base.errors import Place, StoreError
from knowledge_base.journal.file import is_there, located, reading
from knowledge_base.journal.integrity import (
    NOTHING,
    Ends,
    Tip,
    damaged,
    require_link,
    require_own_log,
    require_sound,
    require_tables,
)

TABLES = {
    "runs": """CREATE TABLE runs (run INTEGER PRIMARY KEY, plot TEXT NOT NULL, arguments TEXT NOT NULL,
        version INTEGER NOT NULL, header TEXT NOT NULL, plots TEXT NOT NULL, domain TEXT NOT NULL, digest BLOB NOT NULL,
        ended TEXT, steps INTEGER, seal BLOB)""",
    "steps": """CREATE TABLE steps (place INTEGER PRIMARY KEY, run INTEGER NOT NULL, number INTEGER NOT NULL,
        time REAL NOT NULL, before INTEGER NOT NULL, version INTEGER NOT NULL, serials INTEGER NOT NULL,
        message TEXT NOT NULL, configuration TEXT NOT NULL, change TEXT NOT NULL, records TEXT NOT NULL,
        knowledge BLOB NOT NULL, digest BLOB NOT NULL)""",
    "forms": "CREATE TABLE forms (hash TEXT PRIMARY KEY, form TEXT NOT NULL) WITHOUT ROWID",
    "fence": "CREATE TABLE fence (epoch INTEGER NOT NULL, format INTEGER NOT NULL)",
}
FORMAT = 4
"""Of these tables; the first had no number."""
CHAIN = "steps"
"""Of runs and their macrosteps, in the store's table of ends."""
_RUNS = "SELECT run, plot, arguments, version, header, plots, domain, digest, ended, steps, seal FROM runs ORDER BY run"
_STEPS = """SELECT place, run, number, steps.time, before, version, serials, message, configuration, change, records,
    knowledge, steps.digest, changes.digest FROM steps LEFT JOIN changes USING (version)"""
_DIGEST = "SELECT digest FROM steps WHERE place = ?"


class _Span(NamedTuple):
    """A run with the places of its macrosteps: after `first`, up to `last`; `digest` is that of the run's own row."""

    row: RunRow
    first: int
    last: int
    digest: bytes


class _Kept(NamedTuple):
    """The row of a macrostep; `made` is the digest of the version in the knowledge's own tables."""

    place: int
    run: int
    number: int
    time: float
    before: int
    version: int
    serials: int
    message: str
    configuration: str
    change: str
    records: str
    knowledge: bytes
    digest: bytes
    made: bytes | None


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
    """The runs of a store, to be looked at; use it inside `archive`.

    Each row is judged by its digest when it is read; methods raise `DamagedStoreError`, which names the row.
    """

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self.connection = connection
        self.path = path
        self._forms: dict[str, Any] = {}
        self._spans: list[_Span] | None = None
        self._worlds: dict[int, bytes] | None = None

    def runs(self) -> list[RunRow]:
        """All of them, in order."""
        return [span.row for span in self._found()]

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
        return map(_step, self._rows(run))

    def last(self, run: int) -> StepRow:
        """The last macrostep of a run."""
        return _step(next(self._latest(run)))

    def records(self, run: int, after: int = 0) -> Iterator[Record]:
        """The records of a run's trace that are kept, in order; only those with a higher number than `after`."""
        for _, line in self.lines(run):
            if (record := Record.from_line(line)).seq > after:
                yield record

    def lines(self, run: int, since: int = 0) -> Iterator[tuple[int, str]]:
        """The lines of a run's trace from the macrostep at place `since` of the file on, each with its place there."""
        return ((row.place, line) for row in self._rows(run, since) for line in row.records.split("\n") if line)

    def latest_snapshot(self) -> RunSnapshot:
        """What stands after the last macrostep of all."""
        return latest_snapshot(row.change for row in self._latest(self.run().number))

    def under_way(self) -> list[tuple[Start, float]]:
        """The skills of the unfinished run that have not ended, with the second at which they were started."""
        rows = [SnapshotRow(*row) for _, row in sorted(self.latest_snapshot().pending.items())]
        return [(Start(**row.what), row.at) for row in rows if row.kind == Start.__name__ and not row.cancelled]

    def serials_before(self, run: int) -> int:
        """The last serial number given out before a run: no two runs of a store have an action id in common."""
        return self.last(run - 1).serials if run > 1 else 0

    def form(self, digest: str) -> Any:
        """The plot of that hash, as data; always the same object."""
        if digest not in self._forms:
            row = self.connection.execute("SELECT form FROM forms WHERE hash = ?", (digest,)).fetchone()
            if row is None or hashlib.sha256(str(row[0]).encode()).hexdigest() != digest:
                raise damaged(self.path, f"the plot with hash {digest} is missing, or not what was written")
            self._forms[digest] = json.loads(row[0])
        return self._forms[digest]

    def require_all(self) -> list[RunRow]:
        """Read every row; all runs.

        Raises:
            DamagedStoreError: something is not what was written.
        """
        for run in self.runs():
            for _ in self._rows(run.number):
                pass
        for (digest,) in self.connection.execute("SELECT hash FROM forms").fetchall():
            self.form(digest)
        return self.runs()

    def _found(self) -> list[_Span]:
        """The runs, with the ends of those that have ended."""
        if self._spans is not None:
            return self._spans
        spans: list[_Span] = []
        (last,) = self.connection.execute("SELECT coalesce(max(place), 0) FROM steps").fetchone()
        first, seal, unfinished = 0, NOTHING, False
        for number, (*begun, own, ended, steps, found) in enumerate(self.connection.execute(_RUNS), 1):
            name = f"run {number}"
            digest = require_link(self.path, name, own, (seal,), *begun)
            if begun[0] != number or unfinished:
                raise damaged(self.path, f"{name} is missing, or follows one that has not ended")
            unfinished = ended is None
            if not unfinished:
                (at,) = self.connection.execute(_DIGEST, (steps,)).fetchone() or (None,)
                if at is None or steps <= first:
                    raise damaged(self.path, f"{name} has ended, and its last macrostep is missing")
                seal = require_link(self.path, f"the end of {name}", found, (at,), steps, ended)
            spans.append(_Span(_run(begun, ended), first, last if unfinished else steps, digest))
            first = spans[-1].last
        if first != last:
            raise damaged(self.path, f"the run of macrosteps after place {first} of the table 'steps' is missing")
        ends = Ends(self.connection, self.path)
        if CHAIN in ends.tips:
            ends.require(CHAIN, Tip(last, seal))
        self._spans = spans
        return spans

    def _span(self, run: int) -> _Span:
        span = self._found()[self.run(run).number - 1]
        if span.first >= span.last:
            raise damaged(self.path, f"the macrosteps of run {run} are missing")
        return span

    def _rows(self, run: int, since: int = 0) -> Iterator[_Kept]:
        """The macrosteps of a run, from that place on."""
        span = self._span(run)
        place = max(span.first, since - 1)
        digest: object = span.digest
        if place > span.first:
            (digest,) = self.connection.execute(_DIGEST, (place,)).fetchone() or (None,)
        rows = self.connection.execute(f"{_STEPS} WHERE place > ? AND place <= ? ORDER BY place", (place, span.last))
        for row in map(_Kept._make, rows):
            place += 1
            self._require_row(row, span, place, digest)
            digest = row.digest
            yield row
        if place != span.last:
            raise damaged(self.path, f"macrostep {place + 1 - span.first} of run {run} is missing")

    def _latest(self, run: int) -> Iterator[_Kept]:
        """The macrosteps of a run, the last one first."""
        span = self._span(run)
        rows = self.connection.execute(
            f"{_STEPS} WHERE place > ? AND place <= ? ORDER BY place DESC", (span.first, span.last)
        )
        place, later = span.last, None
        for row in map(_Kept._make, rows):
            if later is not None:
                self._require_row(later, span, place, row.digest)
                yield later
                place -= 1
            later = row
        if later is not None:
            self._require_row(later, span, place, span.digest)
            yield later

    def _require_row(self, row: _Kept, span: _Span, place: int, before: object) -> None:
        name = f"macrostep {place - span.first} of run {span.row.number}"
        if (row.place, row.run) != (place, span.row.number) or row.number != place - span.first:
            raise damaged(self.path, f"{name} is missing, or not in its place")
        require_link(self.path, name, row.digest, (before, row.knowledge), *row[1:11])
        made = row.made
        if made is None:
            if self._worlds is None:
                self._worlds = dict(self.connection.execute("SELECT version, head FROM snapshots").fetchall())
            made = self._worlds.get(row.version)
            if made is None and row.version < min(self._worlds, default=0):  # forgotten since
                return
        if made != row.knowledge:
            raise damaged(self.path, f"version {row.version} of the knowledge is not the one after {name}")


@contextmanager
def archive(path: Path, *, again: bool = False) -> Iterator[RunArchive]:
    """A store's runs as they are now, whatever is written meanwhile.

    Args:
        path: the store.
        again: whether its pages were looked at before: those of a store that is not closed are, all of them.

    Raises:
        StoreError: the file is not there, not a store, damaged, or cannot be read.
    """
    with reading(located(path)) as connection:
        if not require_tables_of_runs(connection, path):
            raise StoreError("no run was ever kept in this store", place=Place(str(path)))
        if not again and not Ends(connection, path).closed:
            require_sound(connection, path)
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
    """Whether a run was begun in that file; raises `StoreError` if it is there and no store, or damaged."""
    if not is_there(place := located(path)):
        return False
    with reading(place) as connection:
        return require_tables_of_runs(connection, path) and bool(RunArchive(connection, path).runs())


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


def require_format(connection: sqlite3.Connection, path: Path) -> None:
    """Raise `StoreError` if the file has runs, or room for them, in tables that are not those of today."""
    if connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'runs'").fetchone() is None:
        return
    columns = {name for _, name, *_ in connection.execute("PRAGMA table_info(fence)")}
    row = connection.execute("SELECT format FROM fence").fetchone() if "format" in columns else (1,)
    if row is None:
        raise damaged(path, "the table 'fence' is empty")
    if row[0] != FORMAT:
        said = f"the runs in this store have format {row[0]}, this program reads and goes on with format {FORMAT}"
        raise StoreError(said, place=Place(str(path)))


def require_tables_of_runs(connection: sqlite3.Connection, path: Path) -> bool:
    """Whether the store has room for runs; raises `StoreError` if that is damaged or of another format."""
    ends = Ends(connection, path)
    require_own_log(path, ends.identity)
    if CHAIN in ends.chains:
        require_tables(connection, path, TABLES)
        require_format(connection, path)
        return True
    require_format(connection, path)
    if connection.execute("SELECT 1 FROM sqlite_master WHERE name IN ('runs', 'steps')").fetchone() is not None:
        raise damaged(path, "the table 'ends' does not know of its runs")
    return False


def _run(begun: list[Any], ended: str | None) -> RunRow:
    number, plot, arguments, version, header, plots, domain = begun
    return RunRow(
        number, plot, json.loads(arguments), version, json.loads(header), json.loads(plots), json.loads(domain),
        None if ended is None else json.loads(ended),
    )  # fmt: skip


def _step(row: _Kept) -> StepRow:
    return StepRow(
        row.number, row.time, row.before, row.version, row.serials, json.loads(row.message),
        tuple(json.loads(row.configuration)),
        tuple([Record.from_line(line) for line in row.records.split("\n") if line]),
    )  # fmt: skip
