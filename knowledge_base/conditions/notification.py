"""What a commit tells others: outside the lock, in commit order, to each listener all of it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

from knowledge_base.errors import described
from knowledge_base.facts import Change
from knowledge_base.world.read_write_lock import ReadWriteLock

Listener = Callable[[Change], None]


class Notifier:
    """A queue of calls that one thread at a time makes.

    A listener may commit changes itself; they are delivered after the current one. A thread that commits
    while another one delivers leaves its change to that thread.
    """

    def __init__(self, lock: ReadWriteLock) -> None:
        self._lock = lock
        self._listeners: dict[int, Listener] = {}
        self._next_key = 0
        self._waiting: deque[Callable[[], None]] = deque()
        self._deliverer: object | None = None
        self._quiet = False

    @contextmanager
    def quiet(self) -> Iterator[None]:
        """Nothing is delivered meanwhile; used by the thread that is alone, for the block of its transaction."""
        self._quiet = True
        try:
            yield
        finally:
            self._quiet = False

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
        self._waiting.extend(partial(listener, change) for listener in self._listeners.values())

    def queue(self, call: Callable[[], None]) -> None:
        """Queue a call after what is queued already; called under the lock."""
        self._waiting.append(call)

    def deliver(self) -> None:
        """Make the queued calls; called without the lock.

        Raises:
            ExceptionGroup: listeners failed; all others have heard everything nevertheless.
        """
        if not self._waiting:  # what another thread is about to queue it delivers itself
            return
        me, errors = object(), list[Exception]()
        try:
            with self._lock:
                if self._deliverer is not None or self._quiet:
                    return
                self._deliverer = me
            while (call := self._take()) is not None:
                try:
                    call()
                except Exception as error:  # noqa: BLE001  one listener must not silence the others
                    errors.append(error)
                except (SystemExit, GeneratorExit) as error:  # neither may end the program
                    errors.append(RuntimeError(described(error)))
        except BaseException:  # an interrupt must not leave the queue without anyone to empty it
            if self._deliverer is me:
                self._deliverer = None
            raise
        if errors:
            raise ExceptionGroup("listeners to the knowledge base failed", errors)

    def _take(self) -> Callable[[], None] | None:
        with self._lock:
            if self._waiting:
                return self._waiting.popleft()
            self._deliverer = None
            return None
