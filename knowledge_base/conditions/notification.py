"""Notifications of commits: to listeners outside the lock and in commit order, and to coroutines that wait."""

from __future__ import annotations

from asyncio import AbstractEventLoop, Future, get_running_loop
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import count
from typing import Generic, TypeVar

from knowledge_base.errors import described
from knowledge_base.facts import Change
from knowledge_base.world.read_write_lock import ReadWriteLock

Listener = Callable[[Change], None]
_T = TypeVar("_T")


class Notifier:
    """A queue of calls that one thread at a time makes.

    A listener may commit changes itself; their notifications follow the current one. A thread that commits while
    another one delivers leaves its notifications to that thread.

    Attributes:
        lock: lock of the world.
        version: version of the latest change.
        quiet: whether nothing is delivered; set by a thread that is alone, for the block of its transaction.
        queue: appends a call; to be used under the lock.
    """

    def __init__(self, lock: ReadWriteLock, version: int = 0) -> None:
        self.lock = lock
        self.version = version
        self.quiet = False
        self._listeners: dict[int, Listener] = {}
        self._keys = count()
        self._waiting: deque[Callable[[], None]] = deque()
        self.queue = self._waiting.append
        self._deliverer: object | None = None

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Call `listener` with every later change; return a function that ends that."""
        with self.lock:
            key = next(self._keys)
            self._listeners[key] = listener

        def unsubscribe() -> None:
            with self.lock:
                self._listeners.pop(key, None)

        return unsubscribe

    def add(self, change: Change) -> None:
        """Queue a change for the present listeners; to be called under the lock."""
        self.version = change.version
        for listener in self._listeners.values():
            self._waiting.append(partial(listener, change))

    def deliver(self) -> None:
        """Make the queued calls; to be called without the lock.

        Raises:
            ExceptionGroup: listeners failed; all others were called nevertheless.
        """
        if not self._waiting:  # another thread delivers its own calls
            return
        me, errors = object(), list[Exception]()
        try:
            while (call := self._next(me)) is not None:
                try:
                    call()
                except Exception as error:  # noqa: BLE001  one listener must not silence the others
                    errors.append(error)
                except (SystemExit, GeneratorExit) as error:  # neither may end the program
                    errors.append(RuntimeError(described(error)))
        except BaseException:  # after an interrupt another thread must be able to deliver
            if self._deliverer is me:
                self._deliverer = None
            raise
        if errors:
            raise ExceptionGroup("listeners to the knowledge base failed", errors)

    def _next(self, deliverer: object) -> Callable[[], None] | None:
        """Return the next call, if this deliverer may make it."""
        with self.lock:
            if self._deliverer is None and not self.quiet:
                self._deliverer = deliverer
            if self._deliverer is not deliverer:
                return None
            if self._waiting:
                return self._waiting.popleft()
            self._deliverer = None
            return None


class Waiters(Generic[_T]):
    """Futures of any event loop that an event in any thread completes; the owner guards them with a lock."""

    def __init__(self) -> None:
        self._waiting: dict[Future[_T], AbstractEventLoop] = {}

    def join(self) -> Future[_T]:
        """Return a future of the running loop that the next `answer` completes."""
        loop = get_running_loop()
        future: Future[_T] = loop.create_future()
        self._waiting[future] = loop
        return future

    def leave(self, future: Future[_T]) -> None:
        """Forget the future."""
        self._waiting.pop(future, None)

    def answer(self, result: _T | Exception) -> None:
        """Complete all futures with a value or an exception."""
        waiting, self._waiting = self._waiting, {}
        for future, loop in waiting.items():
            with suppress(RuntimeError):  # the loop is closed, and with it the coroutine
                loop.call_soon_threadsafe(_complete, future, result)


def _complete(future: Future[_T], result: _T | Exception) -> None:
    if future.done():  # its task was cancelled
        return
    if isinstance(result, Exception):
        future.set_exception(result)
    else:
        future.set_result(result)
