"""A world that goes on when the robot's program dies: each executed action is in a file before anybody hears of it.

There is one world, however many programs believe that the robot is theirs: what another one did in it is read first.
"""

from __future__ import annotations

import json
import sqlite3
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Self

from domains.clean_up_table.table_world import TableWorld
from knowledge_base.errors import Place, StoreError
from knowledge_base.journal.atomic_files import new_database
from knowledge_base.journal.file import Kind, connect, is_there, located, require_one_name, require_own
from knowledge_base.journal.sidecar_files import WORLD

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from domains.clean_up_table.results import Result

KIND = Kind("simulated world", 0x64736377, 2)
"""The first format had no number, and nothing that says whose file it is."""
PATIENCE_MS = 5000
"""How long an action waits for those of another program."""
_TABLES = (
    "CREATE TABLE world (state TEXT NOT NULL)",
    "CREATE TABLE done (action_id TEXT PRIMARY KEY, result TEXT NOT NULL)",
)


def beside(store: Path) -> Path:
    """Where the world of the run in that store is kept; raises `StoreError` as `located`."""
    place = located(store)
    return place.with_name(place.name + WORLD)


def require_free(path: Path) -> None:
    """Raise `StoreError` unless a world can be kept there: no file is there, or that of another world."""
    with _reported(path, "read"):
        if is_there(path):
            require_own(path, KIND)
            require_one_name(path)


class DurableWorld(TableWorld):
    """A world in a file, from when `create` or `open` is called until `close`."""

    _file: sqlite3.Connection | None = None
    _seen = 0

    def create(self, path: Path) -> None:
        """Keep this world in a file from now on, in the place of the world that is there; raises `StoreError`."""
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
        """The world as it was left; raises `StoreError`."""
        if not is_there(path):
            raise StoreError("the world of the run is not there", place=Place(str(path)))
        require_free(path)
        with _reported(path, "read"):
            file = _opened(path)
            try:
                lasting = cls.from_state(_state(file))
                lasting._file = file  # noqa: SLF001  of its own class
                lasting._seen = lasting._version()  # noqa: SLF001
            except BaseException:
                file.close()
                raise
        return lasting

    def catch_up(self) -> None:
        """Take in what was done through another program."""
        if self._file is not None and self._version() != self._seen:
            self._seen = self._version()
            self.become(_state(self._file))

    def executed(self, action_id: str, result: Result) -> None:
        """Write what became of the action, and the world after it, as one; no action is written twice."""
        super().executed(action_id, result)
        assert self._file is not None  # noqa: S101  it was created or opened
        self._file.execute("BEGIN")
        self._file.execute("INSERT INTO done VALUES (?, ?)", (action_id, json.dumps(result.to_json())))
        self._file.execute("UPDATE world SET state = ?", (self._present(),))
        self._file.execute("COMMIT")

    def close(self) -> None:
        """Give back the file."""
        if self._file is not None:
            self._file.close()

    def _version(self) -> int:
        """It is another one after somebody else has written the file."""
        assert self._file is not None  # noqa: S101  as above
        (version,) = self._file.execute("PRAGMA data_version").fetchone()
        return int(version)

    def _present(self) -> str:
        """Everything but what was done, of which there is ever more."""
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
