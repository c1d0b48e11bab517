"""Who is deployed, and whether what a component needs is there: waited for, lost, started anew (S2.12)."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, MutableMapping
from contextlib import suppress
from typing import TYPE_CHECKING

from dsc.components.life import Life
from knowledge_base.errors import UnknownNameError

if TYPE_CHECKING:
    from dsc.components.component import Component

PAUSE = 1.0
"""Seconds after which a component that could not start is started anew; twice as many each time it cannot."""
LONGEST = 30.0
"""Seconds between two attempts at most."""


class NotAliveError(Exception):
    """A component that is needed is not alive, and why."""


class Roster:
    """The deployed components by name, and those elsewhere that these need."""

    def __init__(self, components: MutableMapping[str, Component]) -> None:
        self._components = components
        self._reached: dict[str, Component] = {}
        self._deployed = asyncio.Event()

    @property
    def components(self) -> Mapping[str, Component]:
        """Those that are deployed, by name."""
        return self._components

    def deploy(self, component: Component) -> None:
        """Add a component, maybe late; it replaces one of the same name."""
        self._components[component.name] = component
        self._deployed.set()

    def known(self, name: str) -> Component | None:
        """The component of that name, if it is here or has been reached."""
        return self._components.get(name) or self._reached.get(name)

    async def find(self, name: str, needing: Component) -> Component:
        """The component of that name: deployed here, maybe late, or where the one who needs it can reach it."""
        found = self.known(name)
        if found is not None:
            return found
        loop = asyncio.get_running_loop()
        here, there = loop.create_task(self._until_deployed(name)), loop.create_task(needing.reach(name))
        try:
            await asyncio.wait((here, there), return_when=asyncio.FIRST_COMPLETED)
            if there.done():
                self._reached[name] = there.result()
        finally:
            here.cancel()
            there.cancel()
        return self._components.get(name) or self._reached[name]

    async def _until_deployed(self, name: str) -> None:
        while name not in self._components:
            self._deployed.clear()
            await self._deployed.wait()

    def state_of(self, name: str) -> str:
        """How a component is, in words."""
        component = self.known(name)
        if component is None:
            return str(UnknownNameError(f"component '{name}', which is not there", found=name, valid=self._components))
        why = f": {component.life.reason}" if component.life.reason else ""
        return f"component '{name}', which is in '{component.life.state}'{why}"


async def kept_trying(component: Component) -> None:
    """Bring a component to life: start it, and again after a pause if it cannot start; wait if it is shut down."""
    pause = PAUSE
    while True:
        await component.come_alive()
        if component.life.state is Life.ALIVE:
            return
        before = component.life.state
        with suppress(TimeoutError):
            async with asyncio.timeout(None if before is Life.SHUTDOWN else pause):
                await component.life.until(lambda life, before=before: life is not before)  # type: ignore[misc]
        pause = min(2 * pause, LONGEST)
