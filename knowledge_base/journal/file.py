"""The SQLite file of a store: connections, headers, and errors with their meaning."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

from knowledge_base.errors import DamagedStoreError, Place, StoreError
from knowledge_base.journal.read_only import changed, is_still, open_still, stamp_of
from knowledge_base.journal.sidecar_files import INDEX, LOG, OLD_LOG, regular, require_no_strangers, unlocked
from knowledge_base.pddl.files import files_beside

Durability = Literal["memory", "process", "power"]
"""The events that a commit survives: none; the death of the process; a power cut (if the disk reports writes
correctly).
"""

APPLICATION_ID = 0x6473636B  # "dsck", the file kind in SQLite's application_id
FORMAT = 3
PATIENCE_S = 1.0
"""Seconds to wait for another process that locks the file; normally there is none."""

_LONGEST_PATH = 500
"""Bytes; SQLite opens no file with a path of more than 511."""
_PAGES_IN_LOG = {"process": 0, "power": 1000}
"""Pages of 4 KiB in SQLite's log after which a commit runs a checkpoint; 0: a thread runs it."""
_LOG_LENGTH = (_PAGES_IN_LOG["power"] + 24) * (4096 + 24)  # a frame is a page and its head; commits are not cut
_SYNCHRONOUS = {"process": "NORMAL", "power": "FULL"}  # in WAL mode only FULL waits for the disk in each commit


@contextmanager
def reported(path: Path, doing: str) -> Iterator[None]:
    """Convert SQLite's errors into a `StoreError` with the failed operation and the file."""
    try:
        yield
    except sqlite3.Error as error:
        kind = DamagedStoreError if _means_damage(error) else StoreError
        raise kind(f"cannot {doing} the store: {error}", place=Place(str(path))) from error


def _means_damage(error: sqlite3.Error) -> bool:
    """Return whether SQLite reports a malformed file, or Python finds invalid UTF-8 in a text."""
    code = getattr(error, "sqlite_errorcode", None)
    if code is None:
        return "UTF-8" in str(error)
    return code & 0xFF in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


@contextmanager
def reading(path: Path) -> Iterator[sqlite3.Connection]:
    """Yield a connection that sees one version of the file, independent of later commits.

    Args:
        path: as from `located`.

    Raises:
        StoreError: the file is missing, not a store, or unreadable.
    """
    seen = _seen(str(path))
    with reported(path, "read"):
        _require_readable(path, seen)
        if not all(seen[:3]) and is_still(path):  # SQLite creates missing ones
            with _reading_still(path) as connection:
                yield connection
            return
        connection = connect(path, "ro")
        try:
            connection.execute("BEGIN")
            require_store(connection, path)
            yield connection
        finally:
            connection.close()


Seen = tuple[tuple[int, int, bool] | None, ...]
"""Device, inode, and whether there is content: of a store and of SQLite's sidecar files."""


def _seen(name: str) -> Seen:
    return tuple([_identity(name + ending) for ending in ("", LOG, INDEX, OLD_LOG)])


def _identity(name: str) -> tuple[int, int, bool] | None:
    try:
        found = os.lstat(name)
    except OSError:
        return None
    return found.st_dev, found.st_ino, found.st_size > 0


@lru_cache(maxsize=256)  # queries of the past and followers open the same files repeatedly
def _require_readable(path: Path, seen: Seen) -> None:  # noqa: ARG001  other files, another answer
    if not is_there(path):
        beside = files_beside(path)
        raise StoreError(f"there is no store '{path.name}'", place=Place(str(path)), found=path.name, valid=beside)
    require_own(path)


@contextmanager
def _reading_still(path: Path) -> Iterator[sqlite3.Connection]:
    connection, stamp = open_still(path)
    try:
        require_store(connection, path)
        yield connection
    except sqlite3.Error:
        if stamp not in (None, stamp_of(path)):
            raise changed(path) from None
        raise
    finally:
        connection.close()
    if stamp not in (None, stamp_of(path)):
        raise changed(path)


def located(path: str | Path) -> Path:
    """Return the resolved path of a store.

    Raises:
        StoreError: the path does not name a file, is too long, or is a broken link.
    """
    text = str(path)
    if text == ":memory:" or text.startswith("file:"):
        raise StoreError(f"'{text}' has a meaning to SQLite; a store is named by the path of its file")
    if text.endswith("/"):
        raise StoreError(f"'{text}' names a folder; a store is a file")
    try:
        found = Path(path).resolve()
        if Path(path).is_symlink() and not found.exists():
            raise StoreError(f"'{text}' is a link to '{found}', which is missing")
    except (OSError, RuntimeError, ValueError) as error:  # e.g. circular links
        raise StoreError(f"cannot open the store: {error}", place=Place(text)) from None
    if len(os.fsencode(found)) > _LONGEST_PATH:
        raise StoreError(f"the path of the store has more than {_LONGEST_PATH} bytes", place=Place(str(found)))
    return found


