"""A world that survives a crash of the robot program, because a file keeps each action before its outcome is reported.

Several programs may act on one world; each of them first reads the actions of the others.
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
"""The kind and format of the file; files of format 1 have no format number and no application id."""
PATIENCE_MS = 5000
"""The milliseconds for which an action waits for the transaction of another program."""
_TABLES = (
    "CREATE TABLE world (state TEXT NOT NULL)",
    "CREATE TABLE done (action_id TEXT PRIMARY KEY, result TEXT NOT NULL)",
)


def beside(store: Path) -> Path:
    """Return the path of the file that keeps the world of the run in `store`.

    Raises:
        StoreError: see `located`.
    """
    place = located(store)
    return place.with_name(place.name + WORLD)


def require_free(path: Path) -> None:
    """Raise `StoreError` if the path leads to a file that is not the file of a world."""
    with _reported(path, "read"):
        if is_there(path):
            require_own(path, KIND)
            require_one_name(path)


class DurableWorld(TableWorld):
    """A world that is kept in a file, from `create` or `open` until `close`."""

    _file: sqlite3.Connection | None = None
    _seen = 0

    def create(self, path: Path) -> None:
        """Write this world to a file, and keep all later actions there; the file's earlier world is deleted.

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
        """Return the world that a file contains, and keep all later actions in the file.

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
        """Read the actions of other programs from the file, if there are any."""
        if self._file is not None and self._version() != self._seen:
            self._seen = self._version()
            self.become(_state(self._file))

    def executed(self, action_id: str, result: Result) -> None:
        """Write the result of an action and the world after it in one transaction."""
        super().executed(action_id, result)
        assert self._file is not None  # noqa: S101  `create` or `open` has set the file
        self._file.execute("BEGIN")
        self._file.execute("INSERT INTO done VALUES (?, ?)", (action_id, RESULT.dump_json(result).decode()))
        self._file.execute("UPDATE world SET state = ?", (self._present(),))
        self._file.execute("COMMIT")

    def close(self) -> None:
        """Close the file of the world, if there is one."""
        if self._file is not None:
            self._file.close()

    def _version(self) -> int:
        """Return SQLite's data version, which a commit of another program changes."""
        assert self._file is not None  # noqa: S101  `create` or `open` has set the file
        (version,) = self._file.execute("PRAGMA data_version").fetchone()
        return int(version)

    def _present(self) -> str:
        """Return the state without `done`, since the file has a separate table for it."""
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
