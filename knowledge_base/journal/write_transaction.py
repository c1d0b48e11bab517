"""SQLite transactions of a store's writer: a block is written completely or not at all.

They are classes instead of generators, since every change and every macrostep of a kept run passes here.
"""

from __future__ import annotations

import os
import sqlite3
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from knowledge_base.errors import Place, StoreError
from knowledge_base.journal.checkpoints import CHECKPOINTS
from knowledge_base.journal.file import Durability, reported
from knowledge_base.journal.integrity import mark_open

TIDY_UP_AFTER = 500
"""Commits between checkpoints; SQLite's default is a thousand pages, and a commit takes one or two."""


class WriteTransaction:
    """A reusable context manager, one transaction at a time.

    Args:
        connection: the writer's connection.
        path: the store.
        durability: the events that a commit survives.
        token: identifies the writer; its first commit marks the store as open with it.

    Attributes:
        marked: whether the store is marked as open.

    Raises:
        StoreError: on entry or exit, the store cannot be written; nothing of the block is.
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
        self._cursor = connection.cursor()  # `Connection.execute` makes a new one each time
        self._commits = 0
        self._rows = 0  # rows written so far, at its beginning

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
            if self._connection.in_transaction:  # SQLite ends it itself when the disk is full
                self._connection.execute("ROLLBACK")
            if isinstance(error, sqlite3.Error):
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
            with suppress(sqlite3.Error):  # committed; a failed checkpoint runs later
                connection.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchall()
        self.marked = self.marked or changed


class TransactionGroup:
    """Several changes of the world in memory, written as one transaction; a reusable context manager.

    Args:
        transaction: the writer's transaction.
        place: the store, for errors.

    Attributes:
        open: whether a group is active.
        appended: whether a change is part of it.
        behind: the reason if the file lacks changes of the world in memory.

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
                self.behind = error if isinstance(error, StoreError) else StoreError(str(error) or type(error).__name__)

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
