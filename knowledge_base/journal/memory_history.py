"""The last changes of a world that is only in memory, for queries of the recent past."""

from __future__ import annotations

import sqlite3
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from threading import Lock
from typing import NamedTuple

from knowledge_base.errors import ConflictError, StoreError
from knowledge_base.facts import Change, Content, Delta, Fact
from knowledge_base.journal.history import Version, Writer, gone, too_early
from knowledge_base.world.state import WorldState

MOST_KEPT = 10_000
"""Maximum number of objects, facts and numbers in the kept changes."""
MOST_KEYS = 10_000
"""Maximum number of idempotency keys."""


class _Taken(NamedTuple):
    """The content that a change removed without listing it."""

    values: Sequence[Content | None] = ()
    """The previous values of its functions, in its order; `None` is undefined."""
    types: Mapping[str, str] = {}
    departed: Mapping[Fact, Content] = {}
    """All values about the objects that it removed."""


class _Kept(NamedTuple):
    change: Change
    size: int
    taken: _Taken


_NOTHING = _Taken()


class MemoryHistory:
    """A `History` that costs almost nothing: undoing changes restores older worlds.

    Restored facts come last, so the order of facts may differ from the original.
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
        """Empty: memory is not checked for damage."""
        return b""

    def newest(self) -> Version:
        """Return the world it was made with."""
        return self._start

    def append(self, change: Change, key: str | None, before: WorldState, along: Writer | None) -> None:
        """Keep a change and drop the oldest beyond `MOST_KEPT`.

        Raises:
            StoreError: `along` is given, but there is no file.
        """
        if along is not None:
            raise StoreError("a knowledge base in memory has no file to write along into")
        if key is not None:
            self._remember(key, change)
        size = len(change.delta)
        if not size:
            return
        kept = _Kept(change, size, _taken(change.delta, before))
        with self._lock:
            self._kept.append(kept)
            self._size += size
            while self._size > MOST_KEPT:
                self._forget_oldest()

    def together(self) -> AbstractContextManager[sqlite3.Connection]:
        """Raise `StoreError`: there is no file."""
        raise StoreError("a knowledge base in memory has no file to write into")

    def first(self, key: str) -> Change | None:
        """Return the change that was kept under that key, if it is one of the last `MOST_KEYS`."""
        return self._keys.get(key)

    def changes(self, since: int, until: int) -> list[Change]:
        """Return the changes after version `since` up to version `until`."""
        with self._lock:
            self._require(since)
            return [k.change for k in self._kept if since < k.change.version <= until]

    def oldest(self) -> int:
        """Return the oldest version that is still kept."""
        with self._lock:
            return self._oldest[0]

    def later(self, version: int) -> list[Change]:
        """Raise `ConflictError`: there is no other writer."""
        raise ConflictError(f"version {version} is the newest; in memory there is no other writer to follow")

    def state(self, version: int, newest: Callable[[], Version]) -> WorldState:
        """Return the world of that version: the newest with all later changes undone."""
        present = newest()
        with self._lock:
            self._require(version)
            later = [k for k in self._kept if version < k.change.version <= present.version]
        return _undone(present.state, later)

    def version_at(self, time: float) -> int:
        """Return the version that the world had at that time."""
        with self._lock:
            oldest, begin = self._oldest
            if time < begin:
                raise too_early(time, oldest)
            return oldest + bisect_right(self._kept, time, key=lambda k: k.change.time)

    def compact(self, keep_since: int, newest: Callable[[], Version]) -> None:  # noqa: ARG002  there is no file
        """Drop the changes up to version `keep_since`."""
        with self._lock:
            while self._kept and self._oldest[0] < keep_since:
                self._forget_oldest()

    def close(self) -> None:
        """Do nothing: there is no file."""

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


def _taken(delta: Delta, before: WorldState) -> _Taken:
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
