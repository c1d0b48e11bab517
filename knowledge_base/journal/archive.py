"""The readers' side of a store file: each query opens the file separately, so that readers never block the writer."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, NoReturn

from knowledge_base.errors import ConflictError, Place, StoreError
from knowledge_base.exchange import FORM_ERRORS, delta_of, schema_of, world_of
from knowledge_base.facts import Change
from knowledge_base.journal.file import reading
from knowledge_base.journal.history import Version, Writer, gone, too_early
from knowledge_base.journal.integrity import (
    ENDS,
    NOTHING,
    Ends,
    Tip,
    damaged,
    link,
    require_link,
    require_own_log,
    require_sound,
    require_tables,
)
from knowledge_base.world.schema import Schema
from knowledge_base.world.schema_compatibility import require_extension
from knowledge_base.world.state import WorldState

TABLES = {
    "schemas": """CREATE TABLE schemas (version INTEGER NOT NULL, hash TEXT NOT NULL, declarations TEXT NOT NULL,
        digest BLOB NOT NULL)""",
    "changes": """CREATE TABLE changes (version INTEGER PRIMARY KEY, time REAL NOT NULL, author TEXT NOT NULL,
        delta TEXT NOT NULL, digest BLOB NOT NULL)""",
    "snapshots": """CREATE TABLE snapshots (version INTEGER PRIMARY KEY, time REAL NOT NULL, world TEXT NOT NULL,
        head BLOB NOT NULL, digest BLOB NOT NULL)""",
    "keys": """CREATE TABLE keys (number INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE, version INTEGER NOT NULL,
        time REAL NOT NULL, author TEXT NOT NULL, delta TEXT, context BLOB NOT NULL, digest BLOB NOT NULL)""",
    "ends": ENDS,
}
_JOURNAL = """SELECT version, time, author, delta, digest FROM changes WHERE version > ? AND version <= ?
    ORDER BY version"""
_LAST = "SELECT max(version) FROM (SELECT version FROM changes UNION ALL SELECT version FROM snapshots)"
_BOTH_THERE = "SELECT EXISTS (SELECT 1 FROM schemas) AND EXISTS (SELECT 1 FROM snapshots)"
_DIGEST_AT = """SELECT digest FROM changes WHERE version = :version
    UNION ALL SELECT head FROM snapshots WHERE version = :version"""
_KEYS = """SELECT number, key, version, keys.time, keys.author, coalesce(keys.delta, changes.delta), context,
    keys.digest, coalesce((SELECT digest FROM keys AS before WHERE before.number = keys.number - 1),
    (SELECT digest FROM ends WHERE chain = 'store'))
    FROM keys LEFT JOIN changes USING (version)"""
_TIPS = {
    "schemas": "SELECT rowid, digest FROM schemas ORDER BY rowid DESC LIMIT 1",
    "keys": "SELECT number, digest FROM keys ORDER BY number DESC LIMIT 1",
}
_SNAPSHOTS = "SELECT version, time, world, head, digest FROM snapshots"


class Archive:
    """A read-only `History` of a store; a writer may commit at the same time, in this process or another.

    Args:
        path: path of the store.
        schema: an extension of the store's own schema; `None` uses the store's schema.

    Raises:
        StoreError: the file is missing, damaged, unreadable, or is not a store.
        SchemaMismatchError: `schema` does not extend the schema in the store.
    """

    def __init__(self, path: Path, schema: Schema | None) -> None:
        self._path = path
        self._place = Place(str(path))
        with self._reading() as connection:
            self.require_whole(connection)
            written = self.written_schema(connection)
            self._written = self._schema_hash(connection)
        if schema is not None:
            require_extension(written, schema, self._place)
        self._schema = schema or written

    @property
    def schema(self) -> Schema:
        """The schema of the reader."""
        return self._schema

    def newest(self) -> Version:
        """Return the last committed world."""
        with self._reading() as connection:
            return self._world(connection, self._last(connection))

    @property
    def digest(self) -> bytes:
        """Digest of the newest version; the digest covers all versions before it."""
        with self._reading() as connection:
            return self._digest_at(connection, self._last(connection))

    def append(self, change: Change, key: str | None, before: WorldState, along: Writer | None) -> None:  # noqa: ARG002
        """Raise `ConflictError`: the history is read-only."""
        raise self._only_read()

    def together(self) -> AbstractContextManager[sqlite3.Connection]:
        """Raise `ConflictError`: the history is read-only."""
        raise self._only_read()

    def first(self, key: str) -> Change | None:
        """Return the change that was committed under that key, or `None`."""
        with self._reading() as connection:
            return self._by_key(connection, key)

    def changes(self, since: int, until: int) -> list[Change]:
        """Return the changes after version `since` up to and including version `until`."""
        with self._reading() as connection:
            return self._since(connection, since, until)

    def later(self, version: int) -> list[Change]:
        """Return the changes after `version` that the writer has committed."""
        with self._reading() as connection:
            if self._schema_hash(connection) != self._written:
                raise StoreError("the writer has extended the schema; open the store again", place=self._place)
            return self._since(connection, version, self._last(connection))

    def oldest(self) -> int:
        """Return the oldest version that is still kept."""
        with self._reading() as connection:
            return _oldest(connection)

    def state(self, version: int, newest: Callable[[], Version]) -> WorldState:  # noqa: ARG002  the file has it
        """Return the world of that version: a snapshot and the changes after it."""
        with self._reading() as connection:
            return self._world(connection, version).state

    def version_at(self, time: float) -> int:
        """Return the version that the world had at that time."""
        with self._reading() as connection:
            found = connection.execute(
                "SELECT version FROM changes WHERE time <= ? ORDER BY version DESC LIMIT 1", (time,)
            ).fetchone()
            oldest, last = _oldest(connection), self._last(connection)
            reached = oldest if found is None else int(found[0])
            for _ in self._changes(connection, max(oldest, reached - 1), min(last, reached + 1)):
                pass  # the iteration checks the digests of this change and the next, including their times
            if found is None and time < self._snapshot(connection, oldest)[1]:
                raise too_early(time, oldest, self._place)
            return reached

    def compact(self, keep_since: int, newest: Callable[[], Version]) -> None:  # noqa: ARG002
        """Raise `ConflictError`: the history is read-only."""
        raise self._only_read()

    def close(self) -> None:
        """Do nothing: no file stays open between queries."""

    def require_whole(self, connection: sqlite3.Connection) -> None:
        """Check that the store has its tables, and that its chains end at the tips in the table `ends`.

        Rows are checked when they are read. If the store has no record of a close, every page is checked. Such a file
        may be a copy made during a write, or the result of a crash.

        Raises:
            DamagedStoreError: the content differs from the written content.
        """
        require_tables(connection, self._path, TABLES)
        ends = Ends(connection, self._path)
        require_own_log(self._path, ends.identity)
        if not ends.closed:
            require_sound(connection, self._path)
        (parts,) = connection.execute(_BOTH_THERE).fetchone()
        if not parts:
            raise damaged(self._path, "its schema or its first world is gone")
        (first,) = connection.execute("SELECT min(version) FROM changes").fetchone()
        if first is not None and first != _oldest(connection) + 1:
            raise damaged(self._path, f"version {_oldest(connection) + 1} is missing")
        (keys, last) = connection.execute("SELECT count(*), coalesce(max(number), 0) FROM keys").fetchone()
        if keys != last:
            raise damaged(self._path, f"there are {keys} keys, and the last one is key {last}")
        if ends.closed:
            for chain, tip in self._tips(connection):
                ends.require(chain, tip)

    def require_all(self) -> int:
        """Read every row, and let SQLite check every page; the time is proportional to the size of the file.

        Returns:
            The newest version.

        Raises:
            DamagedStoreError: the content differs from the written content.
        """
        with self._reading() as connection:
            require_sound(connection, self._path)
            self.require_whole(connection)
            last = self._last(connection)
            for (version,) in connection.execute("SELECT version FROM snapshots").fetchall():
                state = self._snapshot_state(connection, version)[0]
                if version == _oldest(connection):
                    for change in self._changes(connection, version, last):
                        state.commit(change.delta)
            self.require_keys(connection)
        return last

    def require_keys(self, connection: sqlite3.Connection) -> None:
        """Raise `DamagedStoreError` if an idempotency key differs from the written key."""
        for row in connection.execute(f"{_KEYS} ORDER BY number"):
            self._key(row)

    def written_schema(self, connection: sqlite3.Connection) -> Schema:
        """Return the latest schema in the store."""
        digest, text = Ends(connection, self._path).identity, ""
        for number, row in enumerate(connection.execute("SELECT * FROM schemas ORDER BY rowid"), 1):
            version, name, text, found = row
            digest = require_link(self._path, f"schema {number}", found, (digest,), version, name, text)
        try:
            return schema_of(json.loads(text))
        except FORM_ERRORS as error:
            self._unreadable("the schema", error)

    def _only_read(self) -> ConflictError:
        return ConflictError(f"{self._place}: the store was opened with read_only=True and cannot be changed")

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        with reading(self._path) as connection:
            yield connection

    def _world(self, connection: sqlite3.Connection, version: int) -> Version:
        row = connection.execute(
            "SELECT version FROM snapshots WHERE version <= ? ORDER BY version DESC LIMIT 1", (version,)
        ).fetchone()
        if row is None:
            raise gone(version, _oldest(connection), self._place)
        reached = int(row[0])
        state, time = self._snapshot_state(connection, reached)
        try:
            for change in self._changes(connection, reached, version):
                state.commit(change.delta)
                reached, time = change.version, change.time
        except FORM_ERRORS as error:
            self._unreadable(f"the change to version {reached + 1}", error)
        return Version(state, reached, time)

    def _snapshot_state(self, connection: sqlite3.Connection, version: int) -> tuple[WorldState, float]:
        text, time = self._snapshot(connection, version)
        try:
            return world_of(json.loads(text), self._schema), time
        except FORM_ERRORS as error:
            self._unreadable(f"the snapshot of version {version}", error)

    def _snapshot(self, connection: sqlite3.Connection, version: int) -> tuple[str, float]:
        """Return the text of a snapshot, and its time."""
        _, time, text, head, digest = connection.execute(f"{_SNAPSHOTS} WHERE version = ?", (version,)).fetchone()
        name = f"the snapshot of version {version}"
        require_link(self._path, name, digest, (head, schema_at(connection, version)), version, time, text)
        made = connection.execute("SELECT digest FROM changes WHERE version = ?", (version,)).fetchone()
        if made is not None and made[0] != head:
            raise damaged(self._path, f"{name} does not belong here")
        return text, time

    def _tips(self, connection: sqlite3.Connection) -> Iterator[tuple[str, Tip]]:
        """Yield the tips of the chains of the knowledge base; other chains belong to other writers."""
        last = self._last(connection)
        yield "changes", Tip(last, self._digest_at(connection, last))
        for chain, question in _TIPS.items():
            yield chain, Tip(*(connection.execute(question).fetchone() or (0, NOTHING)))

    def _digest_at(self, connection: sqlite3.Connection, version: int) -> bytes:
        row = connection.execute(_DIGEST_AT, {"version": version}).fetchone()
        if row is None or not isinstance(row[0], bytes):
            raise damaged(self._path, f"version {version} is missing")
        return row[0]

    def _last(self, connection: sqlite3.Connection) -> int:
        return int(connection.execute(_LAST).fetchone()[0])

    def _schema_hash(self, connection: sqlite3.Connection) -> str:
        return str(connection.execute("SELECT hash FROM schemas ORDER BY rowid DESC LIMIT 1").fetchone()[0])

    def _since(self, connection: sqlite3.Connection, since: int, until: int) -> list[Change]:
        if since < (oldest := _oldest(connection)):
            raise gone(since, oldest, self._place)
        return list(self._changes(connection, since, until))

    def _changes(self, connection: sqlite3.Connection, since: int, until: int) -> Iterator[Change]:
        if since >= until:
            return
        expected, digest = since, self._digest_at(connection, since)
        (_, schema), *later = _schemas(connection)
        for version, time, author, text, found in connection.execute(_JOURNAL, (since, until)):
            expected += 1
            if version != expected:
                break
            while later and later[0][0] <= version:
                _, schema = later.pop(0)
            name = f"the change to version {version}"
            digest = require_link(self._path, name, found, (digest, schema), version, time, author, text)
            yield self._change((version, time, author, text))
        else:
            if expected == until:
                return
            expected += 1
        raise damaged(self._path, f"version {expected} is missing")

    def _by_key(self, connection: sqlite3.Connection, key: str) -> Change | None:
        row = connection.execute(f"{_KEYS} WHERE key = ?", (key,)).fetchone()
        return self._key(row) if row is not None else None

    def _key(self, row: Any) -> Change:
        """Return the change that was committed under a key."""
        number, key, version, time, author, delta, context, digest, before = row
        name = f"key {number} ('{key}')"
        change = link(context, version, time, author, delta) if isinstance(context, bytes) else None
        require_link(self._path, name, digest, (before, change), number, key, version, time, author)
        return self._change((version, time, author, delta))

    def _change(self, row: Any) -> Change:
        version, time, author, text = row
        try:
            return Change(version, author, delta_of(json.loads(text)), time)
        except FORM_ERRORS as error:
            self._unreadable(f"the change to version {version}", error)

    def _unreadable(self, what: str, error: Exception) -> NoReturn:
        raise damaged(self._path, f"{what} cannot be read") from error


def _oldest(connection: sqlite3.Connection) -> int:
    return int(connection.execute("SELECT min(version) FROM snapshots").fetchone()[0])


def _schemas(connection: sqlite3.Connection) -> list[tuple[int, bytes]]:
    """Return the first version of each schema, with its digest."""
    rows = connection.execute("SELECT version, digest FROM schemas WHERE typeof(digest) = 'blob' ORDER BY rowid")
    return [(version, digest) for version, digest in rows if isinstance(version, int)] or [(0, NOTHING)]


def schema_at(connection: sqlite3.Connection, version: int) -> bytes:
    """Return the digest of the schema under which that version was committed."""
    first, *later = _schemas(connection)
    return next((digest for since, digest in reversed(later) if since <= version), first[1])
