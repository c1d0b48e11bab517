"""Committed changes handed to listeners: outside the lock, in commit order, to each listener all of them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from threading import RLock

from knowledge_base.facts import Change

Listener = Callable[[Change], None]


class Announcer:
    """A queue of changes that one thread at a time delivers.

    A listener may commit changes itself; they are delivered after the current one. A thread that commits
    while another one delivers leaves its change to that thread.
    """

    def __init__(self, lock: RLock) -> None:
        self._lock = lock
        self._listeners: dict[int, Listener] = {}
        self._next_key = 0
        self._waiting: deque[tuple[Change, tuple[Listener, ...]]] = deque()
        self._delivering = False

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Call `listener` with every later change, until the function returned is called."""
        with self._lock:
            key = self._next_key
            self._next_key += 1
            self._listeners[key] = listener

        def unsubscribe() -> None:
            with self._lock:
                self._listeners.pop(key, None)

        return unsubscribe

    def add(self, change: Change) -> None:
        """Queue a change for those who listen now; called under the lock."""
        if self._listeners:
            self._waiting.append((change, tuple(self._listeners.values())))

    def deliver(self) -> None:
        """Hand over what is queued; called without the lock.

        Raises:
            ExceptionGroup: listeners failed; all others have heard everything nevertheless.
        """
        with self._lock:
            if self._delivering:
                return
            self._delivering = True
        errors: list[Exception] = []
        try:
            while (item := self._take()) is not None:
                errors += _call(*item)
        except BaseException:  # an interrupt must not leave the queue without anyone to empty it
            with self._lock:
                self._delivering = False
            raise
        if errors:
            raise ExceptionGroup("listeners to the knowledge base failed", errors)

    def _take(self) -> tuple[Change, tuple[Listener, ...]] | None:
        with self._lock:
            if self._waiting:
                return self._waiting.popleft()
            self._delivering = False
            return None


def _call(change: Change, listeners: tuple[Listener, ...]) -> list[Exception]:
    errors: list[Exception] = []
    for listener in listeners:
        try:
            listener(change)
        except Exception as error:  # noqa: BLE001  one listener must not silence the others
            errors.append(error)
    return errors
