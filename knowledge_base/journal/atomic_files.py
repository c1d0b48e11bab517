"""Atomic files: a new file appears complete or not at all, and never replaces another."""

from __future__ import annotations

import fcntl
import os
import secrets
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

from knowledge_base.errors import Place, StoreError
from knowledge_base.journal.file import APPLICATION_ID, FORMAT, Durability, reported
from knowledge_base.journal.integrity import ENDS
from knowledge_base.journal.sidecar_files import store_owning

MODE = 0o644
_PAGE_SIZE = 4096
_WAL = b"\2\2"
"""Bytes 18 and 19 of SQLite's header for a database in WAL mode, for writing and reading."""


@contextmanager
def new_database(path: Path, application_id: int, form: int, *, lasting: bool) -> Iterator[sqlite3.Connection]:
    """Yield a connection to a database in memory, in a transaction; the end of the block makes it a file at `path`.

    Args:
        path: the path of the new file.
        application_id: identifies the kind of file in SQLite's header.
        form: the number of its format, SQLite's `user_version`.
        lasting: whether its name survives a power cut, as its content does.

    Raises:
        OSError: a file exists at `path`, or none can be made; nothing has changed.
        sqlite3.Error: likewise.
    """
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as connection:
        connection.execute(f"PRAGMA page_size = {_PAGE_SIZE}")
        connection.execute("PRAGMA auto_vacuum = INCREMENTAL")
        connection.execute("BEGIN")
        connection.execute(f"PRAGMA application_id = {application_id}")
        connection.execute(f"PRAGMA user_version = {form}")
        yield connection
        connection.execute("COMMIT")
        content = bytearray(connection.serialize())
    content[18:20] = _WAL  # so that SQLite never keeps a rollback journal
    os.close(place(path, bytes(content), lasting=lasting, synced=True))


def place(path: Path, content: bytes, *, locked: bool = False, synced: bool = False, lasting: bool = False) -> int:
    """Make a file; return its descriptor, open to read and write.

    The file has no name until it is complete. On a file system without nameless files it has a random name until then,
    which remains if the process is killed.

    Args:
        path: the path of the new file.
        content: its whole content.
        locked: whether this process holds a lock on it (`flock`) from the beginning.
        synced: whether its content survives a power cut.
        lasting: whether its name survives a power cut.

    Raises:
        FileExistsError: `path` exists.
        OSError: the file cannot be made.
    """
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        file, name = _nameless(path.parent, folder)
        try:
            with os.fdopen(file, "wb", closefd=False) as whole:  # a full disk may take a part without an error
                whole.write(content)
            if synced:
                os.fsync(file)
            if locked:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.link(name, path, src_dir_fd=folder, follow_symlinks=True)  # fails if the path exists
            if lasting:
                os.fsync(folder)
        except BaseException:
            os.close(file)
            raise
        finally:
            if name.parent == path.parent:
                name.unlink()
    finally:
        os.close(folder)
    return file


def _nameless(parent: Path, folder: int) -> tuple[int, Path]:
    """Return the descriptor of a new file, and the name by which it can be linked."""
    with suppress(OSError, AttributeError):  # some systems and file systems lack nameless files
        Path("/proc/self/fd").lstat()
        file = os.open(".", os.O_TMPFILE | os.O_RDWR | os.O_CLOEXEC, MODE, dir_fd=folder)
        return file, Path(f"/proc/self/fd/{file}")
    name = parent / f".dsc-{secrets.token_hex(8)}"
    return os.open(name, os.O_CREAT | os.O_EXCL | os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC, MODE), name


TABLES = {
    "schemas": """CREATE TABLE schemas (version INTEGER NOT NULL, hash TEXT NOT NULL, declarations TEXT NOT NULL,
        digest BLOB NOT NULL)""",
    "changes": """CREATE TABLE changes (version INTEGER PRIMARY KEY, time REAL NOT NULL, author TEXT NOT NULL,
        delta TEXT NOT NULL, digest BLOB NOT NULL)""",
    "snapshots": """CREATE TABLE snapshots (version INTEGER PRIMARY KEY, time REAL NOT NULL, world TEXT NOT NULL,
        head BLOB NOT NULL, digest BLOB NOT NULL)""",
    "keys": """CREATE TABLE keys (number INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE, version INTEGER NOT NULL,
        time REAL NOT NULL, author TEXT NOT NULL, delta TEXT, context BLOB NOT NULL, digest BLOB NOT NULL)""",
    "ends": ENDS,
}


@contextmanager
def making(path: Path, durability: Durability) -> Iterator[sqlite3.Connection]:
    """Yield a connection to a new store with empty tables, in memory until the end of the block.

    The caller holds the writer lock of the path, which must be free.

    Raises:
        StoreError: the store cannot be made; the path stays free.
    """
    owner = store_owning(path)
    if owner not in (None, path):
        said = f"'{path.name}' is the name of a sidecar file of the store '{owner}'"
        raise StoreError(said, place=Place(str(path)))
    try:
        with (
            reported(path, "make"),
            new_database(path, APPLICATION_ID, FORMAT, lasting=durability == "power") as connection,
        ):
            for statement in TABLES.values():
                connection.execute(statement)
            yield connection
    except FileExistsError:
        said = f"'{path.name}' is there already; a new store replaces no file"
        raise StoreError(said, place=Place(str(path))) from None
    except OSError as error:
        raise StoreError(f"cannot make the store '{path}': {error.strerror}") from error
