"""Keeps one component going while it is needed: alive, started anew after a crash, and switched on (S1.9, S2.12)."""

from __future__ import annotations

import asyncio
from collections.abc import Collection
from contextlib import suppress
from typing import Protocol

from dsc.components.abandonment import GRACE
from dsc.components.component import Component
from dsc.components.life_cycle import Life

PAUSE = 1.0
"""Seconds after which a component that could not start is started anew; twice as many each time it cannot."""
LONGEST = 30.0
"""Seconds between two attempts at most."""


class Surroundings(Protocol):
    """What a supervisor has to know of the others."""

    async def find(self, name: str, needing: Component | None) -> Component:
        """The component of that name, which may be deployed late."""
        ...

    async def supported(self, component: Component) -> None:
        """Wait until all that the component needs in its present mode is on."""
        ...

    def announce(self) -> None:
        """Something about a component is different."""
        ...


class Supervisor:
    """Keeps one component alive and active until it is released.

    Attributes:
        name: of the component.
        component: itself, once it is there.
        failures: how often it could not be brought to life, or not be switched on.
        problem: what went wrong when it was looked for.
    """

    def __init__(self, name: str, needing: Component | None, others: Surroundings) -> None:
        self.name = name
        self.component: Component | None = None
        self.failures = 0
        self.problem: Exception | None = None
        self._others = others
        self._on = False
        self._was_on = False
        self._after: Collection[asyncio.Task[None]] = ()
        self._switched = False
        self.task: asyncio.Task[None] | None = None
        self._needing = needing

    def begin(self, after: asyncio.Task[None] | None) -> None:
        """Keep it going from now on, once an earlier supervisor of it is done."""
        self.task = asyncio.get_running_loop().create_task(self._run(after))

    def release(self, after: Collection[asyncio.Task[None]]) -> None:
        """Nobody needs it any more: it is switched off, after those that have needed it."""
        assert self.task is not None  # noqa: S101
        self._after = after
        self.task.cancel()

    @property
    def on(self) -> bool:
        """Whether it is alive and switched on."""
        return self._on and self.component is not None and self.component.life.state is Life.ALIVE

    @property
    def lost(self) -> bool:
        """Whether it was there and is not any more, or cannot be."""
        life = None if self.component is None else self.component.life.state
        return life in {Life.FATAL_ERROR, Life.SHUTDOWN} or (life is Life.INIT and self._was_on)

    async def _run(self, after: asyncio.Task[None] | None) -> None:
        try:
            if after is not None:
                await asyncio.wait([after], timeout=GRACE)
            await self._supervise()
        except Exception as error:  # noqa: BLE001  # of who finds components; told to those who need it
            self.problem = error
            self._others.announce()
        finally:
            await self._switch_off()

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
        """One life of it; the seconds for which it was on."""
        await component.life.come_alive(component.start)
        if component.life.state is Life.ALIVE:
            self._switched = True
            await component.life.become_active(id(self), component.activate, active=True)
        if component.life.state is not Life.ALIVE:
            self.failures += 1
            self._others.announce()
            return 0.0
        began = asyncio.get_running_loop().time()
        self._on = self._was_on = True
        self._others.announce()
        await component.life.until(lambda life: life is not Life.ALIVE)
        self._on = False
        return asyncio.get_running_loop().time() - began

    async def _switch_off(self) -> None:
        self._on = False
        if self.component is None:
            return
        self.component.life.leave(self._others.announce)
        if not self._switched:
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
    """Wait before a component that has just failed is started anew, unless it is back before; the next pause.

    One that was shut down stays so until somebody says otherwise.
    """
    before = component.life.state
    with suppress(TimeoutError):
        async with asyncio.timeout(None if before is Life.SHUTDOWN else pause):
            await component.life.until(lambda life: life is not before)
    return min(2 * pause, LONGEST)
