"""The past as a store's file tells it; each question opens the file, so that nobody who writes has to wait."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, NoReturn

from knowledge_base.errors import ConflictError, Place, StoreError
from knowledge_base.exchange.forms import FORM_ERRORS, delta_of, schema_of, world_of
from knowledge_base.facts import Change
from knowledge_base.journal.file import reading
from knowledge_base.journal.history import Version, Writer, gone, too_early
from knowledge_base.world.compatibility import require_extension
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

_JOURNAL = "SELECT version, time, author, delta FROM changes WHERE version > ? AND version <= ? ORDER BY version"
_LAST = "SELECT max(version) FROM (SELECT version FROM changes UNION ALL SELECT version FROM snapshots)"
_BOTH_THERE = "SELECT EXISTS (SELECT 1 FROM schemas) AND EXISTS (SELECT 1 FROM snapshots)"
_BY_KEY = (
    "SELECT version, keys.time, keys.author, coalesce(keys.delta, changes.delta) "
    "FROM keys LEFT JOIN changes USING (version) WHERE key = ?"
)


class Archive:
    """A `History` that is only read; a writer may go on meanwhile, here or elsewhere.

    Args:
        path: the store.
        schema: an extension of the store's own, which is taken when it is `None`.

    Raises:
        StoreError: the file is not there, not a store, or cannot be read.
        SchemaMismatchError: the store was written with a schema that `schema` does not extend.
    """

    def __init__(self, path: Path, schema: Schema | None) -> None:
        self._path = path
        self._place = Place(str(path))
        with self._reading() as connection:
            written = self.written_schema(connection)
            self._written = self._schema_hash(connection)
        if schema is not None:
            require_extension(written, schema, self._place)
        self._schema = schema or written

    @property
    def schema(self) -> Schema:
        """With which it is read."""
        return self._schema

    def newest(self) -> Version:
        """The last world that was committed."""
        with self._reading() as connection:
            return self._world(connection, self._last(connection))

    def append(self, change: Change, key: str | None, before: WorldState, along: Writer | None) -> None:  # noqa: ARG002
        """Refused.

        Raises:
            ConflictError: always.
        """
        raise self._only_read()

    def together(self) -> AbstractContextManager[sqlite3.Connection]:
        """Refused.

        Raises:
            ConflictError: always.
        """
        raise self._only_read()

    def first(self, key: str) -> Change | None:
        """The change that was kept under that key."""
        with self._reading() as connection:
            return self._by_key(connection, key)

    def changes(self, since: int, until: int) -> list[Change]:
        """The changes after version `since`, up to that which made version `until`."""
        with self._reading() as connection:
            return self._since(connection, since, until)

    def later(self, version: int) -> list[Change]:
        """What the writer has committed after `version`."""
        with self._reading() as connection:
            if self._schema_hash(connection) != self._written:
                raise StoreError("the writer has a longer schema now; open the store anew", place=self._place)
            return self._since(connection, version, self._last(connection))

    def oldest(self) -> int:
        """The first version that is still kept."""
        with self._reading() as connection:
            return _oldest(connection)

    def state(self, version: int, newest: Callable[[], Version]) -> WorldState:  # noqa: ARG002  the file knows
        """The world of that version: a snapshot and the changes after it."""
        with self._reading() as connection:
            return self._world(connection, version).state

    def version_at(self, time: float) -> int:
        """The version that the world had at that time."""
        with self._reading() as connection:
            found = connection.execute(
                "SELECT version FROM changes WHERE time <= ? ORDER BY version DESC LIMIT 1", (time,)
            ).fetchone()
            if found is not None:
                return int(found[0])
            oldest, begin = connection.execute("SELECT min(version), time FROM snapshots").fetchone()
            if time < begin:
                raise too_early(time, oldest, self._place)
            return int(oldest)

    def compact(self, keep_since: int, newest: Callable[[], Version]) -> None:  # noqa: ARG002
        """Refused.

        Raises:
            ConflictError: always.
        """
        raise self._only_read()

    def close(self) -> None:
        """Nothing is kept open."""

    def written_schema(self, connection: sqlite3.Connection) -> Schema:
        """The schema that the store has now."""
        (parts,) = connection.execute(_BOTH_THERE).fetchone()
        if not parts:
            raise StoreError("the store is damaged: its schema or its first world is gone", place=self._place)
        (text,) = connection.execute("SELECT declarations FROM schemas ORDER BY rowid DESC LIMIT 1").fetchone()
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
        snapshot = connection.execute(
            "SELECT version, time, world FROM snapshots WHERE version <= ? ORDER BY version DESC LIMIT 1", (version,)
        ).fetchone()
        if snapshot is None:
            raise gone(version, _oldest(connection), self._place)
        reached, time, text = snapshot
        try:
            state = world_of(json.loads(text), self._schema)
            for change in self._changes(connection, reached, version):
                state.commit(change.delta)
                reached, time = change.version, change.time
        except FORM_ERRORS as error:
            self._unreadable(f"what follows version {reached}", error)
        return Version(state, reached, time)

    def _last(self, connection: sqlite3.Connection) -> int:
        return int(connection.execute(_LAST).fetchone()[0])

    def _schema_hash(self, connection: sqlite3.Connection) -> str:
        return str(connection.execute("SELECT hash FROM schemas ORDER BY rowid DESC LIMIT 1").fetchone()[0])

    def _since(self, connection: sqlite3.Connection, since: int, until: int) -> list[Change]:
        if since < (oldest := _oldest(connection)):
            raise gone(since, oldest, self._place)
        return list(self._changes(connection, since, until))

    def _changes(self, connection: sqlite3.Connection, since: int, until: int) -> Iterator[Change]:
        expected = since
        for row in connection.execute(_JOURNAL, (since, until)):
            expected += 1
            if row[0] != expected:
                break
            yield self._change(row)
        else:
            if expected == until:
                return
            expected += 1
        raise StoreError(f"the store is damaged: version {expected} is missing", place=self._place)

    def _by_key(self, connection: sqlite3.Connection, key: str) -> Change | None:
        row = connection.execute(_BY_KEY, (key,)).fetchone()
        return self._change(row) if row is not None else None

    def _change(self, row: Any) -> Change:
        version, time, author, text = row
        try:
            return Change(version, author, delta_of(json.loads(text)), time)
        except FORM_ERRORS as error:
            self._unreadable(f"the change to version {version}", error)

    def _unreadable(self, what: str, error: Exception) -> NoReturn:
        raise StoreError(f"the store is damaged: {what} cannot be read", place=self._place) from error


def _oldest(connection: sqlite3.Connection) -> int:
    return int(connection.execute("SELECT min(version) FROM snapshots").fetchone()[0])