def is_there(path: Path) -> bool:
    """Return whether a store may exist at the path; if not, one can be made.

    Raises:
        StoreError: another kind of file, an empty file, or a foreign sidecar file is there, or the folder is missing.
    """
    found = regular(path)
    if found is None and not path.parent.is_dir():
        raise StoreError(f"there is no folder '{path.parent}' for a store to be in", place=Place(str(path)))
    require_no_strangers(path, there=bool(found and found.st_size))
    if found is not None and not found.st_size:
        said = f"'{path.name}' is empty, and no store; a new store replaces no file"
        raise StoreError(said, place=Place(str(path)))
    return found is not None


def writing(path: Path, durability: Durability) -> sqlite3.Connection:
    """Return a connection to write with.

    Raises:
        StoreError: the file cannot be opened, or is not a store.
    """
    with reported(path, "open"):
        require_own(path)
        require_one_name(path)
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


def require_one_name(path: Path) -> None:
    """Raise `StoreError` for a file with several names (hard links), for each would have a separate log and lock."""
    found = regular(path)
    if found is not None and found.st_nlink > 1:
        said = f"the file has {found.st_nlink} names (hard links); only a store with one name is written"
        raise StoreError(said, place=Place(str(path)))


def to_tidy_up(path: Path) -> sqlite3.Connection:
    """Return a second connection to an open store, for a checkpoint.

    Raises:
        sqlite3.Error: the connection cannot be opened.
    """
    connection = connect(path, "rw")
    connection.execute("PRAGMA synchronous = NORMAL")  # otherwise the log could be reset before the file is on the disk
    return connection


def lay_out_log(path: Path) -> None:
    """Extend SQLite's log to its final length; the writer's connection is open.

    A growing file makes each wait for the disk longer and dependent on other writers, since its length must be stored
    too. SQLite ignores content after the last commit; zeros are never a commit.

    Raises:
        StoreError: the disk is full.
    """
    try:
        with open(path.with_name(path.name + LOG), "r+b", opener=_not_through_links) as log:
            length = log.seek(0, os.SEEK_END)
            log.write(bytes(max(0, _LOG_LENGTH - length)))
            log.flush()
            os.fsync(log.fileno())
    except OSError as error:
        raise StoreError(f"cannot lay out the store's log: {error.strerror}", place=Place(str(path))) from error


def delete_empty_log(path: Path) -> None:
    """Delete the sidecar files that SQLite leaves at a moved store's old path; the writer still holds its lock."""
    log = path.with_name(path.name + LOG)
    if not path.exists() and log.exists() and not log.stat().st_size:
        log.unlink()
        path.with_name(path.name + INDEX).unlink(missing_ok=True)


def _not_through_links(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NOFOLLOW)


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of SQLite file, by its header.

    Attributes:
        name: its name in messages.
        application_id: SQLite's `application_id`.
        form: number of its format.
    """

    name: str
    application_id: int
    form: int


STORE = Kind("knowledge store", APPLICATION_ID, FORMAT)


def require_own(path: Path, kind: Kind = STORE) -> None:
    """Raise `StoreError` unless the file is of that kind; SQLite's sidecar files stay unchanged.

    Normal opening of a foreign database may already run a checkpoint of its log. SQLite calls a file malformed during a
    checkpoint, or after the process died in one; its log has the missing pages.
    """
    try:
        with closing(unlocked(path)) as connection:
            require_store(connection, path, kind)
    except sqlite3.DatabaseError as error:
        if getattr(error, "sqlite_errorcode", 0) & 0xFF != sqlite3.SQLITE_CORRUPT:
            raise


def require_store(connection: sqlite3.Connection, path: Path, kind: Kind = STORE) -> None:
    """Raise `StoreError` unless the file has the kind's identity and format."""
    if _number(connection, "PRAGMA application_id") != kind.application_id:
        raise StoreError(f"this is a database, but no {kind.name}", place=Place(str(path)))
    form = _number(connection, "PRAGMA user_version")
    if form != kind.form:
        said = f"the {kind.name.split()[-1]} has format {form}, this program reads format {kind.form}"
        raise StoreError(said, place=Place(str(path)))


def _number(connection: sqlite3.Connection, statement: str) -> int:
    return int(connection.execute(statement).fetchone()[0])


def connect(path: Path, mode: str) -> sqlite3.Connection:
    """Return a connection in autocommit mode; `mode` is SQLite's `mode` of URI filenames."""
    uri = f"{path.absolute().as_uri()}?mode={mode}"
    return sqlite3.connect(uri, uri=True, isolation_level=None, check_same_thread=False, timeout=PATIENCE_S)
