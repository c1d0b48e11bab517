"""What one skill rests on: its component, and all that this needs, as long as the skill goes on (S2.12)."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from typing import TYPE_CHECKING, TypeVar

from dsc.components.life import Life
from dsc.components.roster import NotAliveError, Roster, kept_trying
from knowledge_base.errors import InputError

if TYPE_CHECKING:
    from dsc.components.component import Component

_Result = TypeVar("_Result")


class Support:
    """For one skill of a component."""

    def __init__(self, roster: Roster, component: Component) -> None:
        self._roster = roster
        self._component = component
        self._awaited: str | None = None
        self._found: dict[str, Component] = {}

    @property
    def missing(self) -> str:
        """What is being waited for, in words; empty if nothing is."""
        return "" if self._awaited is None else self._roster.state_of(self._awaited)

    async def ready(self) -> None:
        """Wait until all that the component needs in its present mode is alive, then bring it to life itself.

        What it needs is started, and started anew after a crash; so is the component, once.

        Raises:
            NotAliveError: the component itself cannot start, or is in Shutdown; what it needs is waited for instead.
            InputError: components need each other in a circle.
        """
        await self._needed(self._component, ())
        await self._component.come_alive()
        if self._component.life.state is not Life.ALIVE:
            raise NotAliveError(self._roster.state_of(self._component.name))

    async def _needed(self, component: Component, above: tuple[str, ...]) -> None:
        if component.name in above:
            raise InputError(f"components need each other in a circle: {' -> '.join((*above, component.name))}")
        for name in component.needed():
            self._awaited = name
            needed = self._found[name] = await self._roster.find(name, component)
            await self._needed(needed, (*above, component.name))
            self._awaited = name
            await kept_trying(needed)
            self._awaited = None

    async def carrying(self, work: Awaitable[_Result]) -> _Result:
        """Do the skill's work as long as everything is alive that it rests on.

        Raises:
            NotAliveError: something was lost; the work has been cancelled.
        """
        me, support = asyncio.current_task(), (self._component, *self._found.values())
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
            said = self._roster.state_of(lost[0].name)
            raise NotAliveError(said if lost[0] is self._component else f"it needs {said}") from None
        finally:
            for one in support:
                one.life.leave(changed)


def _is_not_alive(component: Component) -> bool:
    return component.life.state is not Life.ALIVE
