"""The files that a store keeps beside itself: what they are called, and whether they are its own."""

from __future__ import annotations

import os
import sqlite3
import stat
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path

from knowledge_base.errors import Place, StoreError

LOG, INDEX, OLD_LOG, LOCK, WORLD = "-wal", "-shm", "-journal", "-lock", "-world"
ENDINGS = (LOG, INDEX, OLD_LOG, LOCK, WORLD)
"""What the name of a store ends in for SQLite's log and its index, the log that SQLite kept in earlier times, our lock,
and the simulated world of a run."""

_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFLNK: "a link",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
_LOG_HEADS = (bytes.fromhex("377f0682002de21800001000"), bytes.fromhex("377f0683002de21800001000"), bytes(12))
"""A log with pages of 4 KiB begins with one of these; with zeros while it has its length, but no commit."""
_INDEX_HEADS = ((3007000).to_bytes(4, "little"), (3007000).to_bytes(4, "big"), bytes(4), bytes(3), b"")
_MAGIC = b"SQLite format 3\0"
_SHORTEST = 512
"""Bytes of the smallest database; what is shorter SQLite takes for an empty one."""
_INDEX_PART = 32768
"""An index has a multiple of so many bytes; 3, for a moment, when SQLite begins it."""


def store_owning(path: Path, in_use: Iterable[Path] = ()) -> Path | None:
    """The store that a file is, or is kept beside, so that nothing else may be written there; `None` if it is free.

    Every SQLite file counts as a store. The file itself may be missing. Links are followed.

    Args:
        path: the file to be written.
        in_use: stores of this process, which may be missing yet.
    """
    try:
        stores = {store.resolve() for store in in_use}
        owner: Path | None = path.resolve()
        while owner is not None and owner not in stores and not is_database(owner):
            owner = _beside(owner)
    except (OSError, RuntimeError, ValueError):  # a name that no file has: too long, a null character, circular links
        return None
    return owner


def is_database(path: Path) -> bool:
    """Whether the file is an SQLite database, ours or not; nothing is created, changed or waited for."""
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode):
            return False
        if found.st_size < _SHORTEST:
            return _begins_as_database(path)
        with closing(unlocked(path)) as connection:
            connection.execute("PRAGMA schema_version")
    except sqlite3.Error as error:
        code = getattr(error, "sqlite_errorcode", None)
        return code == sqlite3.SQLITE_CORRUPT or (code == sqlite3.SQLITE_NOTADB and _begins_as_database(path))
    except (OSError, ValueError):
        return False
    return True


def unlocked(path: Path) -> sqlite3.Connection:
    """A connection to a file as if nobody ever wrote it: it takes no locks, creates no files and ignores the log.

    Even the head of a store is read in this way. A file that is closed loses all locks that this process has on it;
    SQLite knows its own.
    """
    uri = f"{path.absolute().as_uri()}?mode=ro&immutable=1"
    return sqlite3.connect(uri, uri=True, isolation_level=None, check_same_thread=False)


def regular(path: Path) -> os.stat_result | None:
    """What the system says about a regular file; `None` if nothing is there. The path leads through no link.

    Raises:
        StoreError: something else is there, or nobody can tell.
    """
    try:
        found = path.lstat()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise StoreError(f"cannot open the file: {error.strerror}", place=Place(str(path))) from None
    if not stat.S_ISREG(found.st_mode):
        kind = _KINDS.get(stat.S_IFMT(found.st_mode), "of an unknown kind")
        raise StoreError(f"'{path.name}' is {kind}, not a regular file", place=Place(str(path)))
    return found


def open_own(path: Path, store: Path) -> int:
    """A descriptor of a file beside a store, to read and write: of a regular file, never of what a link leads to.

    Raises:
        FileNotFoundError: nothing is there.
        StoreError: something else is there, or it cannot be opened.
    """
    regular(path)  # to open a device may do something already
    try:
        file = os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise StoreError(f"cannot open '{path.name}': {error.strerror}", place=Place(str(store))) from None
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise foreign(path, store, "is no regular file")
    return file


def foreign(path: Path, store: Path, reason: str) -> StoreError:
    """The error for a file beside a store that is not the store's."""
    said = f"'{path.name}' beside the store {reason}; move it away, or take another name for the store"
    return StoreError(said, place=Place(str(store)))


def require_no_strangers(store: Path, *, there: bool) -> None:
    """Raise `StoreError` for what SQLite would take for its own beside a store, and is not.

    Args:
        store: its resolved path.
        there: whether it is there; SQLite's files without it are all that is left of another store.
    """
    old_log, index, log = (store.with_name(store.name + ending) for ending in (OLD_LOG, INDEX, LOG))
    if regular(old_log) is not None:
        raise foreign(old_log, store, "is none of its files: a store has no log of that kind")
    size = _size(index)  # asked for first: SQLite begins with the log, and deletes it last
    if there and _size(log) is not None:
        _require(log, store, _head(log, 12) in (*_LOG_HEADS, b"", None), "is no log of SQLite")
        _require(index, store, size is None or size % _INDEX_PART in (0, 3), "is no index of SQLite")
        return
    for path in (log, index):
        _require(path, store, there or _size(path) is None, "is left of another one, and may hold its last changes")
    if size is not None and _size(index) is not None and _size(log) is None:
        _require(index, store, _head(index, 4) in _INDEX_HEADS, "is no index of SQLite")


def _size(path: Path) -> int | None:
    found = regular(path)
    return None if found is None else found.st_size


def _head(path: Path, length: int) -> bytes | None:
    """The first bytes of a file that SQLite has no locks on; `None` if it is gone."""
    try:
        file = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise StoreError(f"cannot read the file: {error.strerror}", place=Place(str(path))) from None
    try:
        return os.pread(file, length, 0)
    finally:
        os.close(file)


def _require(path: Path, store: Path, holds: object, reason: str) -> None:
    if not holds:
        raise foreign(path, store, reason)


def _begins_as_database(path: Path) -> bool:
    """Whether the file begins as a database does; to be asked of what SQLite cannot open: closing it loses locks."""
    with path.open("rb") as file:
        return file.read(len(_MAGIC)) == _MAGIC


def _beside(path: Path) -> Path | None:
    """The file that one of that name is kept beside."""
    for ending in ENDINGS:
        name = path.name.removesuffix(ending)
        if name not in ("", path.name):
            return path.with_name(name)
    return None
