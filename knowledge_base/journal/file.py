"""The SQLite file of a store: how it is opened, and what its errors mean to people."""

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
"""What a commit outlives: nothing; the death of the process; a power cut (as far as the disk is honest)."""

APPLICATION_ID = 0x6473636B  # "dsck", by which a file is known as ours (SQLite's application_id)
FORMAT = 3
PATIENCE_S = 1.0
"""How long to wait for others who lock the file; there should be none."""

_LONGEST_PATH = 500
"""In bytes; SQLite opens no file with a path of more than 511."""
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
        kind = DamagedStoreError if _means_damage(error) else StoreError
        raise kind(f"cannot {doing} the store: {error}", place=Place(str(path))) from error


def _means_damage(error: sqlite3.Error) -> bool:
    """Whether SQLite says that the file is malformed, or text in it is no UTF-8 (which is Python's own finding)."""
    code = getattr(error, "sqlite_errorcode", None)
    if code is None:
        return "UTF-8" in str(error)
    return code & 0xFF in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


@contextmanager
def reading(path: Path) -> Iterator[sqlite3.Connection]:
    """A connection that sees one version of the file, whatever is written meanwhile.

    Args:
        path: as from `located`.

    Raises:
        StoreError: the file is not there, not a store, or cannot be read.
    """
    seen = _seen(str(path))
    with reported(path, "read"):
        _require_readable(path, seen)
        if not all(seen[:3]) and is_still(path):  # SQLite makes the missing ones
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
"""Device, inode, and whether there is content: of a store and of SQLite's files beside it."""


def _seen(name: str) -> Seen:
    return tuple([_identity(name + ending) for ending in ("", LOG, INDEX, OLD_LOG)])


def _identity(name: str) -> tuple[int, int, bool] | None:
    try:
        found = os.lstat(name)
    except OSError:
        return None
    return found.st_dev, found.st_ino, found.st_size > 0


@lru_cache(maxsize=256)  # whoever asks for the past, or follows a writer, opens the same files again and again
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
    """The place of a store that somebody names, without links on the way.

    Raises:
        StoreError: it is no name of a file, too long, or a link that leads nowhere.
    """
    text = str(path)
    if text == ":memory:" or text.startswith("file:"):
        raise StoreError(f"'{text}' has a meaning to SQLite; a store is named by the path of its file")
    if text.endswith("/"):
        raise StoreError(f"'{text}' names a folder; a store is a file")
    try:
        found = Path(path).resolve()
        if Path(path).is_symlink() and not found.exists():
            raise StoreError(f"'{text}' is a link to '{found}', which is not there")
    except (OSError, RuntimeError, ValueError) as error:  # e.g. links that lead to each other
        raise StoreError(f"cannot open the store: {error}", place=Place(text)) from None
    if len(os.fsencode(found)) > _LONGEST_PATH:
        raise StoreError(f"the path of the store has more than {_LONGEST_PATH} bytes", place=Place(str(found)))
    return found


def is_there(path: Path) -> bool:
    """Whether a store can be there; if not, one can be made.

    Raises:
        StoreError: neither: something else than a file with content is there, or a file of a store that is none of
            this one's is beside it, or there is no folder.
    """
    found = regular(path)
    if found is None and not path.parent.is_dir():
        raise StoreError(f"there is no folder '{path.parent}' for a store to be in", place=Place(str(path)))
    require_no_strangers(path, there=bool(found and found.st_size))
    if found is not None and not found.st_size:
        said = f"'{path.name}' is empty, and no store; a new store takes the place of no file"
        raise StoreError(said, place=Place(str(path)))
    return found is not None


def writing(path: Path, durability: Durability) -> sqlite3.Connection:
    """A connection to write with.

    Raises:
        StoreError: it cannot be opened, or is something else than a store.
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
    """Raise `StoreError` for a file with several names (hard links): each would have a log and a lock of its own."""
    found = regular(path)
    if found is not None and found.st_nlink > 1:
        said = f"the file has {found.st_nlink} names (hard links); only a store with one name is written"
        raise StoreError(said, place=Place(str(path)))


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
        with open(path.with_name(path.name + LOG), "r+b", opener=_not_through_links) as log:
            length = log.seek(0, os.SEEK_END)
            log.write(bytes(max(0, _LOG_LENGTH - length)))
            log.flush()
            os.fsync(log.fileno())
    except OSError as error:
        raise StoreError(f"cannot lay out the store's log: {error.strerror}", place=Place(str(path))) from error


def delete_empty_log(path: Path) -> None:
    """Delete what SQLite leaves beside a store that was moved away; the writer still has its lock."""
    log = path.with_name(path.name + LOG)
    if not path.exists() and log.exists() and not log.stat().st_size:
        log.unlink()
        path.with_name(path.name + INDEX).unlink(missing_ok=True)


def _not_through_links(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NOFOLLOW)


@dataclass(frozen=True, slots=True)
class Kind:
    """What a file is known by, in SQLite's header.

    Attributes:
        name: in messages.
        application_id: says whose it is.
        form: number of its format.
    """

    name: str
    application_id: int
    form: int


STORE = Kind("knowledge store", APPLICATION_ID, FORMAT)


def require_own(path: Path, kind: Kind = STORE) -> None:
    """Raise `StoreError` unless the file is of that kind; SQLite's files beside it stay as they are.

    Opening somebody else's database in the usual way may already put its log into it. A file that SQLite calls
    malformed may be one into which the log is being put, or was when the process died; its log tells.
    """
    try:
        with closing(unlocked(path)) as connection:
            require_store(connection, path, kind)
    except sqlite3.DatabaseError as error:
        if getattr(error, "sqlite_errorcode", 0) & 0xFF != sqlite3.SQLITE_CORRUPT:
            raise


def require_store(connection: sqlite3.Connection, path: Path, kind: Kind = STORE) -> None:
    """Raise `StoreError` unless the file is a store of a format known here."""
    if _number(connection, "PRAGMA application_id") != kind.application_id:
        raise StoreError(f"this is a database, but no {kind.name}", place=Place(str(path)))
    form = _number(connection, "PRAGMA user_version")
    if form != kind.form:
        said = f"the {kind.name.split()[-1]} has format {form}, this program reads format {kind.form}"
        raise StoreError(said, place=Place(str(path)))


def _number(connection: sqlite3.Connection, statement: str) -> int:
    return int(connection.execute(statement).fetchone()[0])


def connect(path: Path, mode: str) -> sqlite3.Connection:
    """A connection without transactions of its own; `mode` as SQLite has it in the names of files."""
    uri = f"{path.absolute().as_uri()}?mode={mode}"
    return sqlite3.connect(uri, uri=True, isolation_level=None, check_same_thread=False, timeout=PATIENCE_S)
