"""What is committed in a block, and what the block itself writes, as one transaction of the file."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import AbstractContextManager
from types import TracebackType

from knowledge_base.journal.history import History
from knowledge_base.world.turn import Turn


class Together:
    """See `KnowledgeBase.together`; used again and again, by one thread at a time.

    Args:
        turn: that of the world.
        require_free: raises if this thread may not begin now.
        history: what writes.
    """

    def __init__(self, turn: Turn, require_free: Callable[[], None], history: History) -> None:
        self._alone = turn.alone()
        self._require_free = require_free
        self._history = history
        self._group: AbstractContextManager[sqlite3.Connection] | None = None

    def __enter__(self) -> sqlite3.Connection:
        self._alone.__enter__()
        try:
            self._require_free()
            group = self._group = self._history.together()
            return group.__enter__()
        except BaseException:
            self._alone.__exit__(None, None, None)
            raise

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        assert self._group is not None  # noqa: S101
        try:
            self._group.__exit__(kind, error, at)
        finally:
            self._alone.__exit__(None, None, None)
