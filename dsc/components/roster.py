"""Who is deployed, and whether what a component needs is there: waited for, lost, back again (S2.12)."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, MutableMapping
from typing import TYPE_CHECKING, TypeVar

from dsc.components.life import Life
from knowledge_base.errors import InputError

if TYPE_CHECKING:
    from dsc.components.component import Component

_Result = TypeVar("_Result")


class NotAliveError(Exception):
    """A component that is needed is not alive, and why."""


class Roster:
    """The deployed components by name, and who needs whom."""

    def __init__(self, components: MutableMapping[str, Component]) -> None:
        self._components = components
        self._reached: dict[str, Component] = {}
        self._deployed = asyncio.Event()

    def deploy(self, component: Component) -> None:
        """Add a component, maybe late; it replaces one of the same name."""
        self._components[component.name] = component
        self._deployed.set()

    async def ready(self, component: Component) -> list[Component]:
        """Wait until all that the component needs in its present mode is alive, then bring it to life itself.

        Returns:
            The component and all that it needs, directly or not.

        Raises:
            NotAliveError: the component itself is in FatalError or Shutdown; what it needs is waited for instead.
            InputError: components need each other in a circle.
        """
        found: dict[str, Component] = {}
        await self._needed(component, found, ())
        await component.come_alive()
        if component.life.state is not Life.ALIVE:
            raise NotAliveError(_state_of(component))
        return [component, *found.values()]

    async def with_support(self, component: Component, work: Awaitable[_Result], support: list[Component]) -> _Result:
        """Do a skill's work as long as everything is alive that it needs.

        Raises:
            NotAliveError: something was lost; the work has been cancelled.
        """
        me = asyncio.current_task()
        lost: list[Component] = []

        def changed() -> None:
            if not lost and me is not None and (dead := next(filter(_is_not_alive, support), None)) is not None:
                lost.append(dead)
                me.cancel()

        for one in support:
            one.life.listen(changed)
        try:
            return await work
        except asyncio.CancelledError:
            if not lost or me is None or me.uncancel() > 0:  # or the state was left, too
                raise
            said = _state_of(lost[0])
            raise NotAliveError(said if lost[0] is component else f"it needs {said}") from None
        finally:
            for one in support:
                one.life.leave(changed)

    async def _needed(self, component: Component, found: dict[str, Component], above: tuple[str, ...]) -> None:
        if component.name in above:
            raise InputError(f"components need each other in a circle: {' -> '.join((*above, component.name))}")
        for name in component.needed():
            needed = found[name] = await self._find(name, component)
            await self._needed(needed, found, (*above, component.name))
            await needed.come_alive()
            await needed.life.until(lambda life: life is Life.ALIVE)

    async def _find(self, name: str, needing: Component) -> Component:
        """The component of that name: deployed here, maybe late, or where the one who needs it can reach it."""
        if name not in self._components and name not in self._reached:
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


def _is_not_alive(component: Component) -> bool:
    return component.life.state is not Life.ALIVE


def _state_of(component: Component) -> str:
    why = f": {component.life.reason}" if component.life.reason else ""
    return f"component '{component.name}', which is in '{component.life.state}'{why}"
