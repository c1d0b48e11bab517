"""What a store's file consists of, and how it comes into being: as a whole or not at all, whenever its maker dies.

`changes` is the journal, one row a version. `snapshots` are whole worlds, the oldest of which is where the
journal begins. `keys` leads from idempotency keys to changes; its own `delta` is null while the change is in
the journal. `schemas` are the declarations used, each since a version. JSON as in `exchange.forms`.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from knowledge_base.errors import StoreError
from knowledge_base.journal.file import APPLICATION_ID, FORMAT, Durability, connect, reported

_TABLES = (
    "CREATE TABLE schemas (version INTEGER NOT NULL, hash TEXT NOT NULL, declarations TEXT NOT NULL)",
    "CREATE TABLE changes (version INTEGER PRIMARY KEY, time REAL NOT NULL, author TEXT NOT NULL, delta TEXT NOT NULL)",
    "CREATE TABLE snapshots (version INTEGER PRIMARY KEY, time REAL NOT NULL, world TEXT NOT NULL)",
    """CREATE TABLE keys (key TEXT PRIMARY KEY, version INTEGER NOT NULL, time REAL NOT NULL, author TEXT NOT NULL,
        delta TEXT) WITHOUT ROWID""",
    f"PRAGMA application_id = {APPLICATION_ID}",
    f"PRAGMA user_version = {FORMAT}",
)
_LOGS = ("-wal", "-shm", "-journal")
"""What SQLite keeps beside a file; of one that is gone it would be taken for the next one's."""


@contextmanager
def making(path: Path, durability: Durability) -> Iterator[sqlite3.Connection]:
    """A connection to a new store with empty tables, which has its name when the block is left.

    Until then it is beside that place, where the next one who makes it takes it away. To be used by who has the right
    to write, where nothing is, or a file without content.

    Raises:
        StoreError: it cannot be made; nothing is there then.
    """
    beside = path.with_name(f"{path.name}-new")
    with reported(path, "make"):
        _take_away(beside)
        connection = connect(beside, "rwc")
        try:
            connection.execute("PRAGMA auto_vacuum = INCREMENTAL")
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("BEGIN")
            for statement in _TABLES:
                connection.execute(statement)
            yield connection
            connection.execute("COMMIT")
            connection.close()  # which puts the log into the file
            _take_away(path)
            _give_name(beside, path, lasting=durability == "power")
        except BaseException:
            connection.close()
            _take_away(beside)
            raise


def _take_away(path: Path) -> None:
    for end in ("", *_LOGS):
        path.with_name(path.name + end).unlink(missing_ok=True)


def _give_name(beside: Path, path: Path, *, lasting: bool) -> None:
    try:
        beside.rename(path)
        if lasting:  # a name is kept by the folder
            folder = os.open(path.parent, os.O_RDONLY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)
    except OSError as error:
        raise StoreError(f"cannot make the store '{path}': {error.strerror}") from error
