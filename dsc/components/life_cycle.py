"""Life cycles of components: Init, Alive, Shutdown, FatalError (S1.2). Modes are sub-states of Alive."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from enum import StrEnum

from dsc.components.hooks import contained
from knowledge_base.errors import InputError, described


class Life(StrEnum):
    """States of a component's life cycle; in `switch: arm`, `to: init`, a state is a command."""

    INIT = "init"
    ALIVE = "alive"
    SHUTDOWN = "shutdown"
    FATAL_ERROR = "fatal_error"


NEUTRAL = "neutral"
"""The mode of an idle component."""
_NEXT = {
    Life.INIT: {Life.ALIVE, Life.SHUTDOWN, Life.FATAL_ERROR},
    Life.ALIVE: {Life.INIT, Life.SHUTDOWN, Life.FATAL_ERROR},
    Life.SHUTDOWN: {Life.INIT},
    Life.FATAL_ERROR: {Life.INIT, Life.ALIVE, Life.SHUTDOWN},  # Alive: the device has recovered by itself
}


class Announcer:
    """Source of change notifications for listeners; use it only in the loop's own thread."""

    def __init__(self) -> None:
        self._listeners: set[Callable[[], None]] = set()

    def announce(self) -> None:
        """Call the listeners."""
        for listener in tuple(self._listeners):
            listener()

    def listen(self, listener: Callable[[], None]) -> None:
        """Call the listener after each later change."""
        self._listeners.add(listener)

    def leave(self, listener: Callable[[], None]) -> None:
        """Stop calling the listener."""
        self._listeners.discard(listener)

    async def until(self, holds: Callable[[], bool]) -> None:
        """Wait until `holds()` is true; call `holds` again after each change."""
        changed = asyncio.Event()
        self.listen(changed.set)
        try:
            while not holds():
                changed.clear()
                await changed.wait()
        finally:
            self.leave(changed.set)


class LifeCycle(Announcer):
    """The life cycle of one component; it announces changes of state, mode and needs.

    Attributes:
        state: one of `Life`.
        reason: the cause of FatalError, else empty.
        starting: whether the component's `start` is running.
    """

    def __init__(self) -> None:
        super().__init__()
        self.state = Life.INIT
        self.reason = ""
        self.starting = False
        self._activators: set[int] = set()
        self._mode = NEUTRAL

    def __getstate__(self) -> dict[str, object]:
        """Return the state for pickling, without listeners, which stay in this process."""
        return {**self.__dict__, "_listeners": set()}

    @property
    def mode(self) -> str:
        """The sub-state of Alive; the mode is kept while the component is not alive."""
        return self._mode

    @mode.setter
    def mode(self, mode: str) -> None:
        self._mode = mode
        self.announce()

    @property
    def active(self) -> bool:
        """Whether an activator needs the component."""
        return bool(self._activators)

    async def come_alive(self, start: Callable[[], Awaitable[None]]) -> None:
        """Start a component in Init or FatalError; concurrent callers wait for one start.

        Args:
            start: the component's hook; its error leads to FatalError.
        """
        while self.starting:  # if that start is cancelled, another caller begins a new one
            await self.until(lambda: not self.starting)
            if self.state is not Life.INIT:
                return
        if self.state is Life.FATAL_ERROR:
            self.become(Life.INIT)
        if self.state is not Life.INIT:
            return
        self.starting = True
        try:
            with contained():
                await start()
        except Exception as error:  # noqa: BLE001  # after any error the component cannot work
            became, reason = Life.FATAL_ERROR, described(error)
        else:
            became, reason = Life.ALIVE, ""
        finally:
            self.starting = False
            self.announce()
        if self.state is Life.INIT:  # else `start` itself, or a shutdown, has set the state
            self.become(became, reason)

    async def become_active(self, activator: int, activate: Callable[[bool], Awaitable[None]], *, active: bool) -> None:
        """Add or remove an activator.

        Args:
            activator: the activator's number.
            activate: the component's hook, called for the first added and for the last removed activator. Its error
                leads to FatalError.
            active: `True` if the activator needs the component from now on, `False` if no longer.
        """
        others = self._activators - {activator}
        again = activator in self._activators
        self._activators = others | {activator} if active else others
        if others or not (active or again):
            return
        try:
            with contained():
                await activate(active)
        except Exception as error:  # noqa: BLE001  # after any error the component lacks its resources
            if self.state is not Life.SHUTDOWN:
                self.become(Life.FATAL_ERROR, described(error))

    def become(self, state: Life, reason: str = "") -> None:
        """Enter a state; announce the change also if the component is in that state already.

        Raises:
            InputError: the present state has no transition to it.
        """
        if state is not self.state and state not in _NEXT[self.state]:
            raise InputError(f"a component in '{self.state}' cannot become '{state}'", found=state)
        self.reason = reason if state is Life.FATAL_ERROR else ""
        self.state = state
        self.announce()
