"""Group commit: the changes of a block, and its own rows, as one transaction of the file."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import AbstractContextManager
from types import TracebackType

from knowledge_base.errors import StoreError
from knowledge_base.journal.history import History
from knowledge_base.world.read_write_lock import ReadWriteLock


class GroupCommit:
    """See `KnowledgeBase.together`; may be used again and again, by one thread at a time.

    An interrupt may come as the block is left, before a line of `__exit__` runs. Then `__del__` rolls the block back.

    Args:
        lock: that of the world.
        require_free: raises if this thread may not begin now.
        history: writes the file.
    """

    def __init__(self, lock: ReadWriteLock, require_free: Callable[[], None], history: History) -> None:
        self._group: AbstractContextManager[sqlite3.Connection] | None = None  # inside
        self._alone = lock.alone()
        self._require_free = require_free
        self._history = history

    def __enter__(self) -> sqlite3.Connection:
        self._alone.__enter__()
        try:
            self._require_free()
            group = self._history.together()
            connection = group.__enter__()
            self._group = group
        except BaseException:
            self._alone.__exit__(None, None, None)
            raise
        return connection

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        group = self._group
        assert group is not None  # noqa: S101
        try:
            try:
                group.__exit__(kind, error, at)
            except BaseException as failed:  # perhaps before it had begun to end
                group.__exit__(type(failed), failed, None)
                raise
        finally:
            self._group = None
            self._alone.__exit__(None, None, None)

    def __del__(self) -> None:
        if self._group is not None:
            error = StoreError("a block was interrupted as it was left")
            self.__exit__(StoreError, error, None)
