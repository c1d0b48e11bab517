"""Deletion of runs: the oldest ones, so that the later ones stay verifiable and resumable, or all runs of a store."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from sqlite3 import Connection

from dsc.runs.archive import Pruned, RunRow, archive
from dsc.runs.tables import CHAIN, FORMAT, TABLES
from knowledge_base.errors import InputError, Place, StoreError
from knowledge_base.journal.integrity import NOTHING, Ends, Tip, put_ends
from knowledge_base.store import KnowledgeBase
from knowledge_base.user_objects import shown

_SEAL = "SELECT seal FROM runs WHERE run = ?"
_NAMES_PLOTS = (
    "SELECT plots || arguments || header FROM runs",
    "SELECT message || change FROM steps",
)
_HASH = re.compile(r"\b[0-9a-f]{64}\b")


def prune(knowledge: KnowledgeBase, path: Path, keep: int) -> int:
    """Delete all but the latest `keep` runs of a store, and return the number of deleted runs.

    Their macrosteps, their plots, and the versions of the knowledge before the first kept run are deleted, too. Action
    ids stay unique. The file becomes smaller.

    Args:
        knowledge: the knowledge base, opened at `path` for writing.
        path: the file of the knowledge base.
        keep: the number of runs to keep, at least 1; an unfinished run counts.

    Raises:
        InputError: `keep` is not a positive integer.
        StoreError: the store has no runs, or cannot be read or written.
    """
    if isinstance(keep, bool) or not isinstance(keep, int) or keep < 1:
        raise InputError(f"`keep` is the number of runs to keep, at least 1, not {shown(keep)}")
    with archive(path, again=True) as runs:
        rows = runs.runs()
        gone, kept = rows[:-keep], rows[-keep:]
        serials = runs.last(gone[-1].number).serials if gone else 0
    if gone:
        with knowledge.together() as connection:
            _delete(connection, gone[-1], serials)
    if kept:
        knowledge.compact(kept[0].version)
    return len(gone)


def forget_runs(path: Path) -> int:
    """Delete all runs of a store, also in the format of another version; return their number. The knowledge stays.

    An unfinished run cannot be resumed then. Action ids stay unique.

    Raises:
        StoreError: the store has no runs, or cannot be read or written.
    """
    with KnowledgeBase.open(None, path) as knowledge, knowledge.together() as connection:
        columns = {
            name: {column for _, column, *_ in connection.execute(f"PRAGMA table_info({name})")} for name in TABLES
        }
        if not columns["runs"]:
            raise StoreError("this store has no runs", place=Place(str(path)))
        (number,) = connection.execute("SELECT count(*) FROM runs").fetchone()
        serials = [Pruned.read(Ends(connection, path)).serials, *_greatest(connection, "steps", "serials", columns)]
        epochs = [1, *_greatest(connection, "fence", "epoch", columns)]
        for name, statement in TABLES.items():
            connection.execute(f"DROP TABLE IF EXISTS {name}")
            connection.execute(statement)
        connection.execute("INSERT INTO fence VALUES (?, ?)", (max(epochs), FORMAT))
        put_ends(connection, [(CHAIN, Tip(0, NOTHING))])
        Pruned(serials=max(serials)).write(connection)
    return int(number)


def _greatest(connection: Connection, table: str, column: str, columns: Mapping[str, Collection[str]]) -> list[int]:
    """Return the greatest value of a column in a list; an empty list without values or without the column."""
    if column not in columns[table]:
        return []
    (greatest,) = connection.execute(f"SELECT max({column}) FROM {table}").fetchone()  # noqa: S608  # own names
    return [] if greatest is None else [int(greatest)]


def _delete(connection: Connection, last: RunRow, serials: int) -> None:
    (seal,) = connection.execute(_SEAL, (last.number,)).fetchone()
    Pruned(last.number, last.last, serials, seal).write(connection)
    connection.execute("DELETE FROM steps WHERE place <= ?", (last.last,))
    connection.execute("DELETE FROM runs WHERE run <= ?", (last.number,))
    needed = {one for query in _NAMES_PLOTS for (text,) in connection.execute(query) for one in _HASH.findall(text)}
    unused = _hashes(connection) - needed
    connection.executemany("DELETE FROM forms WHERE hash = ?", [(one,) for one in unused])


def _hashes(connection: Connection) -> set[str]:
    rows: Iterable[tuple[str]] = connection.execute("SELECT hash FROM forms")
    return {one for (one,) in rows}
