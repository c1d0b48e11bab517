"""Sidecar files of a store: names, checks that they belong to the store, atomic creation, and the writer lock."""

from __future__ import annotations

import fcntl
import os
import re
import secrets
import sqlite3
import stat
from collections.abc import Iterable
from contextlib import closing, suppress
from pathlib import Path

from knowledge_base.errors import Place, StoreError

LOG, INDEX, OLD_LOG, LOCK, WORLD = "-wal", "-shm", "-journal", "-lock", "-world"
ENDINGS = (LOG, INDEX, OLD_LOG, LOCK, WORLD)
"""Endings of the sidecar files.

The files are SQLite's log, its index and its rollback journal, the writer lock, and the simulated world of a run.
"""
MODE = 0o644
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFLNK: "a link",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
_LOG_HEADS = (bytes.fromhex("377f0682002de21800001000"), bytes.fromhex("377f0683002de21800001000"), bytes(12))
"""The first bytes of a log with pages of 4 KiB; a log without a commit begins with zeros."""
_INDEX_HEADS = ((3007000).to_bytes(4, "little"), (3007000).to_bytes(4, "big"), bytes(4), bytes(3), b"")
_MAGIC = b"SQLite format 3\0"
_SHORTEST = 512
"""Length of the smallest database in bytes; SQLite treats a shorter file as empty."""
_INDEX_PART = 4096
"""The length of an index is a multiple of this number of bytes, also while SQLite lengthens the index part by part."""
_NEW_INDEX = 3
"""The length of an index in bytes just after SQLite has created it."""
_LOCK_MARK = re.compile(rb"dsc writer +(\d+)\n")
"""The content of a lock file, always with the same length; a lock file is never empty."""


def store_owning(path: Path, in_use: Iterable[Path] = ()) -> Path | None:
    """Return the store that the path denotes or is a sidecar file of.

    Return `None` if other programs may write the path.

    Every SQLite file counts as a store. The file itself may be missing. Links are followed.

    Args:
        path: the file to be written.
        in_use: stores of this process, which may not exist yet.
    """
    try:
        stores = {store.resolve() for store in in_use}
        owner: Path | None = path.resolve()
        while owner is not None and owner not in stores and not is_database(owner):
            owner = _sidecar(owner)
    except (OSError, RuntimeError, ValueError):  # an invalid name: too long, a null character, links in a cycle
        return None
    return owner


def is_database(path: Path) -> bool:
    """Return whether the file is an SQLite database of any kind, without creating, changing or locking a file."""
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
    """Return a connection that acquires no locks, creates no files and ignores the log.

    Even headers are read through such a connection. In Python, closing a file releases all locks of this process on
    that file; SQLite avoids this for its own locks.
    """
    uri = f"{path.absolute().as_uri()}?mode=ro&immutable=1"
    return sqlite3.connect(uri, uri=True, isolation_level=None, check_same_thread=False)


def regular(path: Path) -> os.stat_result | None:
    """Return the status of a regular file; `None` if the file is missing. The path must not be a link.

    Raises:
        StoreError: the path has another kind of file, or its status cannot be read.
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
    """Return a file descriptor for reading and writing a regular sidecar file, without following a link.

    Raises:
        FileNotFoundError: the file is missing.
        StoreError: the path has another kind of file, or cannot be opened.
    """
    regular(path)  # to open a device may have side effects
    try:
        file = os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise StoreError(f"cannot open '{path.name}': {error.strerror}", place=Place(str(store))) from None
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise foreign(path, store, "is not a regular file")
    return file


def foreign(path: Path, store: Path, reason: str) -> StoreError:
    """Return the error for a file with the name of a sidecar file that does not belong to the store."""
    said = f"'{path.name}' next to the store {reason}; move it away, or take another name for the store"
    return StoreError(said, place=Place(str(store)))


def require_no_strangers(store: Path, *, there: bool) -> None:
    """Raise `StoreError` for foreign files that SQLite would use as sidecar files of the store.

    Args:
        store: the resolved path of the store.
        there: whether the store exists. Without the store, SQLite's sidecar files remain from another store.
    """
    old_log, index, log = (store.with_name(store.name + ending) for ending in (OLD_LOG, INDEX, LOG))
    if regular(old_log) is not None:
        raise foreign(old_log, store, "is not one of its files: a store has no log of that kind")
    size = _size(index)  # the index is read first: SQLite creates the log before it, and deletes the log after it
    if there and _size(log) is not None:
        _require(log, store, _head(log, 12) in (*_LOG_HEADS, b"", None), "is not a log of SQLite")
        _require(index, store, size in (None, _NEW_INDEX) or not size % _INDEX_PART, "is not an index of SQLite")
        return
    for path in (log, index):
        _require(path, store, there or _size(path) is None, "remains of another store, and may hold its last changes")
    if size is not None and _size(index) is not None and _size(log) is None:
        _require(index, store, _head(index, 4) in _INDEX_HEADS, "is not an index of SQLite")


def _size(path: Path) -> int | None:
    found = regular(path)
    return None if found is None else found.st_size


def _head(path: Path, length: int) -> bytes | None:
    """Return the first bytes of a file without SQLite's locks; `None` if the file is missing."""
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
    """Return whether the file begins with SQLite's magic number.

    A caller may use this function only for files that SQLite cannot open, since closing a file releases locks.
    """
    with path.open("rb") as file:
        return file.read(len(_MAGIC)) == _MAGIC


