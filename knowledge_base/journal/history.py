"""What a knowledge base needs to know of its past, wherever that is kept."""

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
    """Keeps changes. Methods that ask may be called by any thread; `append` is called by one at a time."""

    @property
    def digest(self) -> bytes:
        """Of the newest version, and so of everything before it; empty where nothing is kept for long."""
        ...

    def newest(self) -> Version:
        """The world to go on with; it belongs to the caller."""
        ...

    def append(self, change: Change, key: str | None, before: WorldState, along: Writer | None) -> None:
        """Keep a change that is about to be made to `before`; when this returns it is acknowledged.

        Args:
            change: an empty one is kept only for its `key`.
            key: under which it is found again by `first`.
            before: the world without the change.
            along: what else is written with it.

        Raises:
            StoreError: it could not be written; nothing is kept.
            ConflictError: this history is only read.
        """
        ...

    def together(self) -> AbstractContextManager[sqlite3.Connection]:
        """What is appended inside the block, and what is written with the connection, is kept as one or not at all.

        Raises:
            StoreError: it could not be written, or there is no file; from then on nothing can be appended, since
                the world in memory has gone on without it.
            ConflictError: this history is only read.
        """
        ...

    def first(self, key: str) -> Change | None:
        """The change that was kept under that key."""
        ...

    def changes(self, since: int, until: int) -> list[Change]:
        """The changes after version `since`, up to that which made version `until`.

        Raises:
            HistoryError: some of them are not kept any more.
        """
        ...

    def oldest(self) -> int:
        """The first version that is still kept."""
        ...

    def later(self, version: int) -> list[Change]:
        """What somebody else has committed after `version`.

        Raises:
            ConflictError: nobody else writes here.
            HistoryError: some of it is not kept any more.
            StoreError: the schema is not that which it was opened with, or it cannot be read.
        """
        ...

    def state(self, version: int, newest: Callable[[], Version]) -> WorldState:
        """The world of that version, as a copy; `newest` tells the present one to those who go back from it.

        Raises:
            HistoryError: it is not kept any more.
        """
        ...

    def version_at(self, time: float) -> int:
        """The version that the world had at that time.

        Raises:
            HistoryError: that was before anything that is kept.
        """
        ...

    def compact(self, keep_since: int, newest: Callable[[], Version]) -> None:
        """Forget what is needed only for versions before `keep_since`; keys are remembered.

        Raises:
            StoreError: it could not be written; all is as before.
        """
        ...

    def close(self) -> None:
        """Give back files and locks."""
        ...


def gone(version: int, oldest: int, place: Place | None = None) -> HistoryError:
    """The error for a version that is not kept any more."""
    return HistoryError(f"version {version} is not kept any more; the oldest kept is {oldest}", place=place)


def too_early(time: float, oldest: int, place: Place | None = None) -> HistoryError:
    """The error for a time before everything that is kept."""
    return HistoryError(f"time {time} is before all that is kept, which begins with version {oldest}", place=place)
