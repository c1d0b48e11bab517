"""Transactions of a store's writer: a block is written completely or not at all.

The context managers here are classes, which are faster than generators. Every change and every macrostep of a kept run
uses these context managers.

A thread moves committed pages from SQLite's log into the store file (SQLite's `checkpoint`). A checkpoint waits for the
disk twice, which would delay commits: of 1,000 commits the slowest takes 0.4 ms with the thread, 3.6 ms without it (on
an SSD). One thread serves all stores of the process in turn, with pauses, so that the disk has time for commits.

SQLite from 3.7.0 to 3.51.2 (except 3.44.6 and 3.50.7) may lose commits; see https://www.sqlite.org/wal.html#walresetbug
for the details. The error requires a completed checkpoint, a second checkpoint soon after the first, and a commit that
restarts the log during the second checkpoint. A later checkpoint may then skip committed pages. The thread therefore
accepts a request only together with a commit that left pages in the log. A caller must call `leave` before its own
checkpoint.
"""

from __future__ import annotations

import os
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from threading import Condition, Thread
from types import TracebackType

from knowledge_base.errors import Place, StoreError
from knowledge_base.journal.file import Durability, connect, reported, require_one_name, require_own, require_store
from knowledge_base.journal.integrity import mark_open
from knowledge_base.journal.sidecar_files import INDEX, LOG
from knowledge_base.user_objects import described, has_type

TIDY_UP_AFTER = 500
"""Number of commits between checkpoints.

SQLite's default is a thousand pages, and a commit writes one or two pages.
"""
MOST_IN_LOG = 4000
"""Number of pages in the log after which the writer runs the checkpoint itself.

The commits then leave the thread no time for checkpoints.
"""
MOST_ASKED = 8
"""Number of requests after which the writer runs the checkpoint itself."""
PAUSE = 1.0
"""Duration of the thread's pause, as a multiple of its last working time."""
_PAGES_IN_LOG = {"process": 0, "power": 1000}
"""Number of pages (4 KiB) in SQLite's log after which a commit runs a checkpoint; with 0, a thread runs it."""
_LOG_LENGTH = (_PAGES_IN_LOG["power"] + 24) * (4096 + 24)  # a frame is a page and its header; commits may be longer
_SYNCHRONOUS = {"process": "NORMAL", "power": "FULL"}  # in WAL mode, only FULL waits for the disk in each commit


