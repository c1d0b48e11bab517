"""The interface of a knowledge base to its past, in a file or in memory."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Protocol

from knowledge_base.errors import HistoryError, Place
from knowledge_base.facts import Change
from knowledge_base.world.state import WorldState

Writer = Callable[[sqlite3.Connection], None]
"""Writes more rows in the transaction of a commit; it neither commits nor rolls back."""


@dataclass(frozen=True, slots=True)
class Version:
    """A world with its version and the time of the change that made it."""

    state: WorldState
    version: int
    time: float


class History(Protocol):
    """A sequence of changes. Any thread may call the reading methods; one thread at a time calls `append`."""

    @property
    def digest(self) -> bytes:
        """Digest of the newest version, which covers all versions before it; empty for a history in memory."""
        ...

    def newest(self) -> Version:
        """Return the newest world, which the caller may change."""
        ...

    def append(self, change: Change, key: str | None, before: WorldState, along: Writer | None) -> None:
        """Keep a change before it is applied to `before`; the change is acknowledged when this returns.

        Args:
            change: the change; an empty one is kept only for its `key`.
            key: an idempotency key, under which `first` finds the change.
            before: the world without the change.
            along: writes further rows in the same transaction.

        Raises:
            StoreError: the change could not be written; nothing is kept.
            ConflictError: the history is read-only.
        """
        ...

    def together(self) -> AbstractContextManager[sqlite3.Connection]:
        """Return a block whose appended changes and own rows are kept together or not at all.

        Raises:
            StoreError: the block could not be written, or there is no file. Later appends fail too, since the world in
                memory is ahead of the file.
            ConflictError: the history is read-only.
        """
        ...

    def first(self, key: str) -> Change | None:
        """Return the change that was kept under that key."""
        ...

    def changes(self, since: int, until: int) -> list[Change]:
        """Return the changes after version `since` up to version `until`.

        Raises:
            HistoryError: some of them are no longer kept.
        """
        ...

    def oldest(self) -> int:
        """Return the oldest version that is still kept."""
        ...

    def later(self, version: int) -> list[Change]:
        """Return the changes after `version` that another writer has committed.

        Raises:
            ConflictError: this history is the only writer.
            HistoryError: some of them are no longer kept.
            StoreError: the schema has changed since the store was opened, or the file cannot be read.
        """
        ...

    def state(self, version: int, newest: Callable[[], Version]) -> WorldState:
        """Return a copy of the world of that version; `newest` returns the present one, from which changes are undone.

        Raises:
            HistoryError: the version is no longer kept.
        """
        ...

    def version_at(self, time: float) -> int:
        """Return the version that the world had at that time.

        Raises:
            HistoryError: the time is before the oldest kept version.
        """
        ...

    def compact(self, keep_since: int, newest: Callable[[], Version]) -> None:
        """Remove the content that only versions before `keep_since` need; keys are kept.

        Raises:
            StoreError: the change could not be written; nothing has changed.
        """
        ...

    def close(self) -> None:
        """Close files and release locks."""
        ...


def gone(version: int, oldest: int, place: Place | None = None) -> HistoryError:
    """Return the error for a version that is no longer kept."""
    return HistoryError(f"version {version} is no longer kept; the oldest kept is {oldest}", place=place)


def too_early(time: float, oldest: int, place: Place | None = None) -> HistoryError:
    """Return the error for a time before the oldest kept version."""
    return HistoryError(f"time {time} is before the oldest kept version, {oldest}", place=place)
