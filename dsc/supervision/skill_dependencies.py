"""Dependencies of a running skill: its component, and the components that this component needs (S2.12)."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Iterable
from contextlib import ExitStack, suppress
from typing import TypeVar

from dsc.components.component import Component
from dsc.components.life_cycle import Life, LifeCycle
from dsc.errors import NotAliveError
from dsc.supervision.activation import ComponentActivation
from knowledge_base.errors import InputError

_Result = TypeVar("_Result")


class SkillDependencies:
    """Access of one skill to its dependencies: waits until they are active, and watches them while the skill runs.

    Attributes:
        concerned: whether the skill's component participates in activation; if not, only its own life cycle matters.
    """

    def __init__(self, activation: ComponentActivation, component: Component) -> None:
        self._activation = activation
        self._component = component
        self.concerned = component.name in activation.concerned

    @property
    def missing(self) -> str:
        """The dependency that the skill waits for, as text; empty if it waits for none."""
        if not self.concerned:
            return ""
        if reason := self._activation.waiting.get(self._component.name):
            return f"component '{self._component.name}', which waits for resources: {reason}"
        with suppress(InputError):  # `ready` raises this error
            for one in self._activation.supervisors_of(self._component):
                if not one.on:
                    known = self._activation.registry.known(one.name)
                    return self._activation.registry.state_of(one.name) + ("" if known is None else known.life.hook)
        return ""

    async def ready(self) -> None:
        """Wait until the component and its dependencies in its present mode are alive and active.

        Supervisors start the dependencies, also after a crash. The component is started one time.

        Raises:
            NotAliveError: the component itself cannot start, or is in Shutdown.
            InputError: components need each other in a cycle, or the hook `needed` of a component fails.
        """
        await (self._supervise() if self.concerned else self._component.life.come_alive())
        self._component.life.require_alive()

    async def _supervise(self) -> None:
        supervisor = self._activation.supervisor(self._component)
        before = 0 if supervisor is None else supervisor.failures

        def settled() -> bool:
            supervisor = self._activation.supervisor(self._component)
            if supervisor is None or self._component.name in self._activation.waiting:
                return False
            supervisors = list(self._activation.supervisors_of(self._component))
            for one in supervisors:
                if one.problem is not None:
                    raise one.problem
                if one.bug is not None and one.name != self._component.name:
                    raise NotAliveError(self._activation.registry.state_of(one.name)) from one.bug
            shut_down = self._component.life.state is Life.SHUTDOWN
            return all(one.on for one in supervisors) or supervisor.failures > before or shut_down

        await self._activation.until(settled)

    async def carrying(self, work: Awaitable[_Result]) -> _Result:
        """Await the skill's work while its component and the dependencies in any mode are alive; return the result.

        Raises:
            NotAliveError: the component or a dependency is lost; the work was cancelled.
        """
        me = asyncio.current_task()
        assert me is not None  # noqa: S101  # a coroutine runs in a task
        lost: list[NotAliveError] = []

        def look() -> None:
            name = self._lost()
            if name is not None and not lost and not me.cancelling():
                # The component may restart before the cancellation arrives.
                said = self._activation.registry.state_of(name)
                lost.append(NotAliveError(said if name == self._component.name else f"it needs {said}"))
                known = self._activation.registry.known(name)
                lost[0].__cause__ = None if known is None else known.life.bug
                me.cancel()

        self._component.life.listen(look)
        if self.concerned:
            self._activation.listen(look)
        if self.concerned or self._component.life.state is not Life.ALIVE:
            look()
        try:
            with ExitStack() as executing:
                for life in self._lives():
                    executing.enter_context(life.executing(me))
                return await work
        except asyncio.CancelledError:
            if not lost or me.uncancel() > 0:  # or the state was exited, too
                raise
            raise lost[0] from lost[0].__cause__
        finally:
            self._component.life.leave(look)
            if self.concerned:
                self._activation.leave(look)

    def _lives(self) -> Iterable[LifeCycle]:
        """Return the life cycles of the component and of its dependencies."""
        if not self.concerned:
            return (self._component.life,)
        with suppress(InputError):  # the next skill fails with the error
            names = [one.name for one in self._activation.supervisors_of(self._component)]
            known = [self._activation.registry.known(name) for name in (*names, self._component.name)]
            return {one.life for one in known if one is not None}
        return (self._component.life,)

    def _lost(self) -> str | None:
        if self._component.life.state is not Life.ALIVE:
            return self._component.name
        if not self.concerned:
            return None
        with suppress(InputError):  # the next skill fails with the error
            return next((one.name for one in self._activation.supervisors_of(self._component) if one.lost), None)
        return None
