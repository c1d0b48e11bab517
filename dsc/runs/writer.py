"""Transactions of a kept run, with a fence against a second writer, and listeners at their boundaries."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

from dsc.runs.tables import CHAIN, FORMAT, TABLES, require_tables_of_runs
from knowledge_base.errors import Place, StoreError
from knowledge_base.journal.integrity import NOTHING, Tip, link, put_ends
from knowledge_base.store import KnowledgeBase

_RIGHT = "SELECT 1 FROM fence WHERE epoch = ?"
_STEP = "INSERT INTO steps SELECT NULL, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ? FROM fence WHERE epoch = ?"
_LAST = """SELECT run, number, time, before, version, serials, message, configuration, change, records, knowledge,
    place FROM steps ORDER BY place DESC LIMIT 1"""
_BEFORE = """SELECT digest FROM steps WHERE place = ? AND run = ?
    UNION ALL SELECT digest FROM runs WHERE run = ? LIMIT 1"""
_MORE = """UPDATE steps SET change = change || ?, records = records || ?, digest = ?
    WHERE place = (SELECT max(place) FROM steps)"""
_SEAL = "SELECT run, seal FROM runs ORDER BY run DESC LIMIT 1"
_BEGIN = """INSERT INTO runs (run, plot, arguments, version, header, plots, domain, digest)
    VALUES (?, ?, ?, ?, ?, ?, ?, ?)"""
_END = "UPDATE runs SET ended = ?, steps = ?, seal = ? WHERE run = ?"
Boundary = Literal["before commit", "after commit"]
"""Points at which a crash makes a difference: nothing of the macrostep is kept, or none of its actions has left."""


class RunWriter:
    """A context manager for one transaction after the other; a new writer takes the right of all earlier ones away.

    Args:
        knowledge: the knowledge base of the run, opened at `path`.
        path: its file.

    Attributes:
        connection: to write with, inside; call `require_right` before other writes than a macrostep.
        before: version of the knowledge when the transaction began.
        begun: whether a transaction was committed.
        lost: whether a write failed: memory is ahead of the file.

    Raises:
        StoreError: on entering or leaving, the file cannot be written.
    """

    def __init__(self, knowledge: KnowledgeBase, path: Path) -> None:
        self.begun = self.lost = False
        self.before = 0
        self._digest = NOTHING
        self._last: tuple[bytes, tuple[Any, ...]] = NOTHING, ()
        self._knowledge = knowledge
        self._path = path
        self._listeners: list[Callable[[Boundary], None]] = []
        self._together = knowledge.together()
        with self._together as self.connection:
            self._cursor = self.connection.cursor()  # `Connection.execute` makes one each time
            if not require_tables_of_runs(self.connection, path):
                for statement in TABLES.values():
                    self.connection.execute(statement)
                put_ends(self.connection, [(CHAIN, Tip(0, NOTHING))])
            (epoch,) = self.connection.execute("SELECT max(epoch) FROM fence").fetchone()
            self.connection.execute("DELETE FROM fence")
            self._epoch = (epoch or 0) + 1
            self.connection.execute("INSERT INTO fence VALUES (?, ?)", (self._epoch, FORMAT))

    def listen(self, listener: Callable[[Boundary], None]) -> None:
        """Call `listener` before and after each commit from now on."""
        self._listeners.append(listener)

    def __enter__(self) -> None:
        try:
            self.connection = self._together.__enter__()
        except BaseException:
            self.lost = True
            raise
        self.before = self._knowledge.version

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        try:
            if error is None:
                for listener in self._listeners:
                    listener("before commit")
        except BaseException as stopped:
            self._close(stopped)
            raise
        self._close(error)
        if error is None:
            self.begun = True
            for listener in self._listeners:
                listener("after commit")

    def require_right(self) -> None:
        """Raise `StoreError` if another sequencer has taken the run over."""
        if self.connection.execute(_RIGHT, (self._epoch,)).fetchone() is None:
            raise self._taken_over()

    def begin(self, *row: Any) -> int:
        """Write the row of a run without its number, and return that; errors as for `require_right`."""
        self.require_right()
        last, seal = self.connection.execute(_SEAL).fetchone() or (0, NOTHING)
        self._digest = link(seal, last + 1, *row)
        self.connection.execute(_BEGIN, (last + 1, *row, self._digest))
        put_ends(self.connection, [(CHAIN, None)])
        return int(last) + 1

    def step(self, *row: Any) -> None:
        """Write the row of a macrostep without its place; errors as for `require_right`, which it includes."""
        knowledge = self._knowledge.digest
        before = (self._digest or self._continued()) + knowledge
        digest = link(before, *row)
        if self._cursor.execute(_STEP, (*row, knowledge, digest, self._epoch)).rowcount != 1:
            raise self._taken_over()
        self._last = before, row
        self._digest = digest

    def more(self, change: str = "", records: str = "") -> None:
        """Add to the last macrostep; errors as for `require_right`."""
        self.require_right()
        self._digest = self._digest or self._continued()
        before, row = self._last
        row = *row[:-2], row[-2] + change, row[-1] + records
        self._digest = link(before, *row)
        self.connection.execute(_MORE, (change, records, self._digest))
        self._last = before, row

    def end(self, run: int, ended: str, records: str) -> None:
        """Write the end of a run, with the last records; errors as for `require_right`."""
        self.more(records=records)
        (steps,) = self.connection.execute("SELECT max(place) FROM steps").fetchone()
        seal = link(self._digest, steps, ended)
        self.connection.execute(_END, (ended, steps, seal, run))
        put_ends(self.connection, [(CHAIN, Tip(steps, seal))])

    def _continued(self) -> bytes:
        """The digest of the last macrostep, which an earlier process has written."""
        *row, knowledge, place = self.connection.execute(_LAST).fetchone()
        (before,) = self.connection.execute(_BEFORE, (place - 1, row[0], row[0])).fetchone()
        self._last = before + knowledge, tuple(row)
        return link(before + knowledge, *row)

    def _taken_over(self) -> StoreError:
        return StoreError("another sequencer has taken this run over", place=Place(str(self._path)))

    def _close(self, error: BaseException | None) -> None:
        self.lost = self.lost or error is not None
        try:
            self._together.__exit__(None if error is None else type(error), error, None)
        except BaseException:
            self.lost = True
            raise
