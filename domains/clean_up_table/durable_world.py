"""A world that survives the death of the robot's program: each action is in a file before its outcome is reported.

Several programs may act on the same world; each reads the actions of the others first.
"""

from __future__ import annotations

import json
import sqlite3
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Self

from domains.clean_up_table.observations import RESULT
from domains.clean_up_table.table_world import TableWorld
from knowledge_base.errors import Place, StoreError
from knowledge_base.journal.file import Kind, connect, is_there, located, new_database, require_one_name, require_own
from knowledge_base.journal.sidecar_files import WORLD

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from domains.clean_up_table.observations import Result

KIND = Kind("simulated world", 0x64736377, 2)
"""Format 1 had no number and no application id."""
PATIENCE_MS = 5000
"""Milliseconds that an action waits for another program's transaction."""
_TABLES = (
    "CREATE TABLE world (state TEXT NOT NULL)",
    "CREATE TABLE done (action_id TEXT PRIMARY KEY, result TEXT NOT NULL)",
)


def beside(store: Path) -> Path:
    """Return the path of the world of a run in that store.

    Raises:
        StoreError: as `located`.
    """
    place = located(store)
    return place.with_name(place.name + WORLD)


def require_free(path: Path) -> None:
    """Raise `StoreError` unless the path is free or holds another world."""
    with _reported(path, "read"):
        if is_there(path):
            require_own(path, KIND)
            require_one_name(path)


class DurableWorld(TableWorld):
    """A world in a file, from `create` or `open` until `close`."""

    _file: sqlite3.Connection | None = None
    _seen = 0

    def create(self, path: Path) -> None:
        """Write this world to a file and keep it there, instead of any world in that file.

        Raises:
            StoreError: the file is of another kind, or cannot be written.
        """
        require_free(path)
        with _reported(path, "write"):
            if not is_there(path):
                with new_database(path, KIND.application_id, KIND.form, lasting=False) as file:
                    for statement in _TABLES:
                        file.execute(statement)
            self._file = _opened(path)
            self._file.execute("BEGIN")
            self._file.execute("DELETE FROM world")
            self._file.execute("DELETE FROM done")
            self._file.execute("INSERT INTO world VALUES (?)", (self._present(),))
            self._file.execute("COMMIT")
            self._seen = self._version()

    @classmethod
    def open(cls, path: Path) -> Self:
        """Return the world in a file.

        Raises:
            StoreError: the file is missing, of another kind, or unreadable.
        """
        if not is_there(path):
            raise StoreError("the world of the run is missing", place=Place(str(path)))
        require_free(path)
        with _reported(path, "read"):
            file = _opened(path)
            try:
                lasting = cls.from_state(_state(file))
                lasting._file = file  # noqa: SLF001  an instance of the same class
                lasting._seen = lasting._version()  # noqa: SLF001
            except BaseException:
                file.close()
                raise
        return lasting

    def catch_up(self) -> None:
        """Read the actions of other programs."""
        if self._file is not None and self._version() != self._seen:
            self._seen = self._version()
            self.become(_state(self._file))

    def executed(self, action_id: str, result: Result) -> None:
        """Write the result of the action and the world after it in one transaction; each action is written once."""
        super().executed(action_id, result)
        assert self._file is not None  # noqa: S101  it was created or opened
        self._file.execute("BEGIN")
        self._file.execute("INSERT INTO done VALUES (?, ?)", (action_id, RESULT.dump_json(result).decode()))
        self._file.execute("UPDATE world SET state = ?", (self._present(),))
        self._file.execute("COMMIT")

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()

    def _version(self) -> int:
        """Return SQLite's data version, which another program's commit changes."""
        assert self._file is not None  # noqa: S101  as above
        (version,) = self._file.execute("PRAGMA data_version").fetchone()
        return int(version)

    def _present(self) -> str:
        """Return the state without `done`, which grows with each action."""
        return json.dumps({name: value for name, value in self.state().items() if name != "done"})


def _opened(path: Path) -> sqlite3.Connection:
    file = connect(path, "rw")
    file.execute(f"PRAGMA busy_timeout = {PATIENCE_MS}")
    return file


def _state(file: sqlite3.Connection) -> dict[str, Any]:
    (state,) = file.execute("SELECT state FROM world").fetchone()
    done = {action_id: json.loads(result) for action_id, result in file.execute("SELECT * FROM done")}
    return {**json.loads(state), "done": done}


@contextmanager
def _reported(path: Path, doing: str) -> Iterator[None]:
    try:
        yield
    except (sqlite3.Error, OSError) as error:
        raise StoreError(f"cannot {doing} the world: {error}", place=Place(str(path))) from error
