"""Coroutines of any event loop that wait for something which may happen in any thread."""

from __future__ import annotations

from asyncio import AbstractEventLoop, Future, get_running_loop
from collections.abc import Callable
from contextlib import suppress
from typing import Generic, TypeVar

_T = TypeVar("_T")


class Waiters(Generic[_T]):
    """The futures that an event answers; the owner guards it with a lock."""

    def __init__(self) -> None:
        self._waiting: dict[Future[_T], AbstractEventLoop] = {}

    def join(self) -> Future[_T]:
        """A future of the running loop that the next `answer` or `fail` completes."""
        loop = get_running_loop()
        future: Future[_T] = loop.create_future()
        self._waiting[future] = loop
        return future

    def leave(self, future: Future[_T]) -> None:
        """Nobody awaits that future any more."""
        self._waiting.pop(future, None)

    def answer(self, value: _T) -> None:
        """Whoever waits gets `value`."""
        self._complete(lambda future: future.set_result(value))

    def fail(self, error: Exception) -> None:
        """Whoever waits meets `error`."""
        self._complete(lambda future: future.set_exception(error))

    def _complete(self, settle: Callable[[Future[_T]], None]) -> None:
        waiting, self._waiting = self._waiting, {}
        for future, loop in waiting.items():
            with suppress(RuntimeError):  # the loop is closed, so nobody waits there any more
                loop.call_soon_threadsafe(_unless_done, future, settle)


def _unless_done(future: Future[_T], settle: Callable[[Future[_T]], None]) -> None:
    if not future.done():  # its task may have been cancelled meanwhile
        settle(future)
