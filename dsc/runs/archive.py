"""Read access to the runs of a store, as values, also while a writer appends (`RunArchive`)."""

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
from dsc.runs.tables import CHAIN, RunSnapshot, SnapshotRow, latest_snapshot, require_tables_of_runs
from dsc.trace import Record
from knowledge_base.errors import Place, StoreError
from knowledge_base.facts import Value
from knowledge_base.journal.file import is_there, located, reading
from knowledge_base.journal.integrity import NOTHING, Ends, Tip, damaged, put_ends, require_link, require_sound

_RUNS = """SELECT run, plot, arguments, version, header, plots, domain, digest, ended, steps, seal FROM runs
    WHERE run > ? ORDER BY run"""
_LAST_BUT_ONE = "SELECT run, steps, seal FROM runs ORDER BY run DESC LIMIT 1 OFFSET 1"
_STEPS = """SELECT place, run, number, steps.time, before, version, serials, message, configuration, change, records,
    knowledge, steps.digest, changes.digest FROM steps LEFT JOIN changes USING (version)"""
RELATIONS = "relations"
"""Key of a message's form for `StepRow.relations`."""
_DIGEST = "SELECT digest FROM steps WHERE place = ?"


@dataclass(frozen=True, slots=True)
class RunRow:
    """A run in a store.

    Attributes:
        number: the run's number; the first run is 1.
        plot: name of the plot that the run executes.
        arguments: arguments of that plot.
        version: version of the knowledge at the beginning of the run.
        header: plain data of the run's program.
        plots: hashes of all plots of the run's library, by name.
        domain: other definitions that plots depend on, as text by name.
        ended: the end of the run (`finished`, `problem`); `None` before the end.
        first: place in the table `steps` before the run's first macrostep.
        last: place of the run's last macrostep.
        digest: digest of the run's row.
    """

    number: int
    plot: str
    arguments: Mapping[str, Any]
    version: int
    header: Mapping[str, Any]
    plots: Mapping[str, str]
    domain: Mapping[str, str]
    ended: Mapping[str, Any] | None
    first: int
    last: int
    digest: bytes


@dataclass(frozen=True, slots=True)
class StepRow:
    """A macrostep of a run.

    Attributes:
        number: the macrostep's number in the run; the first is 1.
        time: seconds of run time.
        before: version of the knowledge before the macrostep.
        version: version of the knowledge after the macrostep.
        serials: the last serial number that the run has used.
        message: the handled message, as from `encoding.message_form`; empty for the start and the end of the run.
        relations: rows of relations that the macrostep has read, and that have changed since the last such row. A
            replay needs those that other parts than the chart provide, e.g. components.
        configuration: paths of the active states after the macrostep.
        records: trace records since the previous macrostep.
    """

    number: int
    time: float
    before: int
    version: int
    serials: int
    message: Mapping[str, Any]
    relations: Mapping[str, list[list[Value]]]
    configuration: tuple[str, ...]
    records: tuple[Record, ...]


class Pruned(NamedTuple):
    """The end of the runs that were deleted, or that a reader skips; the first run of the store follows it.

    Attributes:
        run: the number of the last such run.
        place: the place of its last macrostep.
        serials: the last serial number that it has used.
        seal: the digest of its end.
    """

    run: int = 0
    place: int = 0
    serials: int = 0
    seal: bytes = NOTHING

    @staticmethod
    def read(ends: Ends) -> Pruned:
        """Return what `write` has recorded in a store; by default that no run was deleted."""
        run, place, serials = (ends.tips.get(name) for name in _PRUNED)
        if run is None or place is None or serials is None:
            return Pruned()
        return Pruned(run.rows, place.rows, serials.rows, run.digest)

    def write(self, connection: sqlite3.Connection) -> None:
        """Record it in the store, in the table of the ends of chains."""
        put_ends(connection, [(name, Tip(count, self.seal)) for name, count in zip(_PRUNED, self[:3], strict=True)])


_PRUNED = "pruned run", "pruned step", "pruned serial"


class _StoredStep(NamedTuple):
    """The stored row of a macrostep; `made` is the stored digest of the knowledge version that it made."""

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


