"""Tables of runs in the file of a knowledge store, and `RunChain`, which checks each row by its digest.

`runs` holds a row a run; `steps` a row a macrostep: its message, its change of the state (see `snapshot`), its trace
records. `forms` holds plots by hash; `fence` names the writer. A commit writes whole pages, so a macrostep is one row
of one table, without an index.

Runs and macrosteps are one chain of digests (`journal.integrity`). A run's row follows the end of the run before
(`seal`); its macrosteps follow the row. Its end follows the last of them, whose place is in `steps`. A macrostep's
`knowledge` is the digest of the version after it, so that runs and knowledge of two stores never fit.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from knowledge_base.errors import Place, StoreError
from knowledge_base.journal.integrity import (
    NOTHING,
    Ends,
    Tip,
    damaged,
    require_link,
    require_own_log,
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
"""Name of the chain of runs and macrosteps in the store's table of ends."""
_RUNS = "SELECT run, plot, arguments, version, header, plots, domain, digest, ended, steps, seal FROM runs ORDER BY run"
_STEPS = """SELECT place, run, number, steps.time, before, version, serials, message, configuration, change, records,
    knowledge, steps.digest, changes.digest FROM steps LEFT JOIN changes USING (version)"""
_DIGEST = "SELECT digest FROM steps WHERE place = ?"


class RunSpan(NamedTuple):
    """The row of a run as stored, and the places of its macrosteps.

    Attributes:
        number: the first is 1.
        begun: the columns written when it began: run, plot, arguments, version, header, plots, domain.
        ended: its end as text; `None` while it has none.
        first, last: its macrosteps follow place `first`, up to place `last`.
        digest: digest of its row.
    """

    number: int
    begun: tuple[Any, ...]
    ended: str | None
    first: int
    last: int
    digest: bytes


class StoredStep(NamedTuple):
    """The row of a macrostep as stored; `made` is the digest of its version in the knowledge's own tables."""

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


class RunChain:
    """Reads the rows of runs and macrosteps, and checks each by its digest.

    Methods raise `DamagedStoreError`, which names the row.
    """

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self._connection = connection
        self._path = path
        self._spans: list[RunSpan] | None = None
        self._worlds: dict[int, bytes] | None = None

    def spans(self) -> list[RunSpan]:
        """All runs in order; read once."""
        if self._spans is None:
            self._spans = self._read_spans()
        return self._spans

    def steps(self, run: int, since: int = 0) -> Iterator[StoredStep]:
        """The macrosteps of a run in order, from place `since` on."""
        span = self._span(run)
        place = max(span.first, since - 1)
        digest: object = span.digest
        if place > span.first:
            (digest,) = self._connection.execute(_DIGEST, (place,)).fetchone() or (None,)
        rows = self._connection.execute(f"{_STEPS} WHERE place > ? AND place <= ? ORDER BY place", (place, span.last))
        for row in map(StoredStep._make, rows):
            place += 1
            self._require_step(row, span, place, digest)
            digest = row.digest
            yield row
        if place != span.last:
            raise damaged(self._path, f"macrostep {place + 1 - span.first} of run {run} is missing")

    def latest_steps(self, run: int) -> Iterator[StoredStep]:
        """The macrosteps of a run, the last one first."""
        span = self._span(run)
        rows = self._connection.execute(
            f"{_STEPS} WHERE place > ? AND place <= ? ORDER BY place DESC", (span.first, span.last)
        )
        place, later = span.last, None
        for row in map(StoredStep._make, rows):
            if later is not None:
                self._require_step(later, span, place, row.digest)
                yield later
                place -= 1
            later = row
        if later is not None:
            self._require_step(later, span, place, span.digest)
            yield later

    def _read_spans(self) -> list[RunSpan]:
        spans: list[RunSpan] = []
        (last,) = self._connection.execute("SELECT coalesce(max(place), 0) FROM steps").fetchone()
        first, seal, unfinished = 0, NOTHING, False
        for number, (*begun, own, ended, steps, found) in enumerate(self._connection.execute(_RUNS), 1):
            name = f"run {number}"
            digest = require_link(self._path, name, own, (seal,), *begun)
            if begun[0] != number or unfinished:
                raise damaged(self._path, f"{name} is missing, or follows one that has not ended")
            unfinished = ended is None
            if not unfinished:
                (at,) = self._connection.execute(_DIGEST, (steps,)).fetchone() or (None,)
                if at is None or steps <= first:
                    raise damaged(self._path, f"{name} has ended, and its last macrostep is missing")
                seal = require_link(self._path, f"the end of {name}", found, (at,), steps, ended)
            spans.append(RunSpan(number, tuple(begun), ended, first, last if unfinished else steps, digest))
            first = spans[-1].last
        if first != last:
            raise damaged(self._path, f"the run of macrosteps after place {first} of the table 'steps' is missing")
        ends = Ends(self._connection, self._path)
        if CHAIN in ends.tips:
            ends.require(CHAIN, Tip(last, seal))
        return spans

    def _span(self, run: int) -> RunSpan:
        span = self.spans()[run - 1]
        if span.first >= span.last:
            raise damaged(self._path, f"the macrosteps of run {run} are missing")
        return span

    def _require_step(self, row: StoredStep, span: RunSpan, place: int, before: object) -> None:
        name = f"macrostep {place - span.first} of run {span.number}"
        if (row.place, row.run) != (place, span.number) or row.number != place - span.first:
            raise damaged(self._path, f"{name} is missing, or not in its place")
        require_link(self._path, name, row.digest, (before, row.knowledge), *row[1:11])
        made = row.made
        if made is None:
            if self._worlds is None:
                self._worlds = dict(self._connection.execute("SELECT version, head FROM snapshots").fetchall())
            made = self._worlds.get(row.version)
            if made is None and row.version < min(self._worlds, default=0):  # forgotten since
                return
        if made != row.knowledge:
            raise damaged(self._path, f"version {row.version} of the knowledge is not the one after {name}")


def require_tables_of_runs(connection: sqlite3.Connection, path: Path) -> bool:
    """Whether the store has room for runs; raises `StoreError` if that is damaged or of another format."""
    ends = Ends(connection, path)
    require_own_log(path, ends.identity)
    if CHAIN in ends.chains:
        require_tables(connection, path, TABLES)
        _require_format(connection, path)
        return True
    _require_format(connection, path)
    if connection.execute("SELECT 1 FROM sqlite_master WHERE name IN ('runs', 'steps')").fetchone() is not None:
        raise damaged(path, "the table 'ends' does not know of its runs")
    return False


def _require_format(connection: sqlite3.Connection, path: Path) -> None:
    """Raise `StoreError` if the file has tables of runs in another format than `FORMAT`."""
    if connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'runs'").fetchone() is None:
        return
    columns = {name for _, name, *_ in connection.execute("PRAGMA table_info(fence)")}
    row = connection.execute("SELECT format FROM fence").fetchone() if "format" in columns else (1,)
    if row is None:
        raise damaged(path, "the table 'fence' is empty")
    if row[0] != FORMAT:
        said = f"the runs in this store have format {row[0]}, this program reads and resumes format {FORMAT}"
        raise StoreError(said, place=Place(str(path)))
