"""Supervisor of one required component: starts it, activates it, restarts it after a crash (S1.9, S2.12)."""

from __future__ import annotations

import asyncio
from collections.abc import Collection
from contextlib import suppress
from typing import Protocol

from dsc.components.component import Component
from dsc.components.hooks import GRACE
from dsc.components.life_cycle import Life

PAUSE = 1.0
"""Seconds before a failed component is restarted; doubled after each failure."""
LONGEST = 30.0
"""The most seconds between two attempts."""


class Surroundings(Protocol):
    """The other components, as a supervisor sees them."""

    async def find(self, name: str, needing: Component | None) -> Component:
        """Wait for the component of that name."""
        ...

    async def supported(self, component: Component) -> None:
        """Wait until the dependencies of a component in its present mode are active."""
        ...

    def announce(self) -> None:
        """A component has changed."""
        ...


class Supervisor:
    """Keeps one component alive and active until it is released.

    Attributes:
        name: of the component.
        component: itself, as soon as it was found.
        failures: the number of failed attempts to start or activate it.
        problem: the error of the search for it.
    """

    def __init__(self, name: str, needing: Component | None, others: Surroundings) -> None:
        self.name = name
        self.component: Component | None = None
        self.failures = 0
        self.problem: Exception | None = None
        self._others = others
        self._on = False
        self._was_active = False
        self._after: Collection[asyncio.Task[None]] = ()
        self._activated = False
        self.task: asyncio.Task[None] | None = None
        self._needing = needing

    def begin(self, after: asyncio.Task[None] | None) -> None:
        """Begin supervision, after the task of an earlier supervisor."""
        self.task = asyncio.get_running_loop().create_task(self._run(after))

    def release(self, after: Collection[asyncio.Task[None]]) -> None:
        """End supervision: the component becomes inactive, after those that have needed it."""
        assert self.task is not None  # noqa: S101
        self._after = after
        self.task.cancel()

    @property
    def on(self) -> bool:
        """Whether it is alive and active."""
        return self._on and self.component is not None and self.component.life.state is Life.ALIVE

    @property
    def lost(self) -> bool:
        """Whether it has failed, was shut down, or has gone back to Init."""
        life = None if self.component is None else self.component.life.state
        return life in {Life.FATAL_ERROR, Life.SHUTDOWN} or (life is Life.INIT and self._was_active)

    async def _run(self, after: asyncio.Task[None] | None) -> None:
        try:
            if after is not None:
                await asyncio.wait([after], timeout=GRACE)
            await self._supervise()
        except Exception as error:  # noqa: BLE001  # an error of `reach`; skills that need it raise it
            self.problem = error
            self._others.announce()
        finally:
            await self._deactivate()

    async def _supervise(self) -> None:
        self.component = component = await self._others.find(self.name, self._needing)
        component.life.listen(self._others.announce)
        self._others.announce()
        pause = PAUSE
        while True:
            await self._others.supported(component)
            lasted = await self._once(component)
            pause = PAUSE if lasted > PAUSE else await _rested(component, pause)

    async def _once(self, component: Component) -> float:
        """Start and activate it; return the seconds for which it was active."""
        await component.life.come_alive(component.start)
        if component.life.state is Life.ALIVE:
            self._activated = True
            await component.life.become_active(id(self), component.activate, active=True)
        if component.life.state is not Life.ALIVE:
            self.failures += 1
            self._others.announce()
            return 0.0
        began = asyncio.get_running_loop().time()
        self._on = self._was_active = True
        self._others.announce()
        await component.life.until(lambda life: life is not Life.ALIVE)
        self._on = False
        return asyncio.get_running_loop().time() - began

    async def _deactivate(self) -> None:
        self._on = False
        if self.component is None:
            return
        self.component.life.leave(self._others.announce)
        if not self._activated:
            return
        if self._after:
            await asyncio.wait(self._after, timeout=GRACE)
        try:
            async with asyncio.timeout(GRACE):
                await self.component.life.become_active(id(self), self.component.activate, active=False)
        except TimeoutError:
            if self.component.life.state is Life.ALIVE:
                self.component.life.become(Life.FATAL_ERROR, f"it could not be switched off within {GRACE:g} s")


async def _rested(component: Component, pause: float) -> float:
    """Wait before a failed component restarts, unless it recovers earlier; return the next pause.

    A component in Shutdown stays there until it is switched to `init`.
    """
    before = component.life.state
    with suppress(TimeoutError):
        async with asyncio.timeout(None if before is Life.SHUTDOWN else pause):
            await component.life.until(lambda life: life is not before)
    return min(2 * pause, LONGEST)
