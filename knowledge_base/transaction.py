"""Transactions: several changes in one version, and several commits in one transaction of the file."""

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
    """The changes of one `with kb.transaction(...)` block; each invalid change raises its error immediately.

    Queries of the transaction see its changes; no other reader sees them before the commit.

    Attributes:
        change: the committed change; `None` before the end of the block. If the key of the block was committed before,
            this attribute is that earlier change from the beginning, and the block has no effect.
    """

    def __init__(self, view: Overlay, questions: Questions, first: Change | None) -> None:
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
        """Add an object of the type `type_name`.

        Raises:
            UnknownNameError: the type is not declared.
            SchemaError: an object with this name has another type.
        """
        self.apply(Delta(nodes={name: type_name}))

    def remove_node(self, name: str) -> None:
        """Remove the object, with all its facts and values.

        Raises:
            UnknownNameError: the object is unknown.
        """
        if self._view.type_of(name) is None and not self._repeated:
            raise UnknownNameError(f"there is no object '{name}'", found=name, valid=self._view.objects("object"))
        self.apply(Delta(removed_nodes=(name,)))

    def tell(self, predicate: str, *args: Value) -> None:
        """Make the fact true.

        Raises:
            UnknownNameError: an undeclared predicate, or an unknown object.
            SchemaError: a wrong number of arguments, a wrong type, or a second fact of a functional predicate.
        """
        self.apply(Delta(added=(Fact(predicate, args),)))

    def retract(self, predicate: str, *args: Value) -> None:
        """Make the fact false; errors as for `tell`."""
        self.apply(Delta(removed=(Fact(predicate, args),)))

    def replace(self, predicate: str, *args: Value) -> None:
        """Make a fact true and those false that differ in the last argument only: `tx.replace("at", "cup1", "shelf")`.

        Errors as for `tell`. The predicate must have an argument; a predicate with a single argument must be
        functional.
        """
        self.apply(Delta(replaced=(Fact(predicate, args),)))

    def set(self, function: str, *args_and_content: Content) -> None:
        """Set the function: `tx.set("failures", "cup1", 2)`, `tx.set("pose", "cup1", "map", (0.4, 0.1))`.

        Raises:
            UnknownNameError: an undeclared function, or an unknown object.
            SchemaError: a wrong number of arguments, or a wrong type of an argument or of the content.
            InputError: the content is missing, or a number in it is not finite.
        """
        if not args_and_content:
            raise InputError(f"set('{function}', ...) ends with the content to set")
        *args, content = args_and_content
        # The type check rejects a geometry among the arguments.
        self.apply(Delta(values={Fact(function, tuple(cast("list[Value]", args))): content}))

    def apply(self, delta: Delta) -> None:
        """Apply `delta` as a whole, or raise an error without effect.

        Raises:
            InputError: as for the methods for single changes.
            ConflictError: the block of the transaction has ended.
        """
        if self._closed:
            raise ConflictError("the transaction is over; changes are made inside its 'with' block")
        require_delta(delta)
        if not self._repeated:  # a repeated change may contradict the present world
            self._view.apply(delta)

    def query(self, text: str | Expression, params: Mapping[str, Value] | None = None) -> list[dict[str, Value]]:
        """Return the answers as `KnowledgeBase.query` does, with the changes so far."""
        params = self._questions.given(text, params, self._view, "answers")
        return self._questions.answers(text, params, self._view)

    def ask(self, text: str | Expression, params: Mapping[str, Value] | None = None) -> bool:
        """Return whether the condition is true, as `KnowledgeBase.ask` does, with the changes so far."""
        params = self._questions.given(text, params, self._view, "error")
        return self._questions.ask(text, params, self._view)

    def close(self) -> None:
        """Refuse further changes; the knowledge base calls this method at the end of the block."""
        self._closed = True


class GroupCommit:
    """Several commits, and rows of the caller, in one transaction of the file; see `KnowledgeBase.together`.

    Only one thread at a time may use a `GroupCommit`. Repeated use is allowed. If an exception interrupts `__exit__`
    before its first line, `__del__` rolls the block back.

    Args:
        lock: lock of the world.
        require_free: raises an error if this thread may not begin a transaction.
        history: writes the file.
    """

    def __init__(self, lock: ReadWriteLock, require_free: Callable[[], None], history: History) -> None:
        self._group: AbstractContextManager[sqlite3.Connection] | None = None  # `None` outside the block
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
            except BaseException as failed:  # the exception may come before the first line of `__exit__`
                group.__exit__(type(failed), failed, None)
                raise
        finally:
            self._group = None
            self._alone.__exit__(None, None, None)

    def __del__(self) -> None:
        if self._group is not None:
            error = StoreError("a block was interrupted as it was left")
            self.__exit__(StoreError, error, None)