def writing(path: Path, durability: Durability) -> sqlite3.Connection:
    """Return a connection for writing.

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


class WriteTransaction:
    """A reusable context manager for one transaction at a time.

    Args:
        connection: the writer's connection.
        path: the store.
        durability: the failures that a commit survives.
        token: identifies the writer; the first commit marks the store as open with this token.

    Attributes:
        marked: whether the store is marked as open.

    Raises:
        StoreError: on entry or exit, the store cannot be written; nothing of the block is written.
    """

    def __init__(self, connection: sqlite3.Connection, path: Path, durability: Durability, token: bytes) -> None:
        self.marked = False
        self._token = token
        self._connection = connection
        self._path = path
        self._durability = durability
        self._name = str(path)  # faster than a `Path`
        found = os.stat(self._name)  # noqa: PTH116
        self._file = found.st_dev, found.st_ino
        self._cursor = connection.cursor()  # `Connection.execute` creates a new cursor each time
        self._commits = 0
        self._rows = 0  # number of rows written before the transaction

    def __enter__(self) -> sqlite3.Connection:
        self._rows = self._connection.total_changes
        if not self.is_in_place():
            raise StoreError("the store was moved or deleted while it is open", place=Place(self._name))
        try:
            self._cursor.execute("BEGIN IMMEDIATE")
        except BaseException as error:
            self._roll_back(error)
            raise
        return self._connection

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if error is not None:
            self._roll_back(error)
            return
        try:
            self._commit()
        except BaseException as failed:
            self._roll_back(failed)
            raise

    def is_in_place(self) -> bool:
        """Return whether the file is still at its path; otherwise a restart would not find a commit."""
        try:
            found = os.stat(self._name)  # noqa: PTH116
        except OSError:
            return False
        return (found.st_dev, found.st_ino) == self._file

    def _roll_back(self, error: BaseException) -> None:
        with reported(self._path, "write"):
            if self._connection.in_transaction:  # SQLite ends the transaction itself when the disk is full
                self._connection.execute("ROLLBACK")
            if has_type(error, sqlite3.Error):
                raise error

    def _commit(self) -> None:
        connection = self._connection
        changed = connection.total_changes != self._rows
        self._commits += changed
        if changed and not self.marked:
            mark_open(connection, self._token)
        if self._durability == "power" or not changed or self._commits % TIDY_UP_AFTER:
            self._cursor.execute("COMMIT")
        elif not CHECKPOINTS.is_behind(self._path):
            with CHECKPOINTS.asking(self._path):
                self._cursor.execute("COMMIT")
        else:
            self._cursor.execute("COMMIT")
            CHECKPOINTS.leave(self._path)
            with suppress(sqlite3.Error):  # the commit is complete; a failed checkpoint runs later
                connection.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchall()
        self.marked = self.marked or changed


class TransactionGroup:
    """A reusable context manager that writes several changes of the world in memory as one transaction.

    Args:
        transaction: the writer's transaction.
        place: the place of the store, for errors.

    Attributes:
        open: whether a group is active.
        appended: whether the group contains a change.
        behind: the error that left the file without changes of the world in memory, or `None`.

    Raises:
        StoreError: on entry, the file lacks changes; on exit, the group cannot be written.
    """

    def __init__(self, transaction: WriteTransaction, place: Place) -> None:
        self.open = self.appended = False
        self.behind: StoreError | None = None
        self._transaction = transaction
        self._place = place

    def __enter__(self) -> sqlite3.Connection:
        self.require_abreast()
        connection = self._transaction.__enter__()
        self.open, self.appended = True, False
        return connection

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.open = False
        try:
            if error is None and self.behind is not None:
                self._require_parts()
            self._transaction.__exit__(kind, error, at)
        except BaseException as failed:
            error = failed
            raise
        finally:
            if error is not None and self.appended and self.behind is None:
                self.behind = error if has_type(error, StoreError) else StoreError(described(error, named=False))

    def require_abreast(self) -> None:
        """Raise `StoreError` if the file lacks changes of the world in memory."""
        if self.behind is not None:
            message = f"the store lacks the last changes, open it again: {self.behind.message}"
            raise StoreError(message, place=self._place)

    def _require_parts(self) -> None:
        """Roll back all changes if one of them failed."""
        try:
            self.require_abreast()
        except StoreError as error:
            self._transaction.__exit__(StoreError, error, None)
            raise


class Checkpoints:
    """Queue of the stores that wait for a checkpoint; its thread exists only while a store waits."""

    def __init__(self) -> None:
        self._begin()
        os.register_at_fork(after_in_child=self._begin)  # threads do not survive a fork

    def _begin(self) -> None:
        self._changed = Condition()
        self._waiting: dict[Path, int] = {}  # number of requests
        self._pages: dict[Path, int] = {}  # number of pages in the log at its last checkpoint
        self._writing: Path | None = None
        self._thread: Thread | None = None

    @contextmanager
    def asking(self, path: Path) -> Iterator[None]:
        """Request a checkpoint of the store if the commit in the block succeeds; the store must be open for writing."""
        with self._changed:  # no checkpoint begins during the block
            yield
            if self._writing == path:
                return
            self._waiting[path] = self._waiting.get(path, 0) + 1
            if self._thread is None or not self._thread.is_alive():
                self._thread = _start(self._run)

    def is_behind(self, path: Path) -> bool:
        """Return whether the writer should run the checkpoint itself."""
        with self._changed:
            return self._waiting.get(path, 0) >= MOST_ASKED or self._pages.get(path, 0) > MOST_IN_LOG

    def leave(self, path: Path) -> None:
        """Cancel the requests for the store, and wait until no checkpoint of the store runs."""
        with self._changed:
            self._waiting.pop(path, None)
            self._changed.wait_for(lambda: self._writing != path)
            self._pages.pop(path, None)

    def settle(self) -> None:
        """Wait until no request is pending."""
        with self._changed:
            self._changed.wait_for(lambda: self._writing is None and not self._waiting)

    def _run(self) -> None:
        while (path := self._next()) is not None:
            began, pages = time.monotonic(), 0
            try:
                pages = _tidy_up(path)
            finally:
                with self._changed:
                    self._pages[path] = pages
                    self._writing = None
                    self._changed.notify_all()
            time.sleep(PAUSE * (time.monotonic() - began))

    def _next(self) -> Path | None:
        with self._changed:
            if not self._waiting:
                self._thread = None
                return None
            self._writing = next(iter(self._waiting))
            del self._waiting[self._writing]
            return self._writing


def _start(work: Callable[[], None]) -> Thread | None:
    """Return the started thread, or `None` if the system cannot start one.

    The writer then runs a checkpoint itself after `MOST_ASKED` requests.
    """
    thread = Thread(target=work, name="checkpoints", daemon=True)
    with suppress(RuntimeError):
        thread.start()
        return thread
    return None


def _tidy_up(path: Path) -> int:
    """Run a checkpoint; return the number of pages in the log.

    Blocked pages stay in the log, where SQLite reads them.
    """
    with suppress(sqlite3.Error), closing(to_tidy_up(path)) as connection:
        _, pages, _ = connection.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()
        return int(pages)
    return 0


def to_tidy_up(path: Path) -> sqlite3.Connection:
    """Return a second connection to an open store, for a checkpoint.

    Raises:
        sqlite3.Error: the connection cannot be opened.
    """
    connection = connect(path, "rw")
    connection.execute("PRAGMA synchronous = NORMAL")  # else SQLite could reset the log before the file is on the disk
    return connection


CHECKPOINTS = Checkpoints()
"""The instance of this process."""


def lay_out_log(path: Path) -> None:
    """Extend SQLite's log to its final length; the connection of the writer must be open.

    If the file grows, each wait for the disk is longer and depends on other writers, since the new length must be
    stored too: by 10 % in the mean on an SSD. SQLite ignores content after the last commit; zeros are never a commit.

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
    """Delete the sidecar files that SQLite leaves at the old path of a moved store.

    The caller must hold the writer lock.
    """
    log = path.with_name(path.name + LOG)
    if not path.exists() and log.exists() and not log.stat().st_size:
        log.unlink()
        path.with_name(path.name + INDEX).unlink(missing_ok=True)


def _not_through_links(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NOFOLLOW)
