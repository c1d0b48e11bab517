"""One writer at a time: a lock that the operating system releases when its process dies."""

from __future__ import annotations

import fcntl
import os
import re
from pathlib import Path

from knowledge_base.errors import Place, StoreError
from knowledge_base.journal.atomic_files import place
from knowledge_base.journal.sidecar_files import LOCK, foreign, open_own

_MARK = re.compile(rb"dsc writer +(\d+)\n")
"""The content of a lock file, always of the same length; a lock file is never empty."""


class WriterLock:
    """The right to write a store, from now until `release`.

    A sidecar file holds the lock and names the process; `release` deletes it. The store file cannot hold it, since
    closing it in any thread would drop SQLite's own locks. A file of that name that is not a lock stays unchanged.

    Raises:
        StoreError: another writer has the store open, in this process or another, or the lock file cannot be made.
    """

    def __init__(self, store: Path) -> None:
        self._store = store
        self._path = store.with_name(store.name + LOCK)
        self._released = False
        self._file = self._locked()
        while not self._is_there():  # its owner deleted the file between open and lock
            os.close(self._file)
            self._file = self._locked()
        os.pwrite(self._file, _mark(), 0)

    def release(self) -> None:
        """Release the lock and delete its file; further calls do nothing."""
        if not self._released:
            self._released = True
            if self._is_there():
                self._path.unlink()
            os.close(self._file)

    def _is_there(self) -> bool:
        """Return whether the locked file is still the one at the path."""
        try:
            return os.path.samestat(os.fstat(self._file), self._path.lstat())
        except FileNotFoundError:
            return False

    def _locked(self) -> int:
        while True:
            try:
                return self._found()
            except FileNotFoundError:
                pass  # there was no writer, or it has just left
            try:
                return place(self._path, _mark(), locked=True)
            except FileExistsError:
                continue  # another writer was faster
            except OSError as error:
                said = f"cannot write '{self._path}': {error.strerror}"
                raise StoreError(said, place=Place(str(self._store))) from None

    def _found(self) -> int:
        """Return the locked descriptor of the existing file.

        Raises:
            FileNotFoundError: there is no lock file.
            StoreError: as for the class.
        """
        file = open_own(self._path, self._store)
        try:
            process = self._process(file)
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise _taken(self._store, process) from None
        except BaseException:
            os.close(file)
            raise
        return file

    def _process(self, file: int) -> str:
        """Return the process number in the file."""
        found = _MARK.fullmatch(os.pread(file, 2 * len(_mark()), 0))
        if found is None:
            raise foreign(self._path, self._store, "is not the lock of a store")
        return found[1].decode()


def _mark() -> bytes:
    return b"dsc writer %20d\n" % os.getpid()


def _taken(store: Path, process: str) -> StoreError:
    return StoreError(
        f"another writer has it open (process {process}); it can be opened with read_only=True meanwhile",
        place=Place(str(store)),
    )
