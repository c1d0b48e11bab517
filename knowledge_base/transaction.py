"""Several changes as one: in a block of the world, and in a transaction of the file."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from types import TracebackType
from typing import cast

from knowledge_base.errors import ConflictError, InputError, StoreError, UnknownNameError
from knowledge_base.facts import Change, Content, Delta, Fact, Value
from knowledge_base.journal.history import History
from knowledge_base.language.checking.inputs import require_delta
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.questions import Questions
from knowledge_base.world.overlay import Overlay
from knowledge_base.world.read_write_lock import ReadWriteLock


class Transaction:
    """The changes of one `with kb.transaction(...)` block; each mistake raises its error immediately.

    Its own questions see its changes; no other reader does before the commit.

    Attributes:
        change: the committed change; `None` before the end of the block. If the block's key was committed before, it
            is that change from the beginning, and the block has no effect.
    """

    def __init__(self, view: Overlay, questions: Questions, first: Change | None = None) -> None:
        self._view = view
        self._questions = questions
        self._closed = False
        self._repeated = first is not None
        self.change = first

    @property
    def delta(self) -> Delta:
        """The changes so far."""
        return self._view.delta

    def add_node(self, name: str, type_name: str) -> None:
        """Add a thing of that type.

        Raises:
            UnknownNameError: there is no such type.
            SchemaError: there is a thing of that name and another type.
        """
        self.apply(Delta(nodes={name: type_name}))

    def remove_node(self, name: str) -> None:
        """Remove the thing, and all facts and values about it.

        Raises:
            UnknownNameError: there is no such thing.
        """
        if self._view.type_of(name) is None and not self._repeated:
            raise UnknownNameError(f"there is no object '{name}'", found=name, valid=self._view.objects("object"))
        self.apply(Delta(removed_nodes=(name,)))

    def tell(self, predicate: str, *args: Value) -> None:
        """Make the fact true.

        Raises:
            UnknownNameError: an undeclared predicate, or an unknown thing.
            SchemaError: a wrong number of arguments, a wrong type, or a second fact of a functional predicate.
        """
        self.apply(Delta(added=(Fact(predicate, args),)))

    def retract(self, predicate: str, *args: Value) -> None:
        """Make the fact false; errors as for `tell`."""
        self.apply(Delta(removed=(Fact(predicate, args),)))

    def replace(self, predicate: str, *args: Value) -> None:
        """Make the fact true, each with another last argument false: `tx.replace("at", "cup1", "shelf")`.

        Errors as for `tell`. The predicate needs an argument; one with a single argument must be functional.
        """
        self.apply(Delta(replaced=(Fact(predicate, args),)))

    def set(self, function: str, *args_and_content: Content) -> None:
        """Set the function: `tx.set("failures", "cup1", 2)`, `tx.set("pose", "cup1", "map", (0.4, 0.1))`.

        Raises:
            UnknownNameError: an undeclared function, or an unknown thing.
            SchemaError: a wrong number of arguments, a wrong type of one of them or of the content.
            InputError: there is no content, or a number in it is not finite.
        """
        if not args_and_content:
            raise InputError(f"set('{function}', ...) ends with the content to set")
        *args, content = args_and_content
        # The check of types refuses a geometry among the arguments.
        self.apply(Delta(values={Fact(function, tuple(cast("list[Value]", args))): content}))

    def apply(self, delta: Delta) -> None:
        """Apply `delta` as a whole or, with an error, not at all.

        Raises:
            InputError: as for the single verbs.
            ConflictError: the transaction is over.
        """
        if self._closed:
            raise ConflictError("the transaction is over; changes are made inside its 'with' block")
        require_delta(delta)
        if not self._repeated:  # the change may not fit the present world
            self._view.apply(delta)

    def query(self, text: str | Expression, params: Mapping[str, Value] | None = None) -> list[dict[str, Value]]:
        """As `KnowledgeBase.query`, with the changes so far."""
        params = self._questions.given(text, params, self._view, "answers")
        return self._questions.answers(text, params, self._view)

    def ask(self, text: str | Expression, params: Mapping[str, Value] | None = None) -> bool:
        """As `KnowledgeBase.ask`, with the changes so far."""
        params = self._questions.given(text, params, self._view, "error")
        return self._questions.ask(text, params, self._view)

    def close(self) -> None:
        """Refuse further changes; called at the end of the block."""
        self._closed = True


class GroupCommit:
    """The changes of a block and its own rows as one transaction of the file; see `KnowledgeBase.together`.

    One thread at a time may use it, repeatedly. After an interrupt before the first line of `__exit__`, `__del__` rolls
    the block back.

    Args:
        lock: lock of the world.
        require_free: raises an error if this thread may not begin now.
        history: writes the file.
    """

    def __init__(self, lock: ReadWriteLock, require_free: Callable[[], None], history: History) -> None:
        self._group: AbstractContextManager[sqlite3.Connection] | None = None  # inside
        self._lock = lock
        self._require_free = require_free
        self._history = history

    def __enter__(self) -> sqlite3.Connection:
        self._alone = self._lock.alone()
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
            except BaseException as failed:  # perhaps before its first line
                group.__exit__(type(failed), failed, None)
                raise
        finally:
            self._group = None
            self._alone.__exit__(None, None, None)

    def __del__(self) -> None:
        if self._group is not None:
            error = StoreError("a block was interrupted as it was left")
            self.__exit__(StoreError, error, None)