class RunArchive:
    """The runs of a store, for readers; use the archive inside a block of `archive`.

    The archive checks each row of runs and macrosteps by its digest. For a row that differs, methods raise
    `DamagedStoreError` with the row's name.

    Args:
        connection: reads the store.
        path: the store.
        latest: whether only the last run is read; else each run's row is, which takes longer in a store of many runs.
    """

    def __init__(self, connection: sqlite3.Connection, path: Path, *, latest: bool = False) -> None:
        self.path = path
        self._latest = latest
        self.connection = connection
        self._forms: dict[str, Any] = {}
        self._runs: list[RunRow] | None = None
        self._worlds: dict[int, bytes] | None = None

    def runs(self) -> list[RunRow]:
        """Return all runs in order, or the last one; the table is read only at the first call."""
        if self._runs is None:
            self._runs = self._read_runs()
        return list(self._runs)

    def run(self, number: int | None = None) -> RunRow:
        """Return the run of that number, or the last run; raise `StoreError` if it is missing."""
        found = self.runs()
        for one in reversed(found):
            if number in (None, one.number):
                return one
        there = f"the runs are {found[0].number} to {found[-1].number}" if len(found) > 1 else "there is none"
        if len(found) == 1:
            there = f"the only run is {found[0].number}"
        raise StoreError(f"there is no run {number or 1}; {there}", place=Place(str(self.path)))

    def steps(self, run: int) -> Iterator[StepRow]:
        """Iterate over the macrosteps of a run, in order."""
        return map(_step, self._steps(run))

    def last(self, run: int) -> StepRow:
        """Return the last macrostep of a run."""
        return _step(next(self._latest_steps(run)))

    def records(self, run: int, after: int = 0) -> Iterator[Record]:
        """Iterate over the kept trace records of a run, in order, from the record after number `after`."""
        for _, line in self.lines(run):
            if (record := Record.from_line(line)).seq > after:
                yield record

    def lines(self, run: int, since: int = 0) -> Iterator[tuple[int, str]]:
        """Iterate over the lines of a run's trace, each with the place of its macrostep in the table `steps`.

        Lines of macrosteps before place `since` are skipped.
        """
        return ((row.place, line) for row in self._steps(run, since) for line in row.records.split("\n") if line)

    def latest_snapshot(self) -> RunSnapshot:
        """Return the snapshot after the last macrostep of the last run."""
        return latest_snapshot(step.change for step in self._latest_steps(self.run().number))

    def running_actions(self) -> list[tuple[Start, float]]:
        """Return the skills of the unfinished run that have not ended, each with its start in seconds of run time."""
        rows = [SnapshotRow(*row) for _, row in sorted(self.latest_snapshot().pending.items())]
        return [(Start.from_json(row.what), row.at) for row in rows if row.kind == Start.__name__ and not row.cancelled]

    def serials_before(self, run: int) -> int:
        """Return the last serial number that the earlier runs have used, so that all action ids in a store differ."""
        pruned = Pruned.read(Ends(self.connection, self.path))
        return pruned.serials if run == pruned.run + 1 else self.last(run - 1).serials

    def form(self, digest: str) -> Any:
        """Return the plot of that hash, as data; repeated calls return one object."""
        if digest not in self._forms:
            row = self.connection.execute("SELECT form FROM forms WHERE hash = ?", (digest,)).fetchone()
            if row is None or hashlib.sha256(str(row[0]).encode()).hexdigest() != digest:
                raise damaged(self.path, f"the plot with hash {digest} is missing, or not what was written")
            self._forms[digest] = json.loads(row[0])
        return self._forms[digest]

    def require_all(self) -> list[RunRow]:
        """Read and check every row; return all runs.

        Raises:
            DamagedStoreError: a row differs from the written one.
        """
        for run in self.runs():
            for _ in self._steps(run.number):
                pass
        for (digest,) in self.connection.execute("SELECT hash FROM forms").fetchall():
            self.form(digest)
        return self.runs()

    def _steps(self, number: int, since: int = 0) -> Iterator[_StoredStep]:
        """Yield the macrosteps of a run in order, from place `since` in the table `steps` on."""
        run = self._with_steps(number)
        place = max(run.first, since - 1)
        digest: object = run.digest
        if place > run.first:
            (digest,) = self.connection.execute(_DIGEST, (place,)).fetchone() or (None,)
        rows = self.connection.execute(f"{_STEPS} WHERE place > ? AND place <= ? ORDER BY place", (place, run.last))
        for row in map(_StoredStep._make, rows):
            place += 1
            self._require_step(row, run, place, digest)
            digest = row.digest
            yield row
        if place != run.last:
            raise damaged(self.path, f"macrostep {place + 1 - run.first} of run {number} is missing")

    def _latest_steps(self, number: int) -> Iterator[_StoredStep]:
        """Yield the macrosteps of a run, the last one first."""
        run = self._with_steps(number)
        rows = self.connection.execute(
            f"{_STEPS} WHERE place > ? AND place <= ? ORDER BY place DESC", (run.first, run.last)
        )
        place, later = run.last, None
        for row in map(_StoredStep._make, rows):
            if later is not None:
                self._require_step(later, run, place, row.digest)
                yield later
                place -= 1
            later = row
        if later is not None:
            self._require_step(later, run, place, run.digest)
            yield later

    def _read_runs(self) -> list[RunRow]:
        runs: list[RunRow] = []
        (last,) = self.connection.execute("SELECT coalesce(max(place), 0) FROM steps").fetchone()
        ends = Ends(self.connection, self.path)
        before = self._earlier() or Pruned.read(ends)
        first, seal, unfinished = before.place, before.seal, False
        rows = self.connection.execute(_RUNS, (before.run,))
        for number, (*begun, own, ended, steps, found) in enumerate(rows, before.run + 1):
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
            _, plot, arguments, version, header, plots, domain = begun
            runs.append(RunRow(
                number, plot, json.loads(arguments), version, json.loads(header), json.loads(plots),
                json.loads(domain), json.loads(ended) if ended else None, first, last if unfinished else steps, digest,
            ))  # fmt: skip
            first = runs[-1].last
        if first != last:
            raise damaged(self.path, f"the run of macrosteps after place {first} of the table 'steps' is missing")
        if CHAIN in ends.tips:
            ends.require(CHAIN, Tip(last, seal))
        return runs

    def _earlier(self) -> Pruned | None:
        """Return the end of the runs before the last one, if only that one is read."""
        row = self.connection.execute(_LAST_BUT_ONE).fetchone() if self._latest else None
        return None if row is None or None in row else Pruned(row[0], row[1], 0, row[2])

    def _with_steps(self, number: int) -> RunRow:
        run = self.run(number)
        if run.first >= run.last:
            raise damaged(self.path, f"the macrosteps of run {number} are missing")
        return run

    def _require_step(self, row: _StoredStep, run: RunRow, place: int, before: object) -> None:
        name = f"macrostep {place - run.first} of run {run.number}"
        if (row.place, row.run) != (place, run.number) or row.number != place - run.first:
            raise damaged(self.path, f"{name} is missing, or not in its place")
        require_link(self.path, name, row.digest, (before, row.knowledge), *row[1:11])
        made = row.made
        if made is None:
            if self._worlds is None:
                self._worlds = dict(self.connection.execute("SELECT version, head FROM snapshots").fetchall())
            made = self._worlds.get(row.version)
            if made is None and row.version < min(self._worlds, default=0):  # the store has deleted the version
                return
        if made != row.knowledge:
            raise damaged(self.path, f"version {row.version} of the knowledge is not the one after {name}")


