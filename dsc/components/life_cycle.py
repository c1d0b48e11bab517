"""The life of a component: Init, Alive, Shutdown, FatalError (S1.2). Its modes are sub-states of Alive."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum

from knowledge_base.errors import InputError


class Life(StrEnum):
    """Where a component is in its life; as a mode (`switch: arm`, `to: init`) it is a command."""

    INIT = "init"
    ALIVE = "alive"
    SHUTDOWN = "shutdown"
    FATAL_ERROR = "fatal_error"


NEUTRAL = "neutral"
"""The mode at rest."""
_NEXT = {
    Life.INIT: {Life.ALIVE, Life.SHUTDOWN, Life.FATAL_ERROR},
    Life.ALIVE: {Life.INIT, Life.SHUTDOWN, Life.FATAL_ERROR},
    Life.SHUTDOWN: {Life.INIT},
    Life.FATAL_ERROR: {Life.INIT, Life.ALIVE, Life.SHUTDOWN},  # Alive: the device is back by itself
}


class LifeCycle:
    """One component's life; to be used inside the loop's own thread.

    Attributes:
        state: where it is.
        reason: why it is in FatalError, else empty.
    """

    def __init__(self) -> None:
        self.state = Life.INIT
        self.reason = ""
        self._mode = NEUTRAL
        self._listeners: set[Callable[[], None]] = set()

    def __getstate__(self) -> dict[str, object]:
        """What goes to another process: who listens here does not."""
        return {"state": self.state, "reason": self.reason, "_mode": self._mode, "_listeners": set()}

    @property
    def mode(self) -> str:
        """The sub-state of Alive that it is in, or would be."""
        return self._mode

    @mode.setter
    def mode(self, mode: str) -> None:
        self._mode = mode
        self.announce()

    def become(self, state: Life, reason: str = "") -> None:
        """Enter a state; nothing happens if it is there.

        Raises:
            InputError: no way leads there from the present state.
        """
        if state is not self.state and state not in _NEXT[self.state]:
            raise InputError(f"a component in '{self.state}' cannot become '{state}'", found=state)
        self.reason = reason if state is Life.FATAL_ERROR else ""
        self.state = state
        self.announce()

    def announce(self) -> None:
        """Call who listens: something is different that others rely on, e.g. whom it needs."""
        for listener in tuple(self._listeners):
            listener()

    def listen(self, listener: Callable[[], None]) -> None:
        """Call the listener after each change from now on."""
        self._listeners.add(listener)

    def leave(self, listener: Callable[[], None]) -> None:
        """Call it no longer."""
        self._listeners.discard(listener)

    @contextmanager
    def heard(self, listener: Callable[[], None]) -> Iterator[None]:
        """Inside, the listener is called after each change."""
        self.listen(listener)
        try:
            yield
        finally:
            self.leave(listener)

    async def until(self, holds: Callable[[Life], bool]) -> Life:
        """Wait for a state in which `holds` is true; returns it."""
        changed = asyncio.Event()
        with self.heard(changed.set):
            while not holds(self.state):
                changed.clear()
                await changed.wait()
        return self.state
