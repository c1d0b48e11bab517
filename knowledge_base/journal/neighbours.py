"""The files that a store keeps beside itself, and the file that a name belongs to."""

from __future__ import annotations

import sqlite3
import stat
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path

ENDINGS = ("-wal", "-shm", "-journal", "-lock", "-world")
"""What the name of a store ends in for SQLite's log, its index and its older log, for our lock, and for the simulated
world of a run."""


def store_owning(path: Path, in_use: Iterable[Path] = ()) -> Path | None:
    """The store that a file is, or is kept beside, so that nothing else may be written there; `None` if it is free.

    Every SQLite file counts as a store. The file itself may be missing. Links are followed.

    Args:
        path: the file to be written.
        in_use: stores of this process, which may be missing yet.
    """
    try:
        stores = {store.resolve() for store in in_use}
        owner: Path | None = path.resolve()
        while owner is not None and owner not in stores and not is_database(owner):
            owner = _beside(owner)
    except (OSError, RuntimeError, ValueError):  # a name that no file has: too long, a null character, circular links
        return None
    return owner


def is_database(path: Path) -> bool:
    """Whether the file is an SQLite database, ours or not; nothing is created, changed or waited for.

    SQLite itself reads it: closing a file that this process has open as a store gives back SQLite's locks on it.
    """
    try:
        found = path.stat()
        if not (stat.S_ISREG(found.st_mode) and found.st_size):
            return False
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as connection:
            connection.execute("PRAGMA schema_version")
    except sqlite3.Error as error:
        return getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_CORRUPT
    except (OSError, ValueError):
        return False
    return True


def _beside(path: Path) -> Path | None:
    """The file that one of that name is kept beside."""
    for ending in ENDINGS:
        name = path.name.removesuffix(ending)
        if name not in ("", path.name):
            return path.with_name(name)
    return None
