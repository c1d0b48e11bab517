"""The SQLite file of a store: how it is opened, and what its errors mean to people."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from knowledge_base.errors import Place, StoreError
from knowledge_base.pddl.files import files_beside

Durability = Literal["memory", "process", "power"]
"""What a commit outlives: nothing; the death of the process; a power cut (as far as the disk is honest)."""

APPLICATION_ID = 0x6473636B  # "dsck", by which a file is known as ours (SQLite's application_id)
FORMAT = 2
PATIENCE_S = 1.0
"""How long to wait for others who lock the file; there should be none."""

_PAGES_IN_LOG = {"process": 0, "power": 1000}
"""Pages of 4 KiB in SQLite's log after which it makes the commit put them in their place; 0: others see to that."""
_LOG_LENGTH = (_PAGES_IN_LOG["power"] + 24) * (4096 + 24)  # a frame is a page and its head; commits are not cut
_SYNCHRONOUS = {"process": "NORMAL", "power": "FULL"}  # in WAL mode only FULL waits for the disk in each commit


@contextmanager
def reported(path: Path, doing: str) -> Iterator[None]:
    """Turns SQLite's errors into a `StoreError` that says what could not be done to which file."""
    try:
        yield
    except sqlite3.Error as error:
        raise StoreError(f"cannot {doing} the store: {error}", place=Place(str(path))) from error


@contextmanager
def reading(path: Path) -> Iterator[sqlite3.Connection]:
    """A connection that sees one version of the file, whatever is written meanwhile.

    Raises:
        StoreError: the file is not there, not a store, or cannot be read.
    """
    require_place(path)
    if not is_there(path):
        beside = files_beside(path)
        raise StoreError(f"there is no store '{path.name}'", place=Place(str(path)), found=path.name, valid=beside)
    with reported(path, "read"):
        connection = connect(path, "ro")
        try:
            connection.execute("BEGIN")
            require_store(connection, path)
            yield connection
        finally:
            connection.close()


def is_there(path: Path) -> bool:
    """Whether there is a file that has any content."""
    return path.exists() and path.stat().st_size > 0


def require_place(path: Path) -> None:
    """Raise `StoreError` where no file can be: the path is a folder, or in none."""
    if path.is_dir():
        raise StoreError(f"'{path.name}' is a folder; a store is a file", place=Place(str(path)))
    if not path.parent.is_dir():
        raise StoreError(f"there is no folder '{path.parent}' for a store to be in", place=Place(str(path)))


def writing(path: Path, durability: Durability) -> sqlite3.Connection:
    """A connection to write with.

    Raises:
        StoreError: it cannot be opened, or is something else than a store.
    """
    with reported(path, "open"):
        connection = connect(path, "rw")
        try:
            require_store(connection, path)
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute(f"PRAGMA synchronous = {_SYNCHRONOUS[durability]}")
            connection.execute(f"PRAGMA wal_autocheckpoint = {_PAGES_IN_LOG[durability]}")
        except BaseException:
            connection.close()
            raise
    return connection


def to_tidy_up(path: Path) -> sqlite3.Connection:
    """A connection besides that of the one who writes; raises `sqlite3.Error` if it cannot be had."""
    connection = connect(path, "rw")
    connection.execute("PRAGMA synchronous = NORMAL")  # or the log would be gone before the file is on the disk
    return connection


def lay_out_log(path: Path) -> None:
    """Let SQLite's log have the length it comes to have, where it is shorter; the writer's connection is open.

    Waiting for the disk takes longer, and depends on what others write, as long as a file grows: its length has to be
    kept then, too. What follows the last commit is no commit to SQLite, whatever it is; zeros are none anywhere.

    Raises:
        StoreError: there is no room for it.
    """
    try:
        with path.with_name(path.name + "-wal").open("r+b") as log:
            length = log.seek(0, os.SEEK_END)
            log.write(bytes(max(0, _LOG_LENGTH - length)))
            log.flush()
            os.fsync(log.fileno())
    except OSError as error:
        raise StoreError(f"cannot lay out the store's log: {error.strerror}", place=Place(str(path))) from error


def require_store(connection: sqlite3.Connection, path: Path) -> None:
    """Raise `StoreError` unless the file is a store of a format known here."""
    if _number(connection, "PRAGMA application_id") != APPLICATION_ID:
        raise StoreError("this is a database, but no knowledge store", place=Place(str(path)))
    form = _number(connection, "PRAGMA user_version")
    if form != FORMAT:
        raise StoreError(f"the store has format {form}, this program reads format {FORMAT}", place=Place(str(path)))


def _number(connection: sqlite3.Connection, statement: str) -> int:
    return int(connection.execute(statement).fetchone()[0])


def connect(path: Path, mode: str) -> sqlite3.Connection:
    """A connection without transactions of its own; `mode` as SQLite has it in the names of files."""
    uri = f"{path.absolute().as_uri()}?mode={mode}"
    return sqlite3.connect(uri, uri=True, isolation_level=None, check_same_thread=False, timeout=PATIENCE_S)
