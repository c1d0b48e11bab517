"""The SQLite file of a store: connections, headers, and the meaning of SQLite's errors.

Some processes cannot write a store, or cannot create SQLite's sidecar files. If the log of the store is empty, such a
process reads the store in place without locks. Otherwise such a process reads a private copy of the store and its log,
which includes the last commits.
"""

from __future__ import annotations

import atexit
import os
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Literal, NamedTuple

from knowledge_base.errors import DamagedStoreError, InputError, Place, StoreError
from knowledge_base.journal.sidecar_files import INDEX, LOG, OLD_LOG, place, regular, require_no_strangers, unlocked
from knowledge_base.pddl.files import neighbour_files
from knowledge_base.user_objects import shown

Durability = Literal["memory", "process", "power"]
"""The failures that a commit survives.

"memory": none. "process": the end of the process. "power": also a power cut, if the disk reports writes correctly.
"""
APPLICATION_ID = 0x6473636B  # "dsck", the file kind in SQLite's application_id
FORMAT = 3
PATIENCE_S = 1.0
"""Time in seconds to wait for another process that locks the file; normally no process does."""
_LONGEST_PATH = 500
"""Maximum length of a store's path in bytes; SQLite opens no file with a path of more than 511 bytes."""
_PAGE_SIZE = 4096
_WAL = b"\2\2"
"""Bytes 18 and 19 of SQLite's header for a database in WAL mode: one for writing and one for reading."""
_TRIES = 5
"""Number of attempts to copy a file during writes."""
Seen = tuple[tuple[int, int, bool] | None, ...]
"""Device, inode, and whether the file has content, for a store and SQLite's sidecar files; `None` if missing."""
Stamp = tuple[tuple[int, int, int] | None, ...]
"""Inode, length and modification time of the store's file and of its log; every write changes the stamp."""


class Kind(NamedTuple):
    """A kind of SQLite file, identified by its header.

    Attributes:
        name: name of the kind in messages.
        application_id: SQLite's `application_id`.
        form: number of the file format.
        remedy: the advice for a file of another format, or empty.
    """

    name: str
    application_id: int
    form: int
    remedy: str = ""


STORE = Kind(
    "knowledge store", APPLICATION_ID, FORMAT,
    "; `dsc kb export` of the version that wrote it writes JSON, and `dsc kb import` adds this to a new store",
)  # fmt: skip


@contextmanager
def reported(path: Path, doing: str) -> Iterator[None]:
    """Convert SQLite's errors into a `StoreError` with the failed operation and the file."""
    try:
        yield
    except (sqlite3.Error, UnicodeDecodeError) as error:  # SQLite's own words may quote a damaged name
        kind = DamagedStoreError if _means_damage(error) else StoreError
        raise kind(f"cannot {doing} the store: {error}", place=Place(str(path))) from error


def _means_damage(error: sqlite3.Error | UnicodeDecodeError) -> bool:
    """Return whether SQLite reports a malformed file, or Python finds invalid UTF-8 in a text."""
    code = getattr(error, "sqlite_errorcode", None)
    if code is None:
        return "UTF-8" in str(error).upper()
    return code & 0xFF in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


@contextmanager
def reading(path: Path) -> Iterator[sqlite3.Connection]:
    """Yield a connection that reads one version of the file, independent of later commits.

    Args:
        path: a path from `located`.

    Raises:
        StoreError: the file is missing, unreadable, or is not a store.
    """
    seen = _seen(str(path))
    with reported(path, "read"):
        _require_readable(path, seen)
        if not all(seen[:3]) and is_still(path):  # SQLite would create missing sidecar files
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


def _seen(name: str) -> Seen:
    return tuple([_identity(name + ending) for ending in ("", LOG, INDEX, OLD_LOG)])


def _identity(name: str) -> tuple[int, int, bool] | None:
    try:
        found = os.lstat(name)
    except OSError:
        return None
    return found.st_dev, found.st_ino, found.st_size > 0


