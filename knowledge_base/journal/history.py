"""The interface of a knowledge base to its past versions, and the implementation in memory."""

from __future__ import annotations

import sqlite3
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from threading import Lock
from typing import NamedTuple, Protocol

from knowledge_base.errors import ConflictError, HistoryError, Place, StoreError
from knowledge_base.facts import Change, Content, Delta, Fact
from knowledge_base.world.state import WorldState

MOST_KEPT = 10_000
"""Maximum number of objects, facts and values in the kept changes."""
MOST_KEYS = 10_000
"""Maximum number of idempotency keys."""
Writer = Callable[[sqlite3.Connection], object]
"""A function that writes more rows in the transaction of a commit; it must neither commit nor roll back."""


class Version(NamedTuple):
    """A world with its version and the time of the change that led to it."""

    state: WorldState
    version: int
    time: float


class History(Protocol):
    """A sequence of changes. Any thread may call the reading methods; only one thread at a time may call `append`."""

    @property
    def digest(self) -> bytes:
        """Digest of the newest version, which covers all versions before it; empty for a history in memory."""

    def newest(self) -> Version:
        """Return the newest world, which the caller may change."""

    def append(self, change: Change, key: str | None, before: WorldState, along: Writer | None) -> None:
        """Store a change before it is applied to `before`; the change is committed when this method returns.

        Args:
            change: the change; an empty change is stored only for its `key`.
            key: an idempotency key; `first` finds the change by this key.
            before: the world before the change.
            along: writes further rows in the same transaction.

        Raises:
            StoreError: the change could not be written; nothing is stored.
            ConflictError: the history is read-only.
        """

    def together(self) -> AbstractContextManager[sqlite3.Connection]:
        """Return a context manager for a block whose changes and own rows are stored together or not at all.

        Raises:
            StoreError: the block could not be written, or no file exists. Later appends fail too, since the world in
                memory is ahead of the file.
            ConflictError: the history is read-only.
        """

    def first(self, key: str) -> Change | None:
        """Return the change that was stored under that key, or `None`."""

    def changes(self, since: int, until: int) -> list[Change]:
        """Return the changes after version `since` up to and including version `until`.

        Raises:
            HistoryError: some of these changes are no longer kept.
        """

    def oldest(self) -> int:
        """Return the oldest version that is still kept."""

    def later(self, version: int) -> list[Change]:
        """Return the changes after `version` that another writer has committed.

        Raises:
            ConflictError: this history is the only writer.
            HistoryError: some of these changes are no longer kept.
            StoreError: the schema has changed since the store was opened, or the file cannot be read.
        """

    def state(self, version: int, newest: Callable[[], Version]) -> WorldState:
        """Return a copy of the world of that version.

        `newest` returns the present world; a history may undo the later changes on it.

        Raises:
            HistoryError: the version is no longer kept.
        """

    def version_at(self, time: float) -> int:
        """Return the version of the world at that time.

        Raises:
            HistoryError: the time is before the oldest kept version.
        """

    def compact(self, keep_since: int, newest: Callable[[], Version]) -> None:
        """Remove the content that only versions before `keep_since` need; keys stay.

        Raises:
            StoreError: the removal could not be written; nothing has changed.
        """

    def close(self) -> None:
        """Close files and release locks."""


def gone(version: int, oldest: int, place: Place | None = None) -> HistoryError:
    """Return the error for a version that is no longer kept."""
    return HistoryError(f"version {version} is no longer kept; the oldest kept is {oldest}", place=place)


def too_early(time: float, oldest: int, place: Place | None = None) -> HistoryError:
    """Return the error for a time before the oldest kept version."""
    return HistoryError(f"time {time} is before the oldest kept version, {oldest}", place=place)


class _Taken(NamedTuple):
    """The content that a change removed without listing it."""

    values: Sequence[Content | None] = ()
    """The previous values of the functions in the change, in its order; `None` is an unset value."""
    types: Mapping[str, str] = {}
    departed: Mapping[Fact, Content] = {}
    """All values of the objects that the change removed."""


class _Kept(NamedTuple):
    change: Change
    size: int
    taken: _Taken


_NOTHING = _Taken()


