"""Tables of runs in the file of a knowledge store: their format, and the changes in their rows.

Table `runs` has a row for each run. Table `steps` has a row for each macrostep: its message, its change of the state,
its trace records. Table `forms` has plots by hash, and table `fence` has the writer's epoch. A commit writes whole
pages, so a macrostep is one row of one table, without an index.

Runs and macrosteps form one chain of digests (`journal.integrity`). A run's row follows the end of the previous run
(`seal`), and its macrosteps follow the row. Its end follows the last macrostep, whose place is in column `steps`. A
macrostep's `knowledge` is the digest of the version after it, so that runs and knowledge of two stores never match.

A macrostep writes its change of the state as a line of JSON. Periodically, it writes the whole state (`whole`), which
bounds the number of rows that a reader needs.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from knowledge_base.errors import Place, StoreError
from knowledge_base.journal.integrity import Ends, damaged, require_own_log, require_tables

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
FORMAT = 7
"""Format number of these tables; the first format had no number."""
CHAIN = "steps"
"""Name of the chain of runs and macrosteps in the store's table of ends."""
Form = dict[str, Any]


def require_tables_of_runs(connection: sqlite3.Connection, path: Path) -> bool:
    """Return whether the store has tables of runs; raise `StoreError` if they are damaged or have another format."""
    ends = Ends(connection, path)
    require_own_log(path, ends.identity)
    _require_format(connection, path)  # first, as the tables of another format may have other columns
    if CHAIN in ends.chains:
        require_tables(connection, path, TABLES)
        return True
    if connection.execute("SELECT 1 FROM sqlite_master WHERE name IN ('runs', 'steps')").fetchone() is not None:
        raise damaged(path, "the table 'ends' does not know of its runs")
    return False


def _require_format(connection: sqlite3.Connection, path: Path) -> None:
    """Raise `StoreError` if the file has tables of runs in another format than `FORMAT`."""
    if connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'runs'").fetchone() is None:
        return
    columns = {name for _, name, *_ in connection.execute("PRAGMA table_info(fence)")}
    if not columns:
        raise damaged(path, "the table 'fence' is missing")
    row = connection.execute("SELECT format FROM fence").fetchone() if "format" in columns else (1,)
    if row is None:
        raise damaged(path, "the table 'fence' is empty")
    if row[0] != FORMAT:
        said = f"the runs in this store have format {row[0]}, this program reads and resumes format {FORMAT}"
        remedy = "read or resume them with the version that wrote them, or delete all runs, but not the knowledge"
        raise StoreError(f"{said}; {remedy}: `dsc runs forget {path}`", place=Place(str(path)))


class SnapshotRow(NamedTuple):
    """A pending item as plain data, see `kept.Pending`."""

    kind: str
    step: int
    at: float
    what: Form
    reports: int = 0
    cause: int = 0
    cancelled: bool = False
    waits: bool = False
    turn: float | None = None


@dataclass(slots=True)
class RunSnapshot:
    """State of a run, as plain data.

    Attributes:
        reactor: state of the reactor besides the machine's frames.
        frames: running plots by serial number, as `encoding.frame_news` returns them.
        pending: pending items by place, as `SnapshotRow`.
        memory: memories of components, as text by component name.
    """

    reactor: Form = field(default_factory=dict)
    frames: dict[int, Form] = field(default_factory=dict)
    pending: dict[int, list[Any]] = field(default_factory=dict)
    memory: dict[str, str] = field(default_factory=dict)

    def apply(self, change: Form) -> None:
        """Apply a change: new values, and `None` for removed ones."""
        if "reactor" in change:
            self.reactor = change["reactor"]
        for serial, news in change.get("frames", {}).items():
            if news is None:
                del self.frames[int(serial)]
            else:
                self.frames[int(serial)] = self.frames.get(int(serial), {}) | news
        self.memory.update(change.get("memory", {}))
        for place, row in change.get("pending", {}).items():
            if row is None:
                self.pending.pop(int(place), None)  # the item may have begun and ended in one macrostep
            else:
                self.pending[int(place)] = row


def latest_snapshot(latest_first: Iterable[str]) -> RunSnapshot:
    """Return the snapshot after the first of these macrosteps, each given as its lines of changes.

    Only the macrosteps back to the last whole state are read.
    """
    needed: list[Form] = []
    for text in latest_first:
        changes = [json.loads(line) for line in text.split("\n") if line]
        needed += reversed(changes)
        if changes and changes[0].get("whole"):
            break
    found = RunSnapshot()
    for change in reversed(needed):
        found.apply(change)
    return found
