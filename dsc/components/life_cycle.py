"""Life cycles of components: Init, Alive, Shutdown, FatalError (S1.2). Modes are sub-states of Alive."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from enum import StrEnum

from dsc.components.hooks import Classes, contained, reason_of
from dsc.errors import ProgrammingError
from knowledge_base.errors import InputError

_LOG = logging.getLogger(__package__)


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

    Args:
        component: the component's name.
        raises: the exceptions that the component declares.

    Attributes:
        state: one of `Life`.
        reason: the cause of FatalError, else empty.
        bug: the programming error that is the cause of FatalError, else `None`.
        starting: whether the component's `start` is running.
        runs: the number of runs in which the component is deployed; the last of them stops it.
    """

    def __init__(self, component: str = "", raises: Classes = ()) -> None:
        super().__init__()
        self._component = component
        self._raises = raises
        self.state = Life.INIT
        self.reason = ""
        self.bug: ProgrammingError | None = None
        self.starting = False
        self.runs = 0
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
        error: Exception | None = None
        try:
            with contained(f"{self._component}.start", self._raises):
                await start()
        except Exception as raised:  # noqa: BLE001  # after any error the component cannot work
            error = raised
        finally:
            self.starting = False
            self.announce()
        if self.state is Life.INIT:  # else `start` itself, or a shutdown, has set the state
            if error is None:
                self.become(Life.ALIVE)
            else:
                self.fail(error)

    async def retire(self, stop: Callable[[], Awaitable[None]]) -> None:
        """Return a component that is alive to Init at the end of a run, so that a later run starts it again.

        Args:
            stop: the component's hook; its error leads to FatalError, and is raised.
        """
        if self.state is not Life.ALIVE:
            return
        try:
            with contained(f"{self._component}.stop", self._raises):
                await stop()
        except Exception as error:
            self.fail(error)
            raise
        if self.state is Life.ALIVE:  # else `stop` itself has set the state
            self.become(Life.INIT)

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
            with contained(f"{self._component}.activate", self._raises):
                await activate(active)
        except Exception as error:  # noqa: BLE001  # after any error the component lacks its resources
            if self.state is not Life.SHUTDOWN:
                self.fail(error)

    def fail(self, error: Exception) -> None:
        """Enter FatalError after an error of a hook."""
        bug = error if isinstance(error, ProgrammingError) else None
        self.become(Life.FATAL_ERROR, reason_of(error), bug)

    def become(self, state: Life, reason: str = "", bug: ProgrammingError | None = None) -> None:
        """Enter a state; announce the change also if the component is in that state already.

        Args:
            state: the new state.
            reason: the cause of FatalError.
            bug: the programming error that is this cause.

        Raises:
            InputError: the present state has no transition to it.
        """
        if state is not self.state and state not in _NEXT[self.state]:
            raise InputError(f"a component in '{self.state}' cannot become '{state}'", found=state)
        self.reason, self.bug = (reason, bug) if state is Life.FATAL_ERROR else ("", None)
        if state is not self.state:
            _LOG.info("component '%s': %s%s", self._component, state, f", {reason}" if self.reason else "")
        self.state = state
        self.announce()