class MemoryHistory:
    """A `History` in memory with little overhead: undoing changes restores past worlds.

    Restored facts follow all other facts, so that the order of facts may differ from the original order.
    """

    def __init__(self, start: Version) -> None:
        self._start = start
        self._lock = Lock()
        self._kept: deque[_Kept] = deque()
        self._size = 0
        self._oldest = (start.version, start.time)
        self._keys: dict[str, Change] = {}

    @property
    def digest(self) -> bytes:
        """Empty: a history in memory is not checked for damage."""
        return b""

    def newest(self) -> Version:
        """Return the world that the history started with."""
        return self._start

    def append(self, change: Change, key: str | None, before: WorldState, along: Writer | None) -> None:
        """Store a change, and discard the oldest changes beyond `MOST_KEPT`.

        Raises:
            StoreError: `along` is given, but a history in memory has no file.
        """
        if along is not None:
            raise StoreError("a knowledge base in memory has no file to write along into")
        if key is not None:
            self._remember(key, change)
        size = len(change.delta)
        if not size:
            return
        kept = _Kept(change, size, _take(change.delta, before))
        with self._lock:
            self._kept.append(kept)
            self._size += size
            while self._size > MOST_KEPT:
                self._forget_oldest()

    def together(self) -> AbstractContextManager[sqlite3.Connection]:
        """Raise `StoreError`: a history in memory has no file."""
        raise StoreError("a knowledge base in memory has no file to write into")

    def first(self, key: str) -> Change | None:
        """Return the change that was stored under that key, if the key is one of the latest `MOST_KEYS`."""
        return self._keys.get(key)

    def changes(self, since: int, until: int) -> list[Change]:
        """Return the changes after version `since` up to and including version `until`."""
        with self._lock:
            self._require(since)
            return [k.change for k in self._kept if since < k.change.version <= until]

    def oldest(self) -> int:
        """Return the oldest version that is still kept."""
        with self._lock:
            return self._oldest[0]

    def later(self, version: int) -> list[Change]:
        """Raise `ConflictError`: a history in memory has no other writer."""
        raise ConflictError(f"version {version} is the newest; in memory there is no other writer to follow")

    def state(self, version: int, newest: Callable[[], Version]) -> WorldState:
        """Return the world of that version: the newest world with all later changes undone."""
        present = newest()
        with self._lock:
            self._require(version)
            later = [k for k in self._kept if version < k.change.version <= present.version]
        return _undone(present.state, later)

    def version_at(self, time: float) -> int:
        """Return the version of the world at that time."""
        with self._lock:
            oldest, begin = self._oldest
            if time < begin:
                raise too_early(time, oldest)
            return oldest + bisect_right(self._kept, time, key=lambda k: k.change.time)

    def compact(self, keep_since: int, newest: Callable[[], Version]) -> None:  # noqa: ARG002  there is no file
        """Discard the changes up to version `keep_since`."""
        with self._lock:
            while self._kept and self._oldest[0] < keep_since:
                self._forget_oldest()

    def close(self) -> None:
        """Do nothing: a history in memory has no file."""

    def _require(self, version: int) -> None:
        if version < self._oldest[0]:
            raise gone(version, self._oldest[0])

    def _forget_oldest(self) -> None:
        change, size, _ = self._kept.popleft()
        self._size -= size
        self._oldest = (change.version, change.time)

    def _remember(self, key: str, change: Change) -> None:
        self._keys[key] = change
        if len(self._keys) > MOST_KEYS:
            del self._keys[next(iter(self._keys))]


def _take(delta: Delta, before: WorldState) -> _Taken:
    if not (delta.values or delta.removed_nodes):
        return _NOTHING
    values = list(map(before.values.get, delta.values))
    if not delta.removed_nodes:
        return _Taken(values)
    things = set(delta.removed_nodes)
    departed = {f: v for f, v in before.values.items() if not things.isdisjoint(f.args)}
    return _Taken(values, {name: before.nodes[name] for name in delta.removed_nodes}, departed)


def _undone(state: WorldState, later: list[_Kept]) -> WorldState:
    nodes, facts, values = dict(state.nodes), dict.fromkeys(state.facts), dict(state.values)
    for change, _, taken in reversed(later):
        delta = change.delta
        for fact in delta.added:
            del facts[fact]
        facts.update(dict.fromkeys(delta.removed))
        for name in delta.nodes:
            del nodes[name]
        nodes.update(taken.types)
        for fluent, content in zip(delta.values, taken.values, strict=True):
            if content is None:
                del values[fluent]
            else:
                values[fluent] = content
        values.update(taken.departed)
    return WorldState.of(state.schema, nodes, facts, values)
