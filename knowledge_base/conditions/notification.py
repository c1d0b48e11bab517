"""Notifications of commits: calls of listeners after the lock is released, and results for waiting coroutines."""

from __future__ import annotations

from asyncio import AbstractEventLoop, Future, get_running_loop
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import count
from typing import Generic, TypeVar

from knowledge_base.facts import Change
from knowledge_base.user_objects import as_exception
from knowledge_base.world.read_write_lock import ReadWriteLock

Listener = Callable[[Change], None]
_T = TypeVar("_T")


class Notifier:
    """A queue of calls that only one thread at a time makes.

    A listener may itself commit changes; their notifications follow the current notification. If another thread is
    delivering, a committing thread leaves its notifications to that thread.

    Attributes:
        lock: lock of the world.
        version: version of the latest change.
        quiet: whether delivery is suspended; the thread of an open transaction sets this attribute.
        queue: appends a call; the caller must hold the lock.
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
        """Call `listener` with every later change; return a function that ends the subscription."""
        with self.lock:
            key = next(self._keys)
            self._listeners[key] = listener

        def unsubscribe() -> None:
            with self.lock:
                self._listeners.pop(key, None)

        return unsubscribe

    def add(self, change: Change) -> None:
        """Queue a change for the present listeners; the caller must hold the lock."""
        self.version = change.version
        for listener in self._listeners.values():
            self._waiting.append(partial(listener, change))

    def deliver(self) -> None:
        """Make the queued calls; the caller must not hold the lock.

        Raises:
            ExceptionGroup: at least one listener raised an exception; all other listeners were called nevertheless.
        """
        if not self._waiting:  # another thread delivers its own calls
            return
        me, errors = object(), list[Exception]()
        try:
            while (call := self._next(me)) is not None:
                try:
                    call()
                except Exception as error:  # noqa: BLE001  a failing listener must not prevent the calls of the others
                    errors.append(error)
                except (SystemExit, GeneratorExit) as error:  # a listener must not end the program
                    errors.append(as_exception(error))
        except BaseException:  # after an interrupt, another thread must be able to deliver
            if self._deliverer is me:
                self._deliverer = None
            raise
        if errors:
            raise ExceptionGroup("listeners to the knowledge base failed", errors)

    def _next(self, deliverer: object) -> Callable[[], None] | None:
        """Return the next call, or `None` if the queue is empty or another thread delivers."""
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
        """Return a future of the running event loop; the next call of `answer` completes the future."""
        loop = get_running_loop()
        future: Future[_T] = loop.create_future()
        self._waiting[future] = loop
        return future

    def leave(self, future: Future[_T]) -> None:
        """Remove the future."""
        self._waiting.pop(future, None)

    def answer(self, result: _T | Exception) -> None:
        """Complete all futures with a value or an exception, and remove them."""
        waiting, self._waiting = self._waiting, {}
        for future, loop in waiting.items():
            with suppress(RuntimeError):  # the event loop is closed, and so is the coroutine
                loop.call_soon_threadsafe(_complete, future, result)


def _complete(future: Future[_T], result: _T | Exception) -> None:
    if future.done():  # the task of the future was cancelled
        return
    if isinstance(result, Exception):
        future.set_exception(result)
    else:
        future.set_result(result)
