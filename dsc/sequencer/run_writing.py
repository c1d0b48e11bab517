"""The transactions of a kept run: who may write them, and who is told of their boundaries."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

from dsc.sequencer.run_tables import FORMAT, TABLES, require_format
from knowledge_base.errors import Place, StoreError
from knowledge_base.store import KnowledgeBase

_RIGHT = "SELECT 1 FROM fence WHERE epoch = ?"
_STEP = "INSERT INTO steps SELECT NULL, ?, ?, ?, ?, ?, ?, ?, ?, ?, ? FROM fence WHERE epoch = ?"
Boundary = Literal["before commit", "after commit"]
"""Where a process that dies makes a difference: either nothing of the macrostep was, or nothing has left yet."""


class Writing:
    """A context manager for one transaction after the other; whoever makes one takes all earlier ones' right away.

    Args:
        knowledge: the knowledge base of the run, opened at `path`.
        path: its file.

    Attributes:
        connection: to write with, inside; who writes no macrostep looks first whether it is still his right.
        before: version of the knowledge when the transaction began.
        begun: whether anything was written.
        lost: whether something could not be written: what is in memory is ahead of the file.

    Raises:
        StoreError: on entering or leaving, it cannot be written.
    """

    def __init__(self, knowledge: KnowledgeBase, path: Path) -> None:
        self.begun = self.lost = False
        self.before = 0
        self._knowledge = knowledge
        self._path = path
        self._listeners: list[Callable[[Boundary], None]] = []
        self._together = knowledge.together()
        with self._together as self.connection:
            require_format(self.connection, path)
            for statement in TABLES:
                self.connection.execute(statement)
            (epoch,) = self.connection.execute("SELECT max(epoch) FROM fence").fetchone()
            self.connection.execute("DELETE FROM fence")
            self._epoch = (epoch or 0) + 1
            self.connection.execute("INSERT INTO fence VALUES (?, ?)", (self._epoch, FORMAT))

    def listen(self, listener: Callable[[Boundary], None]) -> None:
        """Tell `listener` from now on when something is about to be committed, and when it has been."""
        self._listeners.append(listener)

    def __enter__(self) -> None:
        try:
            self.connection = self._together.__enter__()
        except BaseException:
            self.lost = True
            raise
        self.before = self._knowledge.version

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        try:
            if error is None:
                self._tell("before commit")
        except BaseException as stopped:
            self._close(stopped)
            raise
        self._close(error)
        if error is None:
            self.begun = True
            self._tell("after commit")

    def require_right(self) -> None:
        """Raise `StoreError` if another sequencer has taken the run over."""
        self._require(self.connection.execute(_RIGHT, (self._epoch,)).fetchone() is not None)

    def step(self, *row: Any) -> None:
        """The row of a macrostep without its place; errors as for `require_right`, which it makes needless."""
        self._require(self.connection.execute(_STEP, (*row, self._epoch)).rowcount == 1)

    def _require(self, right: object) -> None:
        if not right:
            raise StoreError("another sequencer has taken this run over", place=Place(str(self._path)))

    def _close(self, error: BaseException | None) -> None:
        self.lost = self.lost or error is not None
        try:
            self._together.__exit__(None if error is None else type(error), error, None)
        except BaseException:
            self.lost = True
            raise

    def _tell(self, boundary: Boundary) -> None:
        for listener in self._listeners:
            listener(boundary)