@lru_cache(maxsize=256)  # queries of past versions and followers open the same files repeatedly
def _require_readable(path: Path, seen: Seen) -> None:  # noqa: ARG001  other files, another answer
    if not is_there(path):
        neighbours = neighbour_files(path)
        raise StoreError(f"there is no store '{path.name}'", place=Place(str(path)), found=path.name, valid=neighbours)
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
        InputError: the path is neither text nor a `Path`, or is empty.
        StoreError: the path does not denote a file, is too long, or is a broken link.
    """
    text = str(path)
    if not isinstance(path, str | Path) or "\0" in text or not text:
        raise InputError(f"a store's path is text or a Path, not {shown(path)}")
    if text == ":memory:" or text.startswith("file:"):
        raise StoreError(f"'{text}' has a meaning to SQLite; a store is named by the path of its file")
    if text.endswith("/"):
        raise StoreError(f"'{text}' names a folder; a store is a file")
    try:
        found = Path(path).resolve()
        if Path(path).is_symlink() and not found.exists():
            raise StoreError(f"'{text}' is a link to '{found}', which is missing")
    except (OSError, RuntimeError, ValueError) as error:  # e.g. links in a cycle
        raise StoreError(f"cannot open the store: {error}", place=Place(text)) from None
    if len(os.fsencode(found)) > _LONGEST_PATH:
        raise StoreError(f"the path of the store has more than {_LONGEST_PATH} bytes", place=Place(str(found)))
    return found


def is_there(path: Path) -> bool:
    """Return whether a store may exist at the path; if not, a new store can be created.

    Raises:
        StoreError: the path has another kind of file or an empty file, a foreign sidecar file exists, or the folder is
            missing.
    """
    found = regular(path)
    if found is None and not path.parent.is_dir():
        raise StoreError(f"there is no folder '{path.parent}' for a store to be in", place=Place(str(path)))
    try:
        require_no_strangers(path, there=bool(found and found.st_size))
    except StoreError:
        made = regular(path)
        if (found and found.st_size) or made is None or not made.st_size:
            raise
        require_no_strangers(path, there=True)  # another process has made the store since `found`
    if found is not None and not found.st_size:
        said = f"'{path.name}' is empty, and no store; a new store replaces no file"
        raise StoreError(said, place=Place(str(path)))
    return found is not None


def require_one_name(path: Path) -> None:
    """Raise `StoreError` for a file with several names (hard links): each name would have a separate log and lock."""
    found = regular(path)
    if found is not None and found.st_nlink > 1:
        said = f"the file has {found.st_nlink} names (hard links); only a store with one name is written"
        raise StoreError(said, place=Place(str(path)))


def require_own(path: Path, kind: Kind = STORE) -> None:
    """Raise `StoreError` unless the file is of that kind; SQLite's sidecar files stay unchanged.

    A normal connection to a foreign database might already run a checkpoint of its log. SQLite reports a file as
    malformed during a checkpoint, or after a crash in a checkpoint; the log then contains the missing pages.
    """
    try:
        with closing(unlocked(path)) as connection:
            require_store(connection, path, kind)
    except sqlite3.DatabaseError as error:
        if getattr(error, "sqlite_errorcode", 0) & 0xFF != sqlite3.SQLITE_CORRUPT:
            raise


def require_store(connection: sqlite3.Connection, path: Path, kind: Kind = STORE) -> None:
    """Raise `StoreError` unless the header of the file has the identity and format of the kind."""
    if _number(connection, "PRAGMA application_id") != kind.application_id:
        raise StoreError(f"this is a database, but no {kind.name}", place=Place(str(path)))
    form = _number(connection, "PRAGMA user_version")
    if form != kind.form:
        said = f"the {kind.name.split()[-1]} has format {form}, this program reads format {kind.form}{kind.remedy}"
        raise StoreError(said, place=Place(str(path)))


def _number(connection: sqlite3.Connection, statement: str) -> int:
    return int(connection.execute(statement).fetchone()[0])


def connect(path: Path, mode: str) -> sqlite3.Connection:
    """Return a connection in autocommit mode; `mode` is SQLite's `mode` of URI filenames."""
    uri = f"{path.absolute().as_uri()}?mode={mode}"
    return sqlite3.connect(uri, uri=True, isolation_level=None, check_same_thread=False, timeout=PATIENCE_S)


@contextmanager
def new_database(path: Path, application_id: int, form: int, *, lasting: bool) -> Iterator[sqlite3.Connection]:
    """Yield a connection to a database in memory, in a transaction; the end of the block writes it to `path`.

    Args:
        path: the path of the new file.
        application_id: identifies the kind of file in SQLite's header.
        form: number of the file format, SQLite's `user_version`.
        lasting: whether the name of the file survives a power cut; its content always does.

    Raises:
        OSError: a file exists at `path`, or the file cannot be created; nothing has changed.
        sqlite3.Error: the database cannot be created; nothing has changed.
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
    content[18:20] = _WAL  # with this header SQLite never uses a rollback journal
    os.close(place(path, bytes(content), lasting=lasting, synced=True))


class _Copy(NamedTuple):
    path: Path
    stamp: Stamp
    folder: Path
    process: int


_lock = Lock()
_copies: list[_Copy] = []
"""The latest copy; the list has at most one item. A store is usually read more than once."""


def is_still(path: Path) -> bool:
    """Return whether SQLite would need to create a sidecar file that this process cannot create."""
    if all(regular(path.with_name(path.name + ending)) for ending in (LOG, INDEX)):
        return False
    return not (os.access(path, os.W_OK) and os.access(path.parent, os.W_OK))


def open_still(path: Path) -> tuple[sqlite3.Connection, Stamp | None]:
    """Return a connection in a transaction, and the stamp that the store must still have after the read.

    The stamp is `None` for a private copy.

    Raises:
        StoreError: the store cannot be copied.
        sqlite3.Error: the store cannot be read.
    """
    stamp = stamp_of(path)
    log = stamp[1]
    if log is None or log[1] == 0:
        return _begin(unlocked(path)), stamp
    with _lock:  # until SQLite has opened the log too
        return _begin(sqlite3.connect(_copy(path), isolation_level=None, check_same_thread=False)), None


def stamp_of(path: Path) -> Stamp:
    """Return the present stamp of a store."""
    found = (regular(path), regular(path.with_name(path.name + LOG)))
    return tuple(one and (one.st_ino, one.st_size, one.st_mtime_ns) for one in found)


def _begin(connection: sqlite3.Connection) -> sqlite3.Connection:
    try:
        connection.execute("PRAGMA query_only = ON")
        connection.execute("BEGIN")
        connection.execute("SELECT 1 FROM sqlite_master")
    except BaseException:
        connection.close()
        raise
    return connection


def _copy(path: Path) -> Path:
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
    """Delete the copy; after a fork, only the parent process deletes it."""
    while _copies:
        copy = _copies.pop()
        if copy.process == os.getpid():
            shutil.rmtree(copy.folder, ignore_errors=True)


atexit.register(_forget)