def _sidecar(path: Path) -> Path | None:
    """Return the path of the file whose sidecar file has the name of `path`, or `None`."""
    for ending in ENDINGS:
        name = path.name.removesuffix(ending)
        if name not in ("", path.name):
            return path.with_name(name)
    return None


def place(path: Path, content: bytes, *, locked: bool = False, synced: bool = False, lasting: bool = False) -> int:
    """Create a file; return its file descriptor for reading and writing.

    The file has no name until it is complete. On a file system without nameless files, the file has a random name until
    then; the file keeps this name if the process is killed.

    Args:
        path: the path of the new file.
        content: the whole content of the file.
        locked: whether this process has locked the file (`flock`) from the beginning.
        synced: whether the content survives a power cut.
        lasting: whether the name survives a power cut.

    Raises:
        FileExistsError: `path` exists.
        OSError: the file cannot be created.
    """
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        file, name = _nameless(path.parent, folder)
        try:
            with os.fdopen(file, "wb", closefd=False) as whole:  # a full disk may store only a part without an error
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
    """Return the file descriptor of a new file, and the path from which the file can be linked."""
    with suppress(OSError, AttributeError):  # some systems and file systems lack nameless files
        Path("/proc/self/fd").lstat()
        file = os.open(".", os.O_TMPFILE | os.O_RDWR | os.O_CLOEXEC, MODE, dir_fd=folder)
        return file, Path(f"/proc/self/fd/{file}")
    name = parent / f".dsc-{secrets.token_hex(8)}"
    return os.open(name, os.O_CREAT | os.O_EXCL | os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC, MODE), name


class WriterLock:
    """The right to write a store, from the creation of this object until `release`.

    The lock is on a sidecar file, which contains the number of the process; `release` deletes the file. The store file
    itself is not locked: closing it in any thread would release SQLite's own locks. A file of that name that is not a
    lock file stays unchanged.

    Raises:
        StoreError: another writer has the store open, in this process or another; or the lock file cannot be created.
    """

    def __init__(self, store: Path) -> None:
        self._store = store
        self._path = store.with_name(store.name + LOCK)
        self._released = False
        self._file = self._lock()
        while not self._is_there():  # its owner deleted the file between open and lock
            os.close(self._file)
            self._file = self._lock()
        os.pwrite(self._file, _lock_content(), 0)

    def release(self) -> None:
        """Release the lock and delete its file; further calls have no effect."""
        if not self._released:
            self._released = True
            if self._is_there():
                self._path.unlink()
            os.close(self._file)

    def _is_there(self) -> bool:
        """Return whether the locked file is still the file at the path."""
        try:
            return os.path.samestat(os.fstat(self._file), self._path.lstat())
        except FileNotFoundError:
            return False

    def _lock(self) -> int:
        while True:
            try:
                return self._open_existing()
            except FileNotFoundError:
                pass  # no writer exists, or the writer has just closed the store
            try:
                return place(self._path, _lock_content(), locked=True)
            except FileExistsError:
                continue  # another writer was faster
            except OSError as error:
                said = f"cannot write '{self._path}': {error.strerror}"
                raise StoreError(said, place=Place(str(self._store))) from None

    def _open_existing(self) -> int:
        """Return the file descriptor of the existing lock file, after locking it.

        Raises:
            FileNotFoundError: the lock file is missing.
            StoreError: as for the class.
        """
        file = open_own(self._path, self._store)
        try:
            process = self._process(file)
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise _taken_error(self._store, process) from None
        except BaseException:
            os.close(file)
            raise
        return file

    def _process(self, file: int) -> str:
        """Return the process number in the lock file."""
        found = _LOCK_MARK.fullmatch(os.pread(file, 2 * len(_lock_content()), 0))
        if found is None:
            raise foreign(self._path, self._store, "is not the lock of a store")
        return found[1].decode()


def has_writer(store: Path) -> bool:
    """Return whether a living process of this machine has the store open for writing; the lock stays untouched."""
    lock = store.with_name(store.name + LOCK)
    found = _LOCK_MARK.fullmatch(_head(lock, len(_lock_content())) or b"")
    try:
        if found is not None:
            os.kill(int(found[1]), 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass  # a process of another user
    return found is not None


def _lock_content() -> bytes:
    return b"dsc writer %20d\n" % os.getpid()


def _taken_error(store: Path, process: str) -> StoreError:
    return StoreError(
        f"another writer has it open (process {process}); it can be opened with read_only=True meanwhile",
        place=Place(str(store)),
    )
