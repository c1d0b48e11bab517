"""Registry of the deployed components, and of components in other processes that deployed ones need (S2.12)."""

from __future__ import annotations

import asyncio
from collections.abc import MutableMapping

from dsc.components.component import Component
from dsc.components.hooks import contained
from knowledge_base.errors import UnknownNameError


class ComponentRegistry:
    """The deployed components, and the components that were reached in other processes.

    Attributes:
        components: the deployed components, by name.
    """

    def __init__(self, components: MutableMapping[str, Component]) -> None:
        self.components = components
        self._reached: dict[str, Component] = {}
        self._deployed = asyncio.Event()

    def deploy(self, component: Component) -> None:
        """Add a component, also during a run; it replaces a component with an equal name."""
        self.components[component.name] = component
        self._deployed.set()

    def known(self, name: str) -> Component | None:
        """Return the component of that name if it is deployed or has been reached, else `None`."""
        return self.components.get(name) or self._reached.get(name)

    async def find(self, name: str, needing: Component | None) -> Component:
        """Return the component of that name.

        If the component is unknown, wait until it is deployed, or until component `needing` has reached it in another
        process.

        Raises:
            KeyError: the component is unknown, and `needing` is `None`.
        """
        found = self.known(name)
        if found is not None or needing is None:
            return found or self.components[name]
        loop = asyncio.get_running_loop()
        here, there = loop.create_task(self._until_deployed(name)), loop.create_task(_reached(needing, name))
        try:
            await asyncio.wait((here, there), return_when=asyncio.FIRST_COMPLETED)
            if there.done():
                self._reached[name] = there.result()
        finally:
            here.cancel()
            there.cancel()
        return self.components.get(name) or self._reached[name]

    async def _until_deployed(self, name: str) -> None:
        while name not in self.components:
            self._deployed.clear()
            await self._deployed.wait()

    def state_of(self, name: str) -> str:
        """Return the state of a component as text for a message."""
        component = self.known(name)
        if component is None:
            return str(UnknownNameError(f"component '{name}', which is not there", found=name, valid=self.components))
        return component.life.describe()


async def _reached(needing: Component, name: str) -> Component:
    with contained(f"{needing.name}.reach", needing.device_errors):
        return await needing.reach(name)
