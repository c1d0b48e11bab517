"""The lives of a run's components: announces each failure and restart, and stops the components at the end (S0 5.1)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from functools import partial

from dsc.components.component import Component
from dsc.components.hooks import GRACE, give_up, reason_of
from dsc.components.life_cycle import Life


class ComponentLives:
    """Listener to the life cycles of all components that are deployed in a run.

    Args:
        components: the components at the start of the run.
        failed: receives each component that enters FatalError.
        restarted: receives each component that is alive again after a failure.
    """

    def __init__(
        self,
        components: Iterable[Component],
        failed: Callable[[Component], None],
        restarted: Callable[[Component], None],
    ) -> None:
        self._failed = failed
        self._restarted = restarted
        self._lost: set[Component] = set()
        self._last: dict[Component, Life] = {}
        self._listeners: dict[Component, Callable[[], None]] = {}
        for component in components:
            self.add(component)

    def add(self, component: Component) -> None:
        """Listen to a component from now on."""
        if component in self._listeners:
            return
        component.life.runs += 1
        if component.life.state is Life.FATAL_ERROR:
            self._lost.add(component)
        self._last[component] = component.life.state
        self._listeners[component] = listener = partial(self._look, component)
        component.life.listen(listener)

    def _look(self, component: Component) -> None:
        before, self._last[component] = self._last[component], component.life.state
        if component.life.state is Life.FATAL_ERROR is not before:
            self._lost.add(component)
            self._failed(component)
        elif component.life.state is Life.ALIVE and component in self._lost:
            self._lost.discard(component)
            self._restarted(component)

    async def close(self, *, stop: bool) -> list[str]:
        """Stop listening; if `stop`, also stop the components that no other run has, within `GRACE` seconds.

        Returns:
            The errors of all components that could not stop.
        """
        for component, listener in self._listeners.items():
            component.life.leave(listener)
            component.life.runs -= 1
        alive = [one for one in self._listeners if one.life.state is Life.ALIVE and not one.life.runs]
        if not (stop and alive):
            return []
        tasks = {asyncio.ensure_future(one.life.retire(one.stop)): one.name for one in reversed(alive)}
        ended, others = await asyncio.wait(tasks, timeout=GRACE)
        for task in others:
            task.cancel()
            give_up(task)
        errors = {tasks[task]: task.exception() for task in ended}
        late = [f"component '{tasks[task]}' did not stop within {GRACE:g} s" for task in others]
        failed = [f"component '{name}' could not stop: {reason_of(why)}" for name, why in errors.items() if why]
        return failed + late
