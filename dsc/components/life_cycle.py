"""Life cycles of components: Init, Alive, Shutdown, FatalError (S1.2). Modes are sub-states of Alive.

The life cycle is an automaton that calls the hooks of its component, one at a time. Alive has the entry hook `start`
and the exit hook `stop`. Inside Alive, activity and mode are two regions. Their entry hooks are `activate(True)` and
`switch`; their exit hooks are `activate(False)` and `leave_mode`. An exit hook is called after its entry hook has
succeeded.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from enum import StrEnum
from typing import Any, ClassVar, Protocol

from dsc.components.hooks import (
    GRACE,
    Classes,
    active_component,
    can_end,
    contained,
    executes,
    reason_of,
    running_task,
)
from dsc.components.periodic_steps import StepCounts, step_periodically
from dsc.errors import NotAliveError, ProgrammingError
from dsc.run_log import run_logger
from knowledge_base.errors import InputError
from knowledge_base.user_objects import has_type

_LOG = run_logger(__package__)


class Life(StrEnum):
    """States of a component's life cycle; in `switch: arm`, `to: init`, a state is a command."""

    INIT = "init"
    ALIVE = "alive"
    SHUTDOWN = "shutdown"
    FATAL_ERROR = "fatal_error"


NEUTRAL = "neutral"
"""The mode of an idle component."""
TRANSITIONS = {
    Life.INIT: {Life.ALIVE, Life.SHUTDOWN, Life.FATAL_ERROR},
    Life.ALIVE: {Life.INIT, Life.SHUTDOWN, Life.FATAL_ERROR},
    Life.SHUTDOWN: {Life.INIT, Life.FATAL_ERROR},  # FatalError: the device could not be closed
    Life.FATAL_ERROR: {Life.INIT, Life.ALIVE, Life.SHUTDOWN},  # Alive: the device has recovered by itself
}


class Announcer:
    """Source of change notifications for listeners; use it only in the loop's own thread."""

    def __init__(self) -> None:
        self._listeners: dict[Callable[[], None], None] = {}  # in order, so that simulated runs repeat

    def announce(self) -> None:
        """Call the listeners."""
        for listener in tuple(self._listeners):
            listener()

    def listen(self, listener: Callable[[], None]) -> None:
        """Call the listener after each later change."""
        self._listeners[listener] = None

    def leave(self, listener: Callable[[], None]) -> None:
        """Stop calling the listener."""
        self._listeners.pop(listener, None)

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


class LifeHooks(Protocol):
    """The hooks of a component that its life cycle calls; see `ComponentHooks`."""

    name: str
    device_errors: ClassVar[Classes]
    period: float | None

    async def start(self) -> None:
        """Enter Alive."""

    async def stop(self) -> None:
        """Leave Alive."""

    async def activate(self, active: bool) -> None:  # noqa: FBT001
        """Become active, or inactive."""

    async def switch(self, mode: str) -> None:
        """Enter a mode."""

    async def leave_mode(self, mode: str) -> None:
        """Leave a mode."""

    async def step(self) -> None:
        """Execute one periodic step."""

    def watch(self, watching: bool) -> None:  # noqa: FBT001
        """Begin to watch the device before the first run, or end after the last run."""


