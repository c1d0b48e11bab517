"""The writer's side of a store file: each change is one SQLite transaction."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path

from knowledge_base.errors import ConflictError, InputError, Place, StoreError
from knowledge_base.exchange import compact, delta_form, schema_form, schema_hash, world_form
from knowledge_base.facts import Change
from knowledge_base.journal.archive import TABLES, Archive, schema_at
from knowledge_base.journal.file import APPLICATION_ID, FORMAT, Durability, is_there, new_database, reported
from knowledge_base.journal.history import Version, Writer
from knowledge_base.journal.integrity import (
    NOTHING,
    SIZE,
    STORE,
    Ends,
    Tip,
    link,
    mark_closed,
    put_ends,
    require_sound,
)
from knowledge_base.journal.sidecar_files import WriterLock, store_owning
from knowledge_base.journal.write_transaction import (
    CHECKPOINTS,
    TransactionGroup,
    WriteTransaction,
    delete_empty_log,
    lay_out_log,
    writing,
)
from knowledge_base.world.schema import Schema
from knowledge_base.world.schema_compatibility import missing_constants, require_extension, require_functional
from knowledge_base.world.state import WorldState

SNAPSHOT_AFTER = 2_000_000
"""Minimum number of characters of changes between two snapshots.

SQLite reads this number of characters in a fraction of a second. A snapshot of a longer world waits until the changes
have as many characters as that world. Snapshots therefore at most double the size of the file and the work.
"""

_INSERT_CHANGE = "INSERT INTO changes VALUES (?, ?, ?, ?, ?)"
_INSERT_KEY = "INSERT INTO keys VALUES (?, ?, ?, ?, ?, ?, ?, ?)"
_LAST_KEY = "SELECT number, digest FROM keys ORDER BY number DESC LIMIT 1"
_LAST_SCHEMA = "SELECT digest FROM schemas ORDER BY rowid DESC LIMIT 1"
_INSERT_SNAPSHOT = "INSERT OR IGNORE INTO snapshots VALUES (?, ?, ?, ?, ?)"
_LAST_SNAPSHOT = "SELECT version, length(world) FROM snapshots ORDER BY version DESC LIMIT 1"
_SIZE_SINCE = "SELECT coalesce(sum(length(delta)), 0) FROM changes WHERE version > ?"
_FORGET = (
    """UPDATE keys SET delta = (SELECT delta FROM changes WHERE changes.version = keys.version)
        WHERE delta IS NULL AND version <= :oldest""",
    "DELETE FROM changes WHERE version <= :oldest",
    "DELETE FROM snapshots WHERE version < :oldest",
)


class Journal(Archive):
    """A `History` in a file, with one writing process, and one writing thread at a time.

    Args:
        path: path of the store, which is created if it is missing.
        schema: the schema of a new store, or an extension of the store's own schema; `None` uses the store's schema.
        durability: the failures that a commit survives.
        clock: returns the time in seconds, for a change at the opening.
        new: whether the store must not exist yet.

    Raises:
        StoreError: another writer has the store open, or the file is not a store, or cannot be read or written.
        SchemaMismatchError: `schema` does not extend the schema in the store.
        InputError: neither a store nor a schema for a new store exists.
    """

    def __init__(
        self,
        path: Path,
        schema: Schema | None,
        durability: Durability,
        clock: Callable[[], float],
        *,
        new: bool,
    ) -> None:
        self._path = path
        if not is_there(path) and schema is None:
            raise _no_schema(path)
        self._place = Place(str(path))
        self._head = self._schema_digest = self._identity = NOTHING
        self._tail = self._snapshot_size = 0  # characters of the changes since the last snapshot, and of that snapshot
        self._durability = durability
        self._keys_checked = False
        self._writers = WriterLock(path)
        try:
            if new or not is_there(path):
                _make(path, schema, durability, clock())
            self._connection = writing(path, durability)
            self._token = os.urandom(SIZE)
            self._transaction = WriteTransaction(self._connection, path, durability, self._token)
            self._group = TransactionGroup(self._transaction, self._place)
            try:
                self._prepare(schema, clock)
                self._lay_out_log()
            except BaseException:
                self._connection.close()
                raise
        except BaseException:
            self._writers.release()
            raise

    def append(self, change: Change, key: str | None, before: WorldState, along: Writer | None) -> None:
        """Write a change, after a snapshot if many characters of changes were written since the last snapshot."""
        if not change.delta and key is None and along is None:
            return
        _require_text(change.author, key or "")
        if along is not None and not callable(along):
            raise InputError(f"`along` is a function of a connection, not {along!r}")
        delta = compact(delta_form(change.delta))
        time, context = float(change.time), self._head + self._schema_digest
        digest = link(context, change.version, time, change.author, delta)
        snapshot = None if self._tail < max(SNAPSHOT_AFTER, self._snapshot_size) else compact(world_form(before))
        with self._part() as connection:
            if snapshot is not None:
                self._put_snapshot(snapshot, change.version - bool(change.delta))  # the world before the change
            if change.delta:
                connection.execute(_INSERT_CHANGE, (change.version, time, change.author, delta, digest))
            if key is not None:
                number, previous = connection.execute(_LAST_KEY).fetchone() or (0, self._identity)
                said = (number + 1, key, change.version, time, change.author)
                kept = None if change.delta else delta
                connection.execute(_INSERT_KEY, (*said, kept, context, link(previous + digest, *said)))
            if along is not None:
                with _guard(connection):
                    along(connection)
        if snapshot is not None:
            self._tail, self._snapshot_size = 0, len(snapshot)
        self._tail += len(delta)
        if change.delta:
            self._head = digest

    def together(self) -> AbstractContextManager[sqlite3.Connection]:
        """Return a context manager for a block whose changes and own rows are one transaction."""
        return self._group

    def first(self, key: str) -> Change | None:
        """Return the change that was committed under that key, or `None`; only the writer may call this method."""
        _require_text(key)
        with reported(self._path, "read"):
            found = self._by_key(self._connection, key)
            if found is None and not self._keys_checked:  # a damaged key would be missed, and its change repeated
                self.require_keys(self._connection)
                self._keys_checked = True
            return found

    def later(self, version: int) -> list[Change]:
        """Raise `ConflictError`: this journal is the only writer."""
        raise ConflictError(f"{self._place}: version {version} is the newest, as this is the store's only writer")

    @property
    def digest(self) -> bytes:
        """Digest of the newest version; the digest covers all versions before it."""
        return self._head

    def compact(self, keep_since: int, newest: Callable[[], Version]) -> None:  # noqa: ARG002  the file has it
        """Make version `keep_since` the oldest version: its snapshot replaces all earlier rows."""
        with self._reading() as connection:
            require_sound(connection, self._path)  # the vacuum moves pages
            world = compact(world_form(self._world(connection, keep_since).state))
        with self._transaction as connection:
            self._put_snapshot(world, keep_since)
            for statement in _FORGET:
                connection.execute(statement, {"oldest": keep_since})
        CHECKPOINTS.leave(self._path)
        with reported(self._path, "shrink"):
            self._connection.executescript("PRAGMA incremental_vacuum")  # `execute` would release only one page
            self._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
            self._measure()
        self._lay_out_log()

    def close(self) -> None:
        """Close the store and release its lock; no sidecar file remains."""
        CHECKPOINTS.leave(self._path)
        self._end()
        moved = not self._transaction.is_in_place()
        if moved:  # SQLite runs the last checkpoint only on a file at its own path
            with suppress(sqlite3.Error):  # closed already
                self._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
        self._connection.close()
        if moved:
            delete_empty_log(self._path)
        self._writers.release()

    def _end(self) -> None:
        """Record the tips of the chains; after an error, the store is in the same state as after a crash."""
        if self._transaction.marked and self._group.behind is None:
            with suppress(StoreError), self._transaction as connection:
                if mark_closed(connection, self._token):
                    put_ends(connection, self._tips(connection))
        self._transaction.marked = False

    def _lay_out_log(self) -> None:
        if self._durability == "power":
            lay_out_log(self._path)

    def _prepare(self, schema: Schema | None, clock: Callable[[], float]) -> None:
        with reported(self._path, "read"):
            self.require_whole(self._connection)
            require_sound(self._connection, self._path, "keys")  # a missing key would be inserted again
            self._identity = Ends(self._connection, self._path).identity
            written = self.written_schema(self._connection)
            self._schema = schema or written
            (self._schema_digest,) = self._connection.execute(_LAST_SCHEMA).fetchone()
            self._head = self._digest_at(self._connection, self._last(self._connection))
            if schema_hash(self._schema) != schema_hash(written):
                self._extend(written, clock)
            self._measure()

    def _extend(self, written: Schema, clock: Callable[[], float]) -> None:
        """Extend the schema; a separate change adds the new constants to the world."""
        require_extension(written, self._schema, self._place)
        last = self.newest()
        require_functional(last.state, self._place)
        constants = missing_constants(last.state, self._place)
        row = (last.version + 1, max(last.time, float(clock())), "schema", compact(delta_form(constants)))
        with self._transaction as connection:
            schema = _put_schema(connection, self._schema, last.version + 1, self._schema_digest)
            head = self._head
            if constants:
                head = link(head + schema, *row)
                connection.execute(_INSERT_CHANGE, (*row, head))
        self._schema_digest, self._head = schema, head

    def _put_snapshot(self, world: str, version: int) -> None:
        """Insert the world of a version as a snapshot; do nothing if the version has one."""
        found = self._connection.execute("SELECT time, digest FROM changes WHERE version = ?", (version,)).fetchone()
        if found is not None:
            time, head = found
            _put_world(self._connection, version, time, world, head, schema_at(self._connection, version))

    def _measure(self) -> None:
        version, self._snapshot_size = self._connection.execute(_LAST_SNAPSHOT).fetchone()
        (self._tail,) = self._connection.execute(_SIZE_SINCE, (version,)).fetchone()

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        """Yield a connection to committed content.

        Inside a block of `together`, the connection also reads the changes of the block.
        """
        if self._group.open:
            with reported(self._path, "read"):
                yield self._connection
            return
        with super()._reading() as connection:
            yield connection

    @contextmanager
    def _part(self) -> Iterator[sqlite3.Connection]:
        """Yield a transaction for one change, or the open transaction of the group."""
        self._group.require_abreast()
        if not self._group.open:
            with self._transaction as connection:
                yield connection
            return
        self._group.appended = True
        try:
            with reported(self._path, "write"):
                yield self._connection
        except StoreError as error:
            self._group.behind = error
            raise


@contextmanager
def _guard(connection: sqlite3.Connection) -> Iterator[None]:
    """Refuse statements of the block that begin or end a transaction: they would commit a change in part."""
    refused = False

    def authorize(action: int, *_: str | None) -> int:
        nonlocal refused
        if action not in (sqlite3.SQLITE_TRANSACTION, sqlite3.SQLITE_SAVEPOINT):
            return sqlite3.SQLITE_OK
        refused = True
        return sqlite3.SQLITE_DENY

    connection.set_authorizer(authorize)
    try:
        yield
    except sqlite3.DatabaseError as error:
        if refused:
            raise StoreError("rows written along with a change neither begin nor end a transaction") from error
        raise
    finally:
        connection.set_authorizer(None)


def _no_schema(path: Path) -> InputError:
    return InputError(f"there is no store '{path}' yet; a new one needs a schema")


def _make(path: Path, schema: Schema | None, durability: Durability, time: float) -> None:
    """Create an empty store; the caller holds the writer lock of the store.

    Raises:
        StoreError: the store cannot be created; no file exists at the path.
        InputError: the schema is missing.
    """
    if schema is None:  # another process has just removed the store
        raise _no_schema(path)
    owner = store_owning(path)
    if owner not in (None, path):
        said = f"'{path.name}' is the name of a sidecar file of the store '{owner}'"
        raise StoreError(said, place=Place(str(path)))
    lasting = durability == "power"
    try:
        with reported(path, "make"), new_database(path, APPLICATION_ID, FORMAT, lasting=lasting) as connection:
            for statement in TABLES.values():
                connection.execute(statement)
            identity = os.urandom(SIZE)  # no row of another store matches this identity
            first = _put_schema(connection, schema, 0, identity)
            _put_world(connection, 0, float(time), compact(world_form(WorldState(schema))), identity, first)
            tips = {"changes": Tip(0, identity), "schemas": Tip(1, first), "keys": Tip(0, NOTHING)}
            put_ends(connection, (tips | {STORE: Tip(1, identity)}).items())
    except FileExistsError:
        said = f"'{path.name}' is there already; a new store replaces no file"
        raise StoreError(said, place=Place(str(path))) from None
    except OSError as error:
        raise StoreError(f"cannot make the store '{path}': {error.strerror}") from error


def _put_schema(connection: sqlite3.Connection, schema: Schema, version: int, before: bytes) -> bytes:
    """Insert a schema after the schema with the digest `before`; return its digest."""
    row = (version, schema_hash(schema), compact(schema_form(schema)))
    digest = link(before, *row)
    connection.execute("INSERT INTO schemas VALUES (?, ?, ?, ?)", (*row, digest))
    return digest


def _put_world(
    connection: sqlite3.Connection, version: int, time: float, world: str, head: bytes, schema: bytes
) -> None:
    digest = link(head + schema, version, time, world)
    connection.execute(_INSERT_SNAPSHOT, (version, time, world, head, digest))


def _require_text(*words: str) -> None:
    for word in words:
        if not word.isascii():
            try:
                word.encode()
            except UnicodeEncodeError:
                raise InputError(f"{word!r} is not a text that can be written to a file") from None
