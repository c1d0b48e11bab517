"""`RunArchive` reads the runs of a store as values, also while a writer appends."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dsc.engine.steps import Start
from dsc.runs.snapshot import RunSnapshot, SnapshotRow, latest_snapshot
from dsc.runs.tables import RunChain, RunSpan, StoredStep, require_tables_of_runs
from dsc.trace import Record
from knowledge_base.errors import Place, StoreError
from knowledge_base.journal.file import is_there, located, reading
from knowledge_base.journal.integrity import Ends, damaged, require_sound


@dataclass(frozen=True, slots=True)
class RunRow:
    """A run in a store.

    Attributes:
        number: the first is 1.
        plot, arguments: the plot that the run executes, and its arguments.
        version: that of the knowledge at the beginning.
        header: plain data of the run's program.
        plots: the hashes of all plots of its library by name.
        domain: other things that plots rely on, as text by name.
        ended: its end (`finished`, `problem`); `None` while it has none.
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
        message: the message that it took, as `encoding.message_form`; the first macrostep is the start.
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
    """The runs of a store, for readers; use it inside `archive`.

    Methods raise `DamagedStoreError`, which names the row, if its digest does not fit.
    """

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self.path = path
        self.connection = connection
        self._chain = RunChain(connection, path)
        self._forms: dict[str, Any] = {}
        self._runs: list[RunRow] | None = None

    def runs(self) -> list[RunRow]:
        """All runs, in order."""
        if self._runs is None:
            self._runs = [_run(span) for span in self._chain.spans()]
        return list(self._runs)

    def run(self, number: int | None = None) -> RunRow:
        """The run of that number, or the last one; raises `StoreError` if it is missing."""
        found = self.runs()
        for one in reversed(found):
            if number in (None, one.number):
                return one
        there = f"there are {len(found)}" if found else "there is none"
        raise StoreError(f"there is no run {number or 1}; {there}", place=Place(str(self.path)))

    def steps(self, run: int) -> Iterator[StepRow]:
        """The macrosteps of a run, in order."""
        return map(_step, self._chain.steps(self.run(run).number))

    def last(self, run: int) -> StepRow:
        """The last macrostep of a run."""
        return _step(next(self._chain.latest_steps(self.run(run).number)))

    def records(self, run: int, after: int = 0) -> Iterator[Record]:
        """The kept trace records of a run, in order; only those with a higher number than `after`."""
        for _, line in self.lines(run):
            if (record := Record.from_line(line)).seq > after:
                yield record

    def lines(self, run: int, since: int = 0) -> Iterator[tuple[int, str]]:
        """The lines of a run's trace from the macrostep at place `since` of the file on, each with its place there."""
        rows = self._chain.steps(self.run(run).number, since)
        return ((row.place, line) for row in rows for line in row.records.split("\n") if line)

    def latest_snapshot(self) -> RunSnapshot:
        """The snapshot after the last macrostep of all runs."""
        return latest_snapshot(row.change for row in self._chain.latest_steps(self.run().number))

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
            DamagedStoreError: a row differs from the written one.
        """
        for run in self.runs():
            for _ in self._chain.steps(run.number):
                pass
        for (digest,) in self.connection.execute("SELECT hash FROM forms").fetchall():
            self.form(digest)
        return self.runs()


@contextmanager
def archive(path: Path, *, again: bool = False) -> Iterator[RunArchive]:
    """Read a store's runs as they are now; later writes are not seen.

    Args:
        path: the store.
        again: whether its pages were read before; else all pages of a store that is not closed are checked.

    Raises:
        StoreError: the file is missing, not a store, damaged, or cannot be read.
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
    """Header and records of a kept run so far, as its trace file would have them; also during the run.

    Args:
        path: the store, which is only read.
        run: its number; the last one by default.
        after: number of the last record that is not wanted.

    Raises:
        StoreError: the file is missing, not a store, or has no such run.
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


def _run(span: RunSpan) -> RunRow:
    number, plot, arguments, version, header, plots, domain = span.begun
    ended = None if span.ended is None else json.loads(span.ended)
    return RunRow(
        number, plot, json.loads(arguments), version, json.loads(header), json.loads(plots), json.loads(domain), ended
    )


def _step(row: StoredStep) -> StepRow:
    return StepRow(
        row.number, row.time, row.before, row.version, row.serials, json.loads(row.message),
        tuple(json.loads(row.configuration)),
        tuple([Record.from_line(line) for line in row.records.split("\n") if line]),
    )  # fmt: skip
