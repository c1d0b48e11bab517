"""The lives of a run's components: announces each failure and restart, and stops the components at the end (S0 5.1)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial

from dsc.components.component import Component
from dsc.components.hooks import GRACE, abandon, reason_of
from dsc.components.life_cycle import Announcer, Life
from knowledge_base.errors import InputError

_READY = frozenset({Life.INIT, Life.ALIVE})
"""States after the end of a failure."""


class ComponentLives:
    """Listener to the life cycles of all components that are deployed in a run.

    Args:
        components: the components at the start of the run.
        failed: receives each component that enters FatalError.
        recovered: receives each component that can start again after a failure, and then the one that has started.

    Attributes:
        changes: announces changes of the components, and new components.
    """

    def __init__(
        self,
        components: Iterable[Component],
        failed: Callable[[Component], None],
        recovered: Callable[[Component], None],
    ) -> None:
        self._failed = failed
        self._recovered = recovered
        self._lost: set[Component] = set()
        self._last: dict[Component, Life] = {}
        self._listeners: dict[Component, Callable[[], None]] = {}
        self.changes = Announcer()
        for component in components:
            self.add(component)

    def add(self, component: Component) -> None:
        """Listen to a component from now on."""
        if component in self._listeners:
            return
        component.life.begin_run()
        if component.life.state is Life.FATAL_ERROR:
            self._lost.add(component)
        self._last[component] = component.life.state
        self._listeners[component] = listener = partial(self._look, component)
        component.life.listen(listener)
        self.changes.announce()

    def _look(self, component: Component) -> None:
        before, self._last[component] = self._last[component], component.life.state
        if component.life.state is Life.FATAL_ERROR is not before:
            self._lost.add(component)
            self._failed(component)
        elif component in self._lost and component.life.state in _READY and not component.life.in_transition:
            if component.life.state is Life.ALIVE:
                self._lost.discard(component)
            self._recovered(component)
        self.changes.announce()

    async def close(self, needed: Callable[[Component], Iterable[str]] | None) -> list[str]:
        """Stop listening; also stop the components that no other run has, each after those that need it.

        Args:
            needed: returns the names of the components that a component needs at present; `None` stops no component.

        Returns:
            The errors of all components that could not stop.
        """
        for component, listener in self._listeners.items():
            component.life.leave(listener)
            component.life.end_run()
        due = [one for one in self._listeners if one.life.is_open and not one.life.runs]
        if needed is None or not due:
            return []
        needs = {one.name: _all_needs(one, needed) for one in due}
        stopped: dict[str, asyncio.Task[str]] = {}
        for component in _dependents_first(due, needs):
            needing = [task for name, task in stopped.items() if component.name in needs[name]]
            stopped[component.name] = asyncio.ensure_future(_stop(component, needing))
        return [error for error in await asyncio.gather(*stopped.values()) if error]


async def _stop(component: Component, after: Collection[asyncio.Task[str]]) -> str:
    """Stop a component after other components have stopped; return its error, or an empty text."""
    if after:
        await asyncio.wait(after)
    stopping = asyncio.ensure_future(component.life.retire())
    await asyncio.wait([stopping], timeout=GRACE)
    if not stopping.done():
        stopping.cancel()
        abandon(stopping)
        return f"component '{component.name}' did not stop within {GRACE:g} s"
    why = stopping.exception()
    return "" if why is None else f"component '{component.name}' could not stop: {reason_of(why)}"


def _dependents_first(components: Sequence[Component], needs: Mapping[str, set[str]]) -> list[Component]:
    """Return the components in the order of their ends: each before those that it needs, the last deployed first."""
    named = {one.name: one for one in components}
    found: dict[str, None] = {}

    def visit(component: Component, above: tuple[Component, ...]) -> None:
        if component.name in found:
            return
        for name in sorted(needs[component.name] & named.keys()):
            if named[name] not in above:  # components may need each other in different modes
                visit(named[name], (*above, component))
        found[component.name] = None

    for component in components:
        visit(component, ())
    return [named[name] for name in reversed(found)]


def _all_needs(component: Component, needed: Callable[[Component], Iterable[str]]) -> set[str]:
    """Return the names of the components that a component needs at present, or in any mode."""
    needs = {name for names in component.needs.values() for name in names}
    with suppress(InputError):  # the hook `needed` of the component has failed
        needs |= set(needed(component))
    return needs
