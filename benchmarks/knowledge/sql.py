"""SQLite in memory: a table for each kind, ordered by both ends; its module keeps statements prepared."""

import sqlite3
from collections.abc import Iterable

from knowledge.arcs import KINDS, Arc
from knowledge.contender import Answers, Contender

_INSERT = {kind: f"INSERT OR IGNORE INTO [{kind}] VALUES (?, ?)" for kind in KINDS}  # noqa: S608  fixed names


class Sql(Contender):
    """Each table consists of its primary key, with an index in the other direction."""

    name = "sqlite"

    @classmethod
    def version(cls) -> str:
        """Return the version of the SQLite library."""
        return sqlite3.sqlite_version

    def __init__(self) -> None:
        self.connection = sqlite3.connect(":memory:", isolation_level=None)
        for kind in KINDS:
            self.connection.execute(f"CREATE TABLE [{kind}] (a TEXT, b TEXT, PRIMARY KEY (a, b)) WITHOUT ROWID")
            self.connection.execute(f"CREATE INDEX [{kind}_back] ON [{kind}] (b, a)")

    def insert(self, things: Iterable[str], arcs: Iterable[Arc]) -> None:  # noqa: ARG002  rows are arcs
        by_kind: dict[str, list[tuple[str, str]]] = {}
        for kind, one, other in arcs:
            by_kind.setdefault(kind, []).append((one, other))
        self.connection.execute("BEGIN")
        for kind, rows in by_kind.items():
            self.connection.executemany(_INSERT[kind], rows)
        self.connection.execute("COMMIT")

    def point(self, item: str, place: str) -> bool:
        found = self.connection.execute("SELECT 1 FROM [on] WHERE a = ? AND b = ?", (item, place))
        return found.fetchone() is not None

    def pattern(self, place: str) -> Answers:
        return [{"x": x} for (x,) in self.connection.execute("SELECT a FROM [on] WHERE b = ?", (place,))]

    def rare(self, hall: str) -> Answers:
        return [{"x": x} for (x,) in self.connection.execute("SELECT a FROM [opens] WHERE b = ?", (hall,))]

    def inside(self, hall: str, item: str) -> Answers:
        text = "SELECT near.a FROM near JOIN [in] ON [in].a = near.a AND [in].b = ? WHERE near.b = ?"
        return [{"x": x} for (x,) in self.connection.execute(text, (hall, item))]

    def join(self, place: str) -> Answers:
        text = "SELECT near.a, near.b FROM [on] JOIN near ON near.a = [on].a WHERE [on].b = ?"
        return [{"x": x, "y": y} for x, y in self.connection.execute(text, (place,))]

    def move(self, item: str, old: str, new: str) -> None:
        self.connection.execute("UPDATE [on] SET b = ? WHERE a = ? AND b = ?", (new, item, old))


CONTENDER = Sql
