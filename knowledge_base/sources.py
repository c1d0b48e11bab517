"""Data sources: sensor streams and transforms by reference, with only the latest value (S4.9).

A fluent that is bound to a source has the latest value of the source. Queries and installed conditions see the value
immediately, in the present version. Versions, changes and journals do not contain this value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from itertools import count
from types import TracebackType
from typing import TYPE_CHECKING, Self

from knowledge_base.conditions.installed import Installed
from knowledge_base.conditions.notification import Notifier
from knowledge_base.errors import ConflictError, InputError, SchemaError
from knowledge_base.facts import Content, Fact, require_content
from knowledge_base.world.overlay import check_fluent
from knowledge_base.world.state import WorldState

if TYPE_CHECKING:
    from knowledge_base.world.graph import WorldGraph


class DataSource:
    """Source of one fluent's values, usable from any thread; `KnowledgeBase.bind_source` creates it.

    A `with` block closes the source at its end.

    Attributes:
        fluent: the function with its arguments.
        reference: the origin of the values, e.g. `tf:map/cup1`.
    """

    def __init__(self, owner: Sources, fluent: Fact, reference: str) -> None:
        self._owner = owner
        self.fluent = fluent
        self.reference = reference
        self._latest: Content | None = None
        self._closed = False

    @property
    def latest(self) -> Content | None:
        """The latest value; `None` before the first update."""
        return self._latest

    @property
    def closed(self) -> bool:
        """Whether the source is closed: by `close`, by the removal of its object, or with the knowledge base."""
        return self._closed

    def update(self, content: Content) -> None:
        """Set the value of the fluent, after the end of any open transaction.

        Raises:
            SchemaError: the value does not have the type of the function's result.
            InputError: a number that is not finite.
            ConflictError: the source is closed.
        """
        self._owner.feed(self, content)

    def close(self) -> None:
        """Close the source; the fluent then has the value that a change has set.

        A second call has no effect.
        """
        self._owner.close(self)

    def __repr__(self) -> str:
        return f"<DataSource {self.fluent} from {self.reference}: {'closed' if self._closed else self._latest}>"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # --- called by its owner, under the lock

    def take(self, content: Content) -> None:
        """Store the latest value."""
        self._latest = content

    def end(self) -> None:
        """Mark the source as closed."""
        self._closed = True


SourceListener = Callable[[DataSource], None]
"""Function that is called with a source after its value has changed, in any thread."""


class Sources:
    """All open sources of a knowledge base, in the order of their binding."""

    def __init__(
        self,
        state: WorldState,
        graph: Callable[[], WorldGraph | None],
        installed: Installed,
        notifier: Notifier,
    ) -> None:
        self._state, self._graph, self._installed = state, graph, installed
        self._notifier, self._lock = notifier, notifier.lock
        self._open: dict[Fact, DataSource] = {}
        self._listeners: dict[int, SourceListener] = {}
        self._keys = count()

    def subscribe(self, listener: SourceListener) -> Callable[[], None]:
        """Call `listener` after each new value of a source; see `KnowledgeBase.subscribe_to_sources`."""
        with self._lock:
            key = next(self._keys)
            self._listeners[key] = listener

        def unsubscribe() -> None:
            with self._lock:
                self._listeners.pop(key, None)

        return unsubscribe

    def bind(self, fluent: Fact, reference: str) -> DataSource:
        """Create a source for a fluent without a source; see `KnowledgeBase.bind_source`."""
        if not isinstance(reference, str) or not reference:
            raise InputError(f"a source's reference is text that says where values come from, not {reference!r}")
        with self._lock:
            check_fluent(fluent, self._state)
            if fluent.predicate in self._state.poses:
                raise SchemaError(f"{fluent} is answered by a transform tree already")
            if fluent in self._open:
                raise SchemaError(f"{fluent} is fed by '{self._open[fluent].reference}' already")
            source = self._open[fluent] = DataSource(self, fluent, reference)
            self._state.bind(fluent, reference)
            self._show(fluent, reference, self._value(fluent))
        return source

    def listed(self) -> list[DataSource]:
        """Return the open sources."""
        with self._lock:
            return list(self._open.values())

    def feed(self, source: DataSource, content: Content) -> None:
        """Set the value of the source's fluent; see `DataSource.update`."""
        fluent = source.fluent
        require_content(content, self._state.schema.result(fluent.predicate), fluent)
        with self._lock:
            if source.closed:
                raise ConflictError(f"the source '{source.reference}' of {fluent} is closed")
            before = self._value(fluent)
            source.take(content)
            self._state.feed(fluent, content)
            self._show(fluent, source.reference, content)
            self._tell(source, before)
        self._notifier.deliver()

    def close(self, source: DataSource) -> None:
        """Close the source; see `DataSource.close`."""
        with self._lock:
            if source.closed:
                return
            before = self._value(source.fluent)
            self._drop(source)
            self._tell(source, before)
        self._notifier.deliver()

    def close_about(self, things: Iterable[str]) -> None:
        """Close the sources of removed objects; the commit that removes the objects notifies the conditions."""
        gone = set(things)
        for source in [s for s in self._open.values() if not gone.isdisjoint(s.fluent.args)]:
            self._drop(source)

    def _drop(self, source: DataSource) -> None:
        source.end()
        del self._open[source.fluent]
        self._state.unbind(source.fluent)
        if (graph := self._graph()) is not None:
            graph.unfeed(source.fluent, self._state.values.get(source.fluent))

    def _show(self, fluent: Fact, reference: str, content: Content) -> None:
        if (graph := self._graph()) is not None:  # otherwise no reader has requested the graph
            graph.feed(fluent, reference, content)

    def _tell(self, source: DataSource, before: Content) -> None:
        if self._value(source.fluent) != before:
            self._installed.refreshed(source.fluent)
            for listener in self._listeners.values():
                self._notifier.queue(partial(listener, source))

    def _value(self, fluent: Fact) -> Content:
        return self._state.value(fluent.predicate, fluent.args)