class LifeCycle(Announcer):
    """The life cycle of one component; it announces changes of state, mode and needs.

    Args:
        hooks: the component.

    Attributes:
        state: one of `Life`.
        reason: the cause of FatalError, else empty.
        bug: the programming error that is the cause of FatalError, else `None`.
        starting: whether the component's `start` is running.
        started: whether `stop` is due, since the last `start` has succeeded.
        activated: whether `activate(False)` is due, since the last `activate(True)` has succeeded.
        steps: the numbers of periodic steps.
        runs: the number of runs in which the component is deployed; the last of them stops it.
    """

    def __init__(self, hooks: LifeHooks) -> None:
        super().__init__()
        self._hooks = hooks
        self.state = Life.INIT
        self.reason = ""
        self.bug: ProgrammingError | None = None
        self.starting = False
        self.started = False
        self.activated = False
        self.steps = StepCounts()
        self.runs = 0
        self._activators: set[int] = set()
        self._mode = NEUTRAL
        self._entered = NEUTRAL  # the mode whose `leave_mode` is due
        self._loop: asyncio.AbstractEventLoop | None = None  # of the last `start`
        self._transition: asyncio.Task[Any] | None = None  # the task that calls hooks at present
        self._hook = ""  # the last hook
        self._skills: set[asyncio.Task[Any]] = set()
        self._stepping: asyncio.Task[None] | None = None

    def __getstate__(self) -> dict[str, object]:
        """Return the state for pickling, without tasks and listeners, which stay in this process."""
        tasks = {"_loop": None, "_transition": None, "_stepping": None}
        return {**self.__dict__, **tasks, "_listeners": set(), "_skills": set()}

    @property
    def mode(self) -> str:
        """The sub-state of Alive; the mode is kept while the component is not alive, and is then entered again."""
        return self._mode

    @mode.setter
    def mode(self, mode: str) -> None:
        self._mode = mode
        self.announce()

    @property
    def active(self) -> bool:
        """Whether an activator needs the component."""
        return bool(self._activators)

    @property
    def in_transition(self) -> bool:
        """Whether a hook is being called."""
        return self._transition is not None

    @property
    def is_open(self) -> bool:
        """Whether an exit hook is due, or another hook is being called."""
        return self.started or self.activated or self.in_transition

    @property
    def hook(self) -> str:
        """The hook that is being called, see `executes`; empty if none is."""
        if self._transition is None or not self._hook:
            return ""
        return executes(f"{self._hooks.name}.{self._hook}", self._transition)

    def describe(self) -> str:
        """Return the component with its state, as text for a message."""
        why = f": {self.reason}" if self.reason else ""
        return f"component '{self._hooks.name}', which is in '{self.state}'{why}"

    def require_alive(self) -> None:
        """Raise `NotAliveError` unless the component is alive."""
        if self.state is not Life.ALIVE:
            raise NotAliveError(self.describe()) from self.bug

    # -- transitions ---------------------------------------------------------------------------------------

    async def come_alive(self) -> None:
        """Start a component in Init or FatalError; concurrent callers share one start.

        Exit hooks that are due since a failure are called first. An error of `start` or `activate` leads to FatalError.
        """
        shared = self.starting  # if that start is cancelled, this caller begins a new one
        async with self._in_order():
            if self.state not in {Life.INIT, Life.FATAL_ERROR} or (shared and self.state is Life.FATAL_ERROR):
                return
            await self._leave()  # its error is only logged: a lost device often cannot be closed
            if self.state is Life.FATAL_ERROR:
                self.become(Life.INIT)
            await self._start()
            await self._activate()

    async def ensure_alive(self) -> None:
        """Start the component if necessary; raise `NotAliveError` if it is not alive then."""
        await self.come_alive()
        self.require_alive()

    async def restart(self) -> None:
        """Leave Alive, and enter it again; the skills of the component are cancelled."""
        async with self._in_order():
            self.become(Life.INIT)
            await self.come_alive()

    async def shut_down(self) -> None:
        """Leave Alive until a restart; the skills of the component are cancelled. Raise the error of an exit hook."""
        async with self._in_order():
            self.become(Life.SHUTDOWN)
            await self._end()

    async def retire(self) -> None:
        """Call the exit hooks that are due at the end of a run; a later run starts the component again.

        Raises:
            Exception: the error of an exit hook, which leads to FatalError.
        """
        async with self._in_order():
            if self.state is Life.ALIVE:
                self.become(Life.INIT)
            await self._end()

    async def become_active(self, activator: int, *, active: bool) -> None:
        """Add or remove an activator.

        The hook `activate` is called for the first added and for the last removed activator. Its error leads to
        FatalError.

        Args:
            activator: the activator's number.
            active: `True` if the activator needs the component from now on, `False` if no longer.
        """
        (self._activators.add if active else self._activators.discard)(activator)
        async with self._in_order():
            await self._activate()
            if self.activated and not self._activators:
                try:
                    await self._deactivate()
                except Exception as error:  # noqa: BLE001  # after any error the component may have its resources
                    if self.state is Life.ALIVE:
                        self.fail(error)
                    else:
                        _LOG.warning("component '%s' cannot become inactive: %s", self._hooks.name, reason_of(error))

    async def enter(self, mode: str) -> None:
        """Leave the present mode and enter another; raise the error of a hook."""
        async with self._in_order():
            if mode != self._entered:
                await self._leave_mode()
            with self._contained("switch"):
                await self._hooks.switch(mode)
            self._entered = mode

    @property
    def works(self) -> bool:
        """Whether a skill is executed; a skill that waits to begin does not count."""
        return bool(self._skills)

    @contextmanager
    def executing(self, task: asyncio.Task[Any]) -> Iterator[None]:
        """Return a context manager in which the task executes a skill; exit hooks wait for its end."""
        self._skills.add(task)
        try:
            yield
        finally:
            self._skills.discard(task)

    # -- hooks -----------------------------------------------------------------------------------------------

    @asynccontextmanager
    async def _in_order(self) -> AsyncIterator[None]:
        """Wait until no other task calls hooks.

        A hook may request a transition, and so may a skill whose end a transition waits for; these do not wait.
        """
        task = running_task()
        if task is not None and (task is self._transition or task in self._skills):
            yield
            return
        await self.until(lambda: self._transition is None or not can_end(self._transition))
        self._transition = task
        try:
            yield
        finally:
            self._transition = None
            self.announce()

    async def _start(self) -> None:
        self.starting = True
        error: Exception | None = None
        try:
            with self._contained("start"):
                await self._hooks.start()
            self.started, self._loop = True, asyncio.get_running_loop()
        except Exception as raised:  # noqa: BLE001  # after any error the component cannot work
            error = raised
        finally:
            self.starting = False
            self.announce()
        if self.state is Life.INIT:  # else `start` itself has set the state
            if error is None:
                self.become(Life.ALIVE)
            else:
                self.fail(error)

    async def _activate(self) -> None:
        if not self._activators or self.activated or self.state is not Life.ALIVE:
            return
        try:
            with self._contained("activate"):
                await self._hooks.activate(True)  # noqa: FBT003
            self.activated = True
        except Exception as error:  # noqa: BLE001  # after any error the component lacks its resources
            if self.state is Life.ALIVE:
                self.fail(error)
        self._begin_or_end_steps()

    async def _end(self) -> None:
        """Leave Alive without a new start; raise the first error of an exit hook, which leads to FatalError."""
        error = await self._leave()
        if error is not None:
            if self.state is not Life.FATAL_ERROR:
                self.fail(error)
            raise error

    async def _leave(self) -> Exception | None:
        """Wait for the end of the skills, then call all exit hooks that are due; return the first error."""
        skills = [one for one in self._skills if one is not running_task() and can_end(one)]
        if skills:
            await asyncio.wait(skills, timeout=GRACE)
        errors: list[Exception] = []
        for leave in (self._deactivate, self._leave_mode, self._stop):
            try:
                await leave()
            except Exception as error:  # noqa: BLE001  # the other hooks are due, too
                _LOG.warning("component '%s' cannot leave 'alive': %s", self._hooks.name, reason_of(error))
                errors.append(error)
        return errors[0] if errors else None

    async def _deactivate(self) -> None:
        if self.activated:
            self.activated = False
            self._begin_or_end_steps()
            if self._stepping not in {None, running_task()} and can_end(self._stepping):
                await asyncio.wait([self._stepping], timeout=GRACE)
            with self._contained("activate"):
                await self._hooks.activate(False)  # noqa: FBT003

    async def _leave_mode(self) -> None:
        mode, self._entered = self._entered, NEUTRAL
        if mode != NEUTRAL:
            with self._contained("leave_mode"):
                await self._hooks.leave_mode(mode)

    async def _stop(self) -> None:
        if self.started:
            self.started = False
            with self._contained("stop"):
                await self._hooks.stop()

    def _begin_or_end_steps(self) -> None:
        """Begin the periodic steps of a component that is alive and active, and cancel those of any other."""
        period, before = self._hooks.period, self._stepping
        steps = before is not None and can_end(before) and not before.cancelling()
        if self.activated and self.state is Life.ALIVE and period is not None and not steps:
            self._stepping = asyncio.get_running_loop().create_task(self._step(period, before))
        elif before is not None and steps and not (self.activated and self.state is Life.ALIVE):
            before.cancel()

    async def _step(self, period: float, before: asyncio.Task[None] | None) -> None:
        if before is not None and can_end(before):
            await asyncio.wait([before], timeout=GRACE)
        try:
            with self._contained("step"):
                await step_periodically(self._hooks.step, period, self.steps)
        except Exception as error:  # noqa: BLE001  # a component that cannot step has failed
            if self.state is Life.ALIVE:
                self.fail(error)

    def _contained(self, hook: str) -> contained:
        active_component.set(self._hooks.name)
        self._hook = hook
        return contained(f"{self._hooks.name}.{hook}", self._hooks.device_errors)

    # -- states ------------------------------------------------------------------------------------------------

    def begin_run(self) -> None:
        """Add a run; the first run of a component that is not alive begins in the mode `neutral`.

        If the event loop of the last start is closed, the component returns to Init, since it cannot use that loop.
        """
        if self.state is Life.ALIVE and self._loop is not None and self._loop.is_closed():
            self.become(Life.INIT)
        if not self.runs and self.state is not Life.ALIVE:
            self.mode = NEUTRAL
        self.runs += 1
        if self.runs == 1:
            self._hooks.watch(True)  # noqa: FBT003

    def end_run(self) -> None:
        """Remove a run."""
        self.runs -= 1
        if not self.runs:
            self._hooks.watch(False)  # noqa: FBT003

    def fail(self, error: Exception) -> None:
        """Enter FatalError after an error of a hook."""
        bug = error if has_type(error, ProgrammingError) else None
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
        if state is not self.state and state not in TRANSITIONS[self.state]:
            raise InputError(f"a component in '{self.state}' cannot become '{state}'", found=state)
        self.reason, self.bug = (reason, bug) if state is Life.FATAL_ERROR else ("", None)
        if state is not self.state:
            _LOG.info("component '%s': %s%s", self._hooks.name, state, f", {reason}" if self.reason else "")
        self.state = state
        self._begin_or_end_steps()
        self.announce()
