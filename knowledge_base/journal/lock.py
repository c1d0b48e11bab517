"""One writer at a time: a lock that the operating system takes back from a process that dies."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
from typing import IO

from knowledge_base.errors import Place, StoreError


class WriterLock:
    """The right to write a store, from now until `release`.

    A file beside the store holds it and names the process; it goes with the lock. Not the store itself: SQLite's own
    locks on it would be lost whenever anyone in this process closed it.

    Raises:
        StoreError: somebody else writes, in this process or another, or the file cannot be made.
    """

    def __init__(self, store: Path) -> None:
        self._path = store.with_name(store.name + "-lock")
        self._file = self._locked(store)
        while not self._is_there():  # who had it took the file away between our opening and locking it
            self._file.close()
            self._file = self._locked(store)
        self._file.truncate(0)
        self._file.write(f"{os.getpid()}\n")
        self._file.flush()

    def release(self) -> None:
        """Let others write; repeating it is fine."""
        if not self._file.closed:
            if self._is_there():
                self._path.unlink()
            self._file.close()

    def _is_there(self) -> bool:
        """Whether the locked file is the one that others find."""
        try:
            return os.path.samestat(os.fstat(self._file.fileno()), self._path.stat())
        except FileNotFoundError:
            return False

    def _locked(self, store: Path) -> IO[str]:
        try:
            file = self._path.open("a+", encoding="ascii", errors="replace")
        except OSError as error:
            raise StoreError(f"cannot write '{self._path}': {error.strerror}", place=Place(str(store))) from None
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise _taken(store, file) from None
        return file


def _taken(store: Path, file: IO[str]) -> StoreError:
    with file:
        file.seek(0)
        process = file.readline().strip() or "unknown"
    return StoreError(
        f"another writer has it open (process {process}); it can be opened with read_only=True meanwhile",
        place=Place(str(store)),
    )
