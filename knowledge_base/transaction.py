"""Several changes made as one, in everyday verbs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

from knowledge_base.errors import ConflictError, InputError, UnknownNameError
from knowledge_base.facts import Change, Content, Delta, Fact, Value
from knowledge_base.language.checking.inputs import require_delta
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.questions import Questions
from knowledge_base.world.overlay import Overlay


class Transaction:
    """The changes of one `with kb.transaction(...)` block; errors are raised where the mistake is made.

    Questions asked of it see its own changes; nobody else does before it is committed.

    Attributes:
        change: what was committed; `None` before the block has ended. When the block's key was committed
            before, it is that change from the beginning, and what the block says has no effect.
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
        """There is a thing of that type now.

        Raises:
            UnknownNameError: there is no such type.
            SchemaError: there is such a thing of another type.
        """
        self.apply(Delta(nodes={name: type_name}))

    def remove_node(self, name: str) -> None:
        """The thing is there no longer, nor any fact or value about it.

        Raises:
            UnknownNameError: there is no such thing.
        """
        if self._view.type_of(name) is None and not self._repeated:
            raise UnknownNameError(f"there is no object '{name}'", found=name, valid=self._view.objects("object"))
        self.apply(Delta(removed_nodes=(name,)))

    def tell(self, predicate: str, *args: Value) -> None:
        """The fact holds now.

        Raises:
            UnknownNameError: an undeclared predicate, or a thing that is not there.
            SchemaError: a wrong number of arguments, a wrong type, or a second fact of a functional predicate.
        """
        self.apply(Delta(added=(Fact(predicate, args),)))

    def retract(self, predicate: str, *args: Value) -> None:
        """The fact holds no longer; errors as for `tell`."""
        self.apply(Delta(removed=(Fact(predicate, args),)))

    def replace(self, predicate: str, *args: Value) -> None:
        """The fact holds now, and none any more that differs in the last argument: `tx.replace("at", "cup1", "shelf")`.

        Errors as for `tell`; a predicate without arguments is one, and so is one with a single argument that is not
        functional, of which nothing else would stay.
        """
        self.apply(Delta(replaced=(Fact(predicate, args),)))

    def set(self, function: str, *args_and_content: Content) -> None:
        """The function is worth this now: `tx.set("failures", "cup1", 2)`, `tx.set("pose", "cup1", "map", (0.4, 0.1))`.

        Raises:
            UnknownNameError: an undeclared function, or a thing that is not there.
            SchemaError: a wrong number of arguments, a wrong type of one of them or of the content.
            InputError: there is no content, or a number in it is not finite.
        """
        if not args_and_content:
            raise InputError(f"set('{function}', ...) ends with the content to set")
        *args, content = args_and_content
        # A geometry among the arguments is refused like any other argument of a wrong type.
        self.apply(Delta(values={Fact(function, tuple(cast("list[Value]", args))): content}))

    def apply(self, delta: Delta) -> None:
        """Make all the changes of `delta`, or none when one of them is an error.

        Raises:
            InputError: as for the single verbs.
            ConflictError: the transaction is over.
        """
        if self._closed:
            raise ConflictError("the transaction is over; changes are made inside its 'with' block")
        require_delta(delta)
        if not self._repeated:  # the world may have moved on since, so it is not even checked
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
        """No more changes; called when the block is left."""
        self._closed = True
