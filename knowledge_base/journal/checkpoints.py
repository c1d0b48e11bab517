"""A thread that moves committed pages from SQLite's log into the store file (SQLite's `checkpoint`).

A checkpoint waits for the disk twice, which would delay commits. One thread serves all stores of the process in turn,
with pauses, so that the disk has time for commits.

SQLite from 3.7.0 to 3.51.2 (except 3.44.6 and 3.50.7) may lose commits; see
https://www.sqlite.org/wal.html#walresetbug for the details. It needs a checkpoint that completes, another one soon
after, and a commit that restarts the log at that moment. A later checkpoint may then skip committed pages. The
thread therefore takes a request only together with a commit that left pages in the log. A caller calls `leave` before
its own checkpoint.
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
"""Pages in the log after which the writer runs the checkpoint itself: its commits leave the thread no gap."""
MOST_ASKED = 8
"""Number of requests after which the writer runs the checkpoint itself."""
PAUSE = 1.0
"""Pause of the thread, as a multiple of its last working time."""


class Checkpoints:
    """Stores that wait for a checkpoint; the thread exists only while there are any."""

    def __init__(self) -> None:
        self._begin()
        os.register_at_fork(after_in_child=self._begin)  # threads do not survive a fork

    def _begin(self) -> None:
        self._changed = Condition()
        self._waiting: dict[Path, int] = {}  # number of requests
        self._pages: dict[Path, int] = {}  # in the log at its last checkpoint
        self._at_work: Path | None = None
        self._thread: Thread | None = None

    @contextmanager
    def asking(self, path: Path) -> Iterator[None]:
        """Request a checkpoint of the store if the commit in the block succeeds; the store is open for writing."""
        with self._changed:  # no checkpoint begins meanwhile
            yield
            if self._at_work == path:
                return
            self._waiting[path] = self._waiting.get(path, 0) + 1
            if self._thread is None or not self._thread.is_alive():
                self._thread = _started(self._run)

    def is_behind(self, path: Path) -> bool:
        """Return whether the writer should run the checkpoint itself."""
        with self._changed:
            return self._waiting.get(path, 0) >= MOST_ASKED or self._pages.get(path, 0) > MOST_IN_LOG

    def leave(self, path: Path) -> None:
        """Cancel requests for the store, and wait until no checkpoint of it runs."""
        with self._changed:
            self._waiting.pop(path, None)
            self._changed.wait_for(lambda: self._at_work != path)
            self._pages.pop(path, None)

    def settle(self) -> None:
        """Wait until no request is pending."""
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
    """Return the thread, or `None` if the system has none; the writer then runs checkpoints after a while."""
    thread = Thread(target=work, name="checkpoints", daemon=True)
    with suppress(RuntimeError):
        thread.start()
        return thread
    return None


def _tidy_up(path: Path) -> int:
    """Run a checkpoint; return the pages in the log. Blocked pages stay in the log, where SQLite reads them."""
    with suppress(sqlite3.Error), closing(to_tidy_up(path)) as connection:
        _, pages, _ = connection.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()
        return int(pages)
    return 0


CHECKPOINTS = Checkpoints()
"""The instance of this process."""
