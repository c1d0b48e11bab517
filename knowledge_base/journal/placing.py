"""New files: there as a whole or not at all, and never in the place of another."""

from __future__ import annotations

import fcntl
import os
import secrets
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

MODE = 0o644
_PAGE_SIZE = 4096
_WAL = b"\2\2"
"""What SQLite's header has at byte 18 when there is a log beside the file, to be read and written."""


@contextmanager
def new_database(path: Path, application_id: int, form: int, *, lasting: bool) -> Iterator[sqlite3.Connection]:
    """A connection to a database in memory, in a transaction, which is a file at `path` when the block is left.

    Args:
        path: a place where nothing is.
        application_id: by which the file is known, in SQLite's header.
        form: the number of its format, SQLite's `user_version`.
        lasting: whether its name survives a power cut, as its content does.

    Raises:
        OSError: there is a file meanwhile, or none can be made; all is as before.
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
    content[18:20] = _WAL  # so that SQLite never keeps the older kind of log beside it
    os.close(place(path, bytes(content), lasting=lasting, synced=True))


def place(path: Path, content: bytes, *, locked: bool = False, synced: bool = False, lasting: bool = False) -> int:
    """Make a file; returns its descriptor, to read and write.

    It has no name until it is complete. A file system without nameless files shows it under a random name until then,
    and keeps that if the process is killed meanwhile.

    Args:
        path: a place where nothing is.
        content: all of it.
        locked: whether this process has the lock on it (`flock`), from the beginning.
        synced: whether its content survives a power cut.
        lasting: whether its name does.

    Raises:
        FileExistsError: something is there.
        OSError: it cannot be made.
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
            os.link(name, path, src_dir_fd=folder, follow_symlinks=True)  # fails where anything is
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
    """A new file and the name by which it can be linked."""
    with suppress(OSError, AttributeError):  # not every system and file system has them
        Path("/proc/self/fd").lstat()
        file = os.open(".", os.O_TMPFILE | os.O_RDWR | os.O_CLOEXEC, MODE, dir_fd=folder)
        return file, Path(f"/proc/self/fd/{file}")
    name = parent / f".dsc-{secrets.token_hex(8)}"
    return os.open(name, os.O_CREAT | os.O_EXCL | os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC, MODE), name
