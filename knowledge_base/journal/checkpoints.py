"""What was committed is put in its place in the file (SQLite's `checkpoint`) by a thread of its own.

That waits for the disk, twice, which nobody who commits should: one thread does it for all stores of the process, one
store after the other and with rests in between, so that the disk has time for the commits.

SQLite from 3.7.0 to 3.51.2 (but for 3.44.6 and 3.50.7) may lose commits when one checkpoint has put everything in its
place, another one begins soon after it, and at that very moment a commit begins the log anew: a later checkpoint may
leave out what counts as done then (https://www.sqlite.org/wal.html#walresetbug). So a store is asked for only together
with a commit that has left something in the log, and whoever does it himself lets the thread `leave` it first.
"""

from __future__ import annotations

import os
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from threading import Condition, Thread

from knowledge_base.journal.file import to_tidy_up

MOST_IN_LOG = 4000
"""Pages after which the writer had better do it himself: he commits so fast that the log is never all done."""
MOST_ASKED = 8
"""How often he asks before he does it himself."""
PAUSE = 1.0
"""How long the thread rests, as a multiple of what it has just worked."""


class Checkpoints:
    """Stores that are to be tidied up; the thread is there only while there are any."""

    def __init__(self) -> None:
        self._begin()
        os.register_at_fork(after_in_child=self._begin)  # threads stay behind

    def _begin(self) -> None:
        self._changed = Condition()
        self._waiting: dict[Path, int] = {}  # how often it was asked for
        self._pages: dict[Path, int] = {}  # in the log, when it was tidied up
        self._at_work: Path | None = None
        self._thread: Thread | None = None

    @contextmanager
    def asking(self, path: Path) -> Iterator[None]:
        """Tidy up that store soon, which its writer has open, if what is in the block, a commit, succeeds."""
        with self._changed:  # no checkpoint begins meanwhile
            yield
            if self._at_work == path:
                return
            self._waiting[path] = self._waiting.get(path, 0) + 1
            if self._thread is None or not self._thread.is_alive():
                self._thread = _started(self._run)

    def is_behind(self, path: Path) -> bool:
        """Whether the writer had better tidy up himself."""
        with self._changed:
            return self._waiting.get(path, 0) >= MOST_ASKED or self._pages.get(path, 0) > MOST_IN_LOG

    def leave(self, path: Path) -> None:
        """Do not touch that store any more: when this returns, nobody does."""
        with self._changed:
            self._waiting.pop(path, None)
            self._changed.wait_for(lambda: self._at_work != path)
            self._pages.pop(path, None)

    def settle(self) -> None:
        """Wait until nothing waits to be tidied up."""
        with self._changed:
            self._changed.wait_for(lambda: self._at_work is None and not self._waiting)

    def _run(self) -> None:
        while (path := self._next()) is not None:
            began, pages = time.monotonic(), 0
            try:
                pages = _tidy_up(path)
            finally:
                with self._changed:
                    self._pages[path] = pages
                    self._at_work = None
                    self._changed.notify_all()
            time.sleep(PAUSE * (time.monotonic() - began))

    def _next(self) -> Path | None:
        with self._changed:
            if not self._waiting:
                self._thread = None
                return None
            self._at_work = next(iter(self._waiting))
            del self._waiting[self._at_work]
            return self._at_work


def _started(work: Callable[[], None]) -> Thread | None:
    """`None` where no thread can be had: then the writer tidies up himself, after a while."""
    thread = Thread(target=work, name="checkpoints", daemon=True)
    with suppress(RuntimeError):
        thread.start()
        return thread
    return None


def _tidy_up(path: Path) -> int:
    """What cannot be done now is done next time: until then all is in the log, and SQLite reads it there."""
    with suppress(sqlite3.Error), closing(to_tidy_up(path)) as connection:
        _, pages, _ = connection.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()
        return int(pages)
    return 0


CHECKPOINTS = Checkpoints()
"""Those of this process."""
