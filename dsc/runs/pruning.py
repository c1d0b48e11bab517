"""Pruning of a store: the oldest runs are deleted, and the later ones stay verifiable and resumable."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from sqlite3 import Connection

from dsc.runs.archive import Pruned, RunRow, archive
from knowledge_base.errors import InputError
from knowledge_base.store import KnowledgeBase
from knowledge_base.user_objects import shown

_SEAL = "SELECT seal FROM runs WHERE run = ?"
_NAMES_PLOTS = (
    "SELECT plots || arguments || header FROM runs",
    "SELECT message || change FROM steps",
)
_HASH = re.compile(r"\b[0-9a-f]{64}\b")


def prune(knowledge: KnowledgeBase, path: Path, keep: int) -> int:
    """Delete all but the latest `keep` runs of a store, and return the number of deleted runs.

    Their macrosteps, their plots, and the versions of the knowledge before the first kept run are deleted, too. Action
    ids stay unique. The file becomes smaller.

    Args:
        knowledge: the knowledge base, opened at `path` for writing.
        path: the file of the knowledge base.
        keep: the number of runs to keep, at least 1; an unfinished run counts.

    Raises:
        InputError: `keep` is not a positive integer.
        StoreError: the store has no runs, or cannot be read or written.
    """
    if isinstance(keep, bool) or not isinstance(keep, int) or keep < 1:
        raise InputError(f"`keep` is the number of runs to keep, at least 1, not {shown(keep)}")
    with archive(path, again=True) as runs:
        rows = runs.runs()
        gone, kept = rows[:-keep], rows[-keep:]
        serials = runs.last(gone[-1].number).serials if gone else 0
    if gone:
        with knowledge.together() as connection:
            _delete(connection, gone[-1], serials)
    if kept:
        knowledge.compact(kept[0].version)
    return len(gone)


def _delete(connection: Connection, last: RunRow, serials: int) -> None:
    (seal,) = connection.execute(_SEAL, (last.number,)).fetchone()
    Pruned(last.number, last.last, serials, seal).write(connection)
    connection.execute("DELETE FROM steps WHERE place <= ?", (last.last,))
    connection.execute("DELETE FROM runs WHERE run <= ?", (last.number,))
    needed = {one for query in _NAMES_PLOTS for (text,) in connection.execute(query) for one in _HASH.findall(text)}
    unused = _hashes(connection) - needed
    connection.executemany("DELETE FROM forms WHERE hash = ?", [(one,) for one in unused])


def _hashes(connection: Connection) -> set[str]:
    rows: Iterable[tuple[str]] = connection.execute("SELECT hash FROM forms")
    return {one for (one,) in rows}
