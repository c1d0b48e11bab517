"""Committed changes as an asynchronous iterator that never loses one without saying so."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Lock
from types import TracebackType
from typing import Protocol, Self

from knowledge_base.conditions.notification import Listener
from knowledge_base.conditions.pattern import Touches, touches
from knowledge_base.conditions.waiters import Waiters
from knowledge_base.errors import InputError
from knowledge_base.facts import Change, Value
from knowledge_base.language.checking.inputs import fitted_names, require_condition, require_params, shown
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.world.schema import Schema


@dataclass(frozen=True, slots=True)
class Missed:
    """The watcher was too slow: changes after version `since`, up to `until`, are not told; look anew.

    Attributes:
        since: the latest version the watcher has been told everything of.
        until: the latest version that was left out; what follows is told again.
    """

    since: int
    until: int


class Observed(Protocol):
    """What can be watched: a knowledge base."""

    @property
    def schema(self) -> Schema:
        """What may be said."""
        ...

    @property
    def version(self) -> int:
        """How many changes were committed."""
        ...

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Call `listener` with every change until the function returned is called."""
        ...


def watch(observed: Observed, pattern: str | Expression | None, params: Mapping[str, Value], limit: int) -> Watch:
    """Watch `observed` from its present version on; see `KnowledgeBase.watch` for the rest."""
    if isinstance(limit, bool) or not isinstance(limit, int) or limit < 1:
        raise InputError(f"a watch keeps at least one change for its reader, not {shown(limit)}")
    touching = None if pattern is None else _touching(pattern, params, observed.schema)
    made = Watch(touching, observed.version, limit)
    made.follow(observed.subscribe(made.hear))
    return made


def _touching(pattern: str | Expression, params: Mapping[str, Value], schema: Schema) -> Touches:
    require_condition(pattern)
    require_params(params)
    parsed = parse_condition(pattern) if isinstance(pattern, str) else pattern
    return touches(parsed, dict(zip(fitted_names(parsed, params), params.values(), strict=True)), schema)


class Watch:
    """An asynchronous iterator over changes from when it is made; see `KnowledgeBase.watch`.

    It may be read by one or several tasks, of any event loop. It ends when it is closed; as a context manager
    it is closed at the end of the block.
    """

    def __init__(self, touches: Touches | None, version: int, limit: int) -> None:
        self._touches = touches
        self._limit = limit
        self._told = version
        self._queue: deque[Change] = deque()
        self._missed: Missed | None = None
        self._waiters: Waiters[None] = Waiters()
        self._guard = Lock()
        self._closed = False
        self._unsubscribe: Callable[[], None] = _nothing

    def follow(self, unsubscribe: Callable[[], None]) -> None:
        """`unsubscribe` ends the changes; called by the maker."""
        self._unsubscribe = unsubscribe

    def hear(self, change: Change) -> None:
        """Take in a change; the knowledge base calls it, from any thread."""
        if self._touches is not None and not self._touches(change):
            return
        with self._guard:
            if len(self._queue) >= self._limit:
                since = self._missed.since if self._missed else self._told
                self._missed = Missed(since, change.version)
                self._queue.clear()
            else:
                self._queue.append(change)
            self._waiters.answer(None)

    def close(self) -> None:
        """End it: whoever reads it is done."""
        self._unsubscribe()
        with self._guard:
            self._closed = True
            self._queue.clear()
            self._missed = None
            self._waiters.answer(None)

    def __aiter__(self) -> Watch:
        return self

    async def __anext__(self) -> Change | Missed:
        """The next change that touches the pattern, or which ones were missed."""
        while True:
            with self._guard:
                if (item := self._take()) is not None:
                    return item
                if self._closed:
                    raise StopAsyncIteration
                future = self._waiters.join()
            try:
                await future
            finally:
                with self._guard:
                    self._waiters.leave(future)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _take(self) -> Change | Missed | None:
        if self._missed is not None:
            missed, self._missed = self._missed, None
            self._told = missed.until
            return missed
        if self._queue:
            change = self._queue.popleft()
            self._told = change.version
            return change
        return None


def _nothing() -> None: ...
