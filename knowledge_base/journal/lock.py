"""One writer at a time: a lock that the operating system takes back from a process that dies."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from knowledge_base.errors import Place, StoreError


class WriterLock:
    """The right to write a store, from now until `release`.

    A file beside the store holds it and names the process. Not the store itself: SQLite's own locks on it
    would be lost whenever anyone in this process closed it.

    Raises:
        StoreError: somebody else writes, in this process or another, or the file cannot be made.
    """

    def __init__(self, store: Path) -> None:
        path = store.with_name(store.name + "-lock")
        try:
            self._file = path.open("a+", encoding="ascii", errors="replace")
        except OSError as error:
            raise StoreError(f"cannot write '{path}': {error.strerror}", place=Place(str(store))) from None
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise self._taken(store) from None
        self._file.truncate(0)
        self._file.write(f"{os.getpid()}\n")
        self._file.flush()

    def release(self) -> None:
        """Let others write."""
        self._file.close()

    def _taken(self, store: Path) -> StoreError:
        with self._file as file:
            file.seek(0)
            process = file.readline().strip() or "unknown"
        return StoreError(
            f"another writer has it open (process {process}); it can be opened with read_only=True meanwhile",
            place=Place(str(store)),
        )
