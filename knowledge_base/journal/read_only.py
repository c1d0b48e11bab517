"""Reading of stores that this process cannot write, and where SQLite cannot create its sidecar files.

A store with an empty log is read in place, without locks. Any other store is read from a private copy with its log, so
that the last commits are included.
"""

from __future__ import annotations

import atexit
import os
import shutil
import sqlite3
import tempfile
from pathlib import Path
from threading import Lock
from typing import NamedTuple

from knowledge_base.errors import Place, StoreError
from knowledge_base.journal.sidecar_files import INDEX, LOG, regular, unlocked

_TRIES = 5
"""Number of attempts to copy a file during writes."""
Stamp = tuple[tuple[int, int, int] | None, ...]
"""Inode, length and time of the store's file and of its log; equal until either is written."""


class _Copy(NamedTuple):
    path: Path
    stamp: Stamp
    folder: Path
    process: int


_lock = Lock()
_copies: list[_Copy] = []
"""The last copy, since a store is mostly read more than once."""


def is_still(path: Path) -> bool:
    """Return whether SQLite would need to create a sidecar file that this process must not create."""
    if all(regular(path.with_name(path.name + ending)) for ending in (LOG, INDEX)):
        return False
    return not (os.access(path, os.W_OK) and os.access(path.parent, os.W_OK))


def open_still(path: Path) -> tuple[sqlite3.Connection, Stamp | None]:
    """Return a connection in a transaction, with the stamp that the store must still have after reading.

    A copy has no stamp.

    Raises:
        StoreError: the store cannot be copied.
        sqlite3.Error: the store cannot be read.
    """
    stamp = stamp_of(path)
    log = stamp[1]
    if log is None or log[1] == 0:
        return _begun(unlocked(path)), stamp
    with _lock:  # until SQLite has opened the log too
        return _begun(sqlite3.connect(_copied(path), isolation_level=None, check_same_thread=False)), None


def stamp_of(path: Path) -> Stamp:
    """Return the present stamp of a store."""
    found = (regular(path), regular(path.with_name(path.name + LOG)))
    return tuple(one and (one.st_ino, one.st_size, one.st_mtime_ns) for one in found)


def _begun(connection: sqlite3.Connection) -> sqlite3.Connection:
    try:
        connection.execute("PRAGMA query_only = ON")
        connection.execute("BEGIN")
        connection.execute("SELECT 1 FROM sqlite_master")
    except BaseException:
        connection.close()
        raise
    return connection


def _copied(path: Path) -> Path:
    for _ in range(_TRIES):
        stamp = stamp_of(path)
        if _copies and _copies[0][:2] == (path, stamp) and _copies[0].process == os.getpid():
            return _copies[0].folder / "copy"
        _forget()
        try:
            folder = Path(tempfile.mkdtemp(prefix="dsc-"))
            _copies.append(_Copy(path, stamp, folder, os.getpid()))
            shutil.copyfile(path, folder / "copy")
            shutil.copyfile(path.with_name(path.name + LOG), folder / f"copy{LOG}")
        except OSError as error:
            _forget()
            said = f"cannot copy the store, which is the way to read it here: {error.strerror}"
            raise StoreError(said, place=Place(str(path))) from None
    _forget()
    raise changed(path)


def changed(path: Path) -> StoreError:
    """Return the error for a store that changed during a read without locks."""
    return StoreError("the store was written while it was read; read it again", place=Place(str(path)))


def _forget() -> None:
    """Delete the copy; after a fork it belongs to the parent."""
    while _copies:
        copy = _copies.pop()
        if copy.process == os.getpid():
            shutil.rmtree(copy.folder, ignore_errors=True)


atexit.register(_forget)
