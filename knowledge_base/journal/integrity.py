"""Integrity of a store: chained digests prove that its rows are complete and unchanged.

Each row of a journal contains a digest of its content and of the row before it. An edited, missing, inserted or moved
row breaks the chain. The table `ends` records the tip of each chain when a store is closed. In an open store (after a
crash, or with a running writer), the loss of the last rows is therefore not detected.

The digests detect damage. The digests contain no secret, and therefore do not prove the author of the rows.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Mapping
from contextlib import closing, suppress
from functools import cache
from hashlib import blake2b
from pathlib import Path
from typing import Any, Final, NamedTuple

from knowledge_base.errors import DamagedStoreError, Place

SIZE: Final = 16
"""Length of a digest in bytes."""
NOTHING: Final = b""
"""The digest before the first row of a chain."""
ENDS = "CREATE TABLE ends (chain TEXT PRIMARY KEY, count INTEGER, digest BLOB) WITHOUT ROWID"
STORE: Final = "store"
"""The row of `ends` with the random identity of the store, which is the first digest of its chains."""
_OPEN = "open"
_PUT_END = "INSERT OR REPLACE INTO ends VALUES (?, ?, ?)"
_SHOWN = 3
"""Maximum number of problems from SQLite's own check in a message."""


class Tip(NamedTuple):
    """The end of a chain: its number of rows, and the digest of its last row."""

    rows: int
    digest: bytes


def link(before: bytes, *values: Any) -> bytes:
    """Return the digest of a row.

    Args:
        before: the digest of the previous row, and digests of other content that the row depends on.
        values: the columns of the row as SQLite returns them; a REAL is a float.
    """
    return blake2b(before + (_join_format(len(values)) % values).encode(), digest_size=SIZE).digest()


@cache
def _join_format(columns: int) -> str:
    """Return the format string of a row's text; formatting takes half the time of `join`."""
    return "\0".join(["%s"] * columns)


def damaged(path: Path, what: str) -> DamagedStoreError:
    """Return the error for a store whose content differs from the written content."""
    return DamagedStoreError(f"the store is damaged: {what}", place=Place(str(path)))


def require_link(path: Path, row: str, digest: object, before: tuple[Any, ...], *values: Any) -> bytes:
    """Return the digest of a row that was read.

    Args:
        path: the store.
        row: the name of the row in messages.
        digest: the digest in the row.
        before: the parts of `before` for `link`.
        values: the row's columns.

    Raises:
        DamagedStoreError: the digest does not match the content of the row and the row before it.
    """
    try:
        expected = link(b"".join(before), *values)
    except (TypeError, UnicodeError):  # a part that is not a digest
        expected = None
    if expected is None or digest != expected:
        raise damaged(path, f"{row} is not what was written, or does not belong here")
    return expected


def require_tables(connection: sqlite3.Connection, path: Path, tables: Mapping[str, str]) -> None:
    """Raise `DamagedStoreError` unless each table exists and was created with exactly the given statement."""
    there = dict(connection.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'").fetchall())
    for name, statement in tables.items():
        if name not in there:
            raise damaged(path, f"the table '{name}' is missing")
        if there[name] != statement:
            raise damaged(path, f"the table '{name}' is declared as '{there[name]}'")


def require_sound(connection: sqlite3.Connection, path: Path, table: str | None = None) -> None:
    """Raise `DamagedStoreError` if SQLite's own check finds a problem in the pages of the file, or of a table."""
    problems = [str(problem) for (problem,) in connection.execute(f"PRAGMA integrity_check({table or _SHOWN})")]
    if problems != ["ok"]:
        raise damaged(path, "; ".join(" ".join(problem.split()) for problem in problems[:_SHOWN]))


def require_own_log(path: Path, identity: bytes) -> None:
    """Raise `DamagedStoreError` if SQLite's log at the path belongs to a store with another identity."""
    log = path.with_name(path.name + "-wal")
    if not log.exists() or not log.stat().st_size:
        return
    with suppress(sqlite3.Error):  # a crash may leave the file incomplete; the log then completes it
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as alone:
            (own,) = alone.execute("SELECT digest FROM ends WHERE chain = ?", (STORE,)).fetchone() or (identity,)
        if own != identity:
            raise damaged(path, f"'{log.name}' is the log of another store")


class Ends:
    """The recorded ends of the chains of a file.

    Attributes:
        closed: whether the last writer has closed the store, so that the recorded ends are valid.
        tips: the recorded tips by chain.
    """

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        rows = {str(chain): (count, digest) for chain, count, digest in connection.execute("SELECT * FROM ends")}
        self._path = path
        self.closed = _OPEN not in rows
        self.chains = frozenset(rows) - {_OPEN}
        self.tips = {chain: Tip(*row) for chain, row in rows.items() if chain != _OPEN and row[1] is not None}
        if STORE not in self.tips:
            raise damaged(path, "the table 'ends' does not say which store this is")

    @property
    def identity(self) -> bytes:
        """The random identity of the store."""
        return self.tips[STORE].digest

    def require(self, chain: str, found: Tip) -> None:
        """Raise `DamagedStoreError` if the tip of the chain differs from the recorded tip."""
        said = self.tips.get(chain)
        if said is None:
            raise damaged(self._path, f"the table 'ends' does not say where '{chain}' ends")
        if said != found:
            where = f"row {said.rows} was the last, now it is row {found.rows}"
            if said.rows == found.rows:
                where = f"row {found.rows} is not the one that was written last"
            raise damaged(self._path, f"the table '{chain}' does not end where it ended: {where}")


def put_ends(connection: sqlite3.Connection, tips: Iterable[tuple[str, Tip | None]]) -> None:
    """Record the tips of chains; `None` is an unknown tip, while a writer has the store open."""
    connection.executemany(_PUT_END, [(chain, *(tip or (None, None))) for chain, tip in tips])


def mark_open(connection: sqlite3.Connection, token: bytes) -> None:
    """Record that a writer has the store open; from its commit on, the recorded ends are invalid."""
    connection.execute(_PUT_END, (_OPEN, None, token))


def mark_closed(connection: sqlite3.Connection, token: bytes) -> bool:
    """Record that the ends are valid again.

    Return `False` and do nothing if another writer has the store open.
    """
    return connection.execute("DELETE FROM ends WHERE chain = ? AND digest = ?", (_OPEN, token)).rowcount == 1
