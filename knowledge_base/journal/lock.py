"""One writer at a time: a lock that the operating system takes back from a process that dies."""

from __future__ import annotations

import fcntl
import os
import re
from pathlib import Path

from knowledge_base.errors import Place, StoreError
from knowledge_base.journal.atomic_files import place
from knowledge_base.journal.sidecar_files import LOCK, foreign, open_own

_MARK = re.compile(rb"dsc writer +(\d+)\n")
"""The content of a lock file, always of the same length; there is never one without it."""


class WriterLock:
    """The right to write a store, from now until `release`.

    A file beside the store holds it and names the process; it goes with the lock. Not the store itself: SQLite's own
    locks on it would be lost whenever anyone in this process closed it. A file of that name that no store has made
    stays as it is.

    Raises:
        StoreError: somebody else writes, in this process or another, or the file cannot be made, or is another one.
    """

    def __init__(self, store: Path) -> None:
        self._store = store
        self._path = store.with_name(store.name + LOCK)
        self._released = False
        self._file = self._locked()
        while not self._is_there():  # its owner deleted the file between our opening and locking it
            os.close(self._file)
            self._file = self._locked()
        os.pwrite(self._file, _mark(), 0)

    def release(self) -> None:
        """Let others write; repeating it is fine."""
        if not self._released:
            self._released = True
            if self._is_there():
                self._path.unlink()
            os.close(self._file)

    def _is_there(self) -> bool:
        """Whether the locked file is the one that others find."""
        try:
            return os.path.samestat(os.fstat(self._file), self._path.lstat())
        except FileNotFoundError:
            return False

    def _locked(self) -> int:
        while True:
            try:
                return self._found()
            except FileNotFoundError:
                pass  # the first writer, or the one before has just gone
            try:
                return place(self._path, _mark(), locked=True)
            except FileExistsError:
                continue  # another writer was faster
            except OSError as error:
                said = f"cannot write '{self._path}': {error.strerror}"
                raise StoreError(said, place=Place(str(self._store))) from None

    def _found(self) -> int:
        """The file that is there, locked; errors as of `__init__`, and `FileNotFoundError`."""
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
        """The one that the file names."""
        found = _MARK.fullmatch(os.pread(file, 2 * len(_mark()), 0))
        if found is None:
            raise foreign(self._path, self._store, "is no lock of a store")
        return found[1].decode()


def _mark() -> bytes:
    return b"dsc writer %20d\n" % os.getpid()


def _taken(store: Path, process: str) -> StoreError:
    return StoreError(
        f"another writer has it open (process {process}); it can be opened with read_only=True meanwhile",
        place=Place(str(store)),
    )