@contextmanager
def archive(path: Path, *, again: bool = False, latest: bool = False) -> Iterator[RunArchive]:
    """Open a store's runs in their present state; later writes are not visible.

    Args:
        path: the store.
        again: whether the store's pages were checked before. Otherwise, all pages of a store that was not closed are
            checked.
        latest: see `RunArchive`.

    Raises:
        StoreError: the file is missing, not a store, damaged, or cannot be read.
    """
    with reading(located(path)) as connection:
        if not require_tables_of_runs(connection, path):
            raise StoreError("no run was ever kept in this store", place=Place(str(path)))
        if not again and not Ends(connection, path).closed:
            require_sound(connection, path)
        yield RunArchive(connection, path, latest=latest)


def records_of(
    path: Path | str, run: int | None = None, after: int = 0
) -> tuple[Mapping[str, Any], tuple[Record, ...]]:
    """Return header and records of a kept run, as in a trace file; during the run, the records so far.

    Args:
        path: the store, which is only read.
        run: the run's number; by default the last run.
        after: number of the last record to skip.

    Raises:
        StoreError: the file is missing, not a store, or has no such run.
    """
    with archive(Path(path)) as runs:
        row = runs.run(run)
        return row.header, tuple(runs.records(row.number, after))


def has_run(path: Path) -> bool:
    """Return whether the file has a run; raise `StoreError` if the file exists and is damaged or not a store."""
    if not is_there(place := located(path)):
        return False
    with reading(place) as connection:
        return require_tables_of_runs(connection, path) and bool(RunArchive(connection, path, latest=True).runs())


def is_unfinished(path: Path) -> bool:
    """Return whether the file has an unfinished run; errors equal those of `has_run`."""
    if not has_run(path):
        return False
    with archive(path, latest=True) as runs:
        return runs.run().ended is None


def unfinished(runs: RunArchive) -> RunRow:
    """Return the unfinished run; raise `StoreError` if there is none."""
    for run in reversed(runs.runs()):
        if run.ended is None:
            return run
    raise StoreError("there is no unfinished run in this store", place=Place(str(runs.path)))


def _step(row: _StoredStep) -> StepRow:
    message = json.loads(row.message)
    relations = message.pop(RELATIONS, {})
    return StepRow(
        row.number, row.time, row.before, row.version, row.serials, message, relations,
        tuple(json.loads(row.configuration)),
        tuple([Record.from_line(line) for line in row.records.split("\n") if line]),
    )  # fmt: skip
