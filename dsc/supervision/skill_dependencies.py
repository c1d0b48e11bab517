"""What one skill rests on: its component, and all that this needs, as long as the skill goes on (S2.12)."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from contextlib import suppress
from typing import TypeVar

from dsc.components.component import Component
from dsc.components.life_cycle import Life
from dsc.supervision.activation import ComponentActivation
from dsc.supervision.component_registry import ComponentRegistry, NotAliveError
from knowledge_base.errors import InputError

_Result = TypeVar("_Result")


class SkillDependencies:
    """For one skill of a component, which counts as used."""

    def __init__(self, registry: ComponentRegistry, activation: ComponentActivation, component: Component) -> None:
        self._registry = registry
        self._activation = activation
        self._component = component
        self.concerned = component.name in activation.concerned
        self._waits = False

    @property
    def missing(self) -> str:
        """What is being waited for, in words; empty if nothing is."""
        if not self._waits:
            return ""
        name = next((one.name for one in self._activation.resting_on(self._component) if not one.on), "")
        return name and self._registry.state_of(name)

    async def ready(self) -> None:
        """Wait until all that the component needs in its present mode is alive and switched on, and it is itself.

        What it needs is started, and started anew after a crash; so is the component, once.

        Raises:
            NotAliveError: the component itself cannot start, or is in Shutdown; what it needs is waited for instead.
            InputError: components need each other in a circle.
        """
        if self.concerned:
            await self._kept()
        elif self._component.life.state is not Life.ALIVE:
            await self._component.life.come_alive(self._component.start)
        if self._component.life.state is not Life.ALIVE:
            raise NotAliveError(self._registry.state_of(self._component.name))

    async def _kept(self) -> None:
        supervisor = self._activation.supervisor(self._component)
        before = supervisor.failures

        def settled() -> bool:
            supervisors = list(self._activation.resting_on(self._component))
            for one in supervisors:
                if one.problem is not None:
                    raise one.problem
            return all(one.on for one in supervisors) or supervisor.failures > before

        self._waits = True
        await self._activation.until(settled)
        self._waits = False

    async def carrying(self, work: Awaitable[_Result]) -> _Result:
        """Do the skill's work as long as everything is alive that it rests on, in whatever mode it is.

        Raises:
            NotAliveError: something was lost; the work has been cancelled.
        """
        me = asyncio.current_task()
        lost: list[str] = []

        def look() -> None:
            name = self._lost()
            if name is not None and not lost and me is not None:
                said = self._registry.state_of(name)  # as it is now: it may be started anew before we are heard
                lost.append(said if name == self._component.name else f"it needs {said}")
                me.cancel()

        self._component.life.listen(look)
        if self.concerned:
            self._activation.listen(look)
        if self.concerned or self._component.life.state is not Life.ALIVE:
            look()
        try:
            return await work
        except asyncio.CancelledError:
            if not lost or me is None or me.uncancel() > 0:  # or the state was left, too
                raise
            raise NotAliveError(lost[0]) from None
        finally:
            self._component.life.leave(look)
            if self.concerned:
                self._activation.leave(look)

    def _lost(self) -> str | None:
        if self._component.life.state is not Life.ALIVE:
            return self._component.name
        if not self.concerned:
            return None
        with suppress(InputError):  # of a mode that makes a circle, the next skill hears
            return next((one.name for one in self._activation.resting_on(self._component) if one.lost), None)
        return None
