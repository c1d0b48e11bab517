"""Activation trees: a component is active while a state or an active component needs it (S1.9, S4.1)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Iterable, Iterator

from dsc.components.component import Component
from dsc.components.hooks import GRACE, give_up
from dsc.components.life_cycle import NEUTRAL, Life
from dsc.supervision.component_registry import ComponentRegistry
from dsc.supervision.supervisor import Supervisor
from knowledge_base.errors import InputError


class ComponentActivation:
    """Gives each required component a supervisor, and releases the others.

    A component without resources and without needs takes part only if another one needs it.

    Args:
        registry: the deployed components.
        used: names of the components whose skills run or clean up.

    Attributes:
        concerned: names of the components that take part.
    """

    def __init__(self, registry: ComponentRegistry, used: Callable[[], Iterable[str]]) -> None:
        self._registry = registry
        self._used = used
        self.concerned: set[str] = set()
        self._in_mode: dict[str, None] = {}
        self._supervisors: dict[str, Supervisor] = {}
        self._released: dict[str, asyncio.Task[None]] = {}
        self._listeners: set[Callable[[], None]] = set()
        self._looking = False
        self._closed = False
        for component in registry.components.values():
            self.deployed(component)

    @property
    def on(self) -> frozenset[str]:
        """Names of the components that are alive and active."""
        return frozenset(supervisor.name for supervisor in self._supervisors.values() if supervisor.on)

    def deployed(self, component: Component) -> None:
        """Add a component before the registry has it; it may replace another one."""
        before = self._registry.components.get(component.name, component)
        if before is not component:
            before.life.leave(self.look)
            if component.name in self._supervisors:
                self._end(self._supervisors[component.name], ())
                self.look()
        if _is_concerned(component):
            self.concerned.add(component.name)
            component.life.listen(self.look)
        else:
            self.concerned.discard(component.name)

    def changed(self, name: str) -> None:
        """A component is in use from now on, or no longer."""
        if name in self.concerned:
            self.look()

    def look(self) -> None:
        """Start and stop supervisors soon, one time for all changes of a moment."""
        if not self._looking and not self._closed:
            self._looking = True
            asyncio.get_running_loop().call_soon(self._supervise)

    def switched(self, name: str, mode: str) -> None:
        """Note the mode into which a state switches a component."""
        if mode in {NEUTRAL, Life.SHUTDOWN}:
            self._in_mode.pop(name, None)
        elif mode != Life.INIT:
            self._in_mode[name] = None
        self.changed(name)

    async def close(self) -> None:
        """Release all supervisors, and wait for them within bounds."""
        self._closed = True
        for component in self._registry.components.values():
            component.life.leave(self.look)
        self._keep_only({})
        if self._released:
            _, others = await asyncio.wait(self._released.values(), timeout=2 * GRACE)  # one after the other
            for task in others:
                task.cancel()
                give_up(task)

    # -- for skills and supervisors ---------------------------------------------------------------------------

    def supervisor(self, component: Component) -> Supervisor:
        """The supervisor of a component in use; the components that it needs have theirs from now on."""
        if self._looking or component.name not in self._supervisors:
            self._supervise()
        return self._supervisors[component.name]

    def supervisors_of(self, component: Component) -> Iterator[Supervisor]:
        """The supervisors of the components that one needs in its mode, dependencies first; then its own.

        Raises:
            InputError: components need each other in a cycle.
        """
        for name in self._closure(component.name, {}, ()):
            if name in self._supervisors:
                yield self._supervisors[name]

    def listen(self, listener: Callable[[], None]) -> None:
        """Call the listener after each change of a component."""
        self._listeners.add(listener)

    def leave(self, listener: Callable[[], None]) -> None:
        """Stop calling the listener."""
        self._listeners.discard(listener)

    def announce(self) -> None:
        """A component has changed: update the supervisors, then call the listeners."""
        self.look()
        for listener in tuple(self._listeners):
            listener()

    async def until(self, holds: Callable[[], bool]) -> None:
        """Wait until `holds` is true; evaluate it after each change of a component."""
        changed = asyncio.Event()
        self.listen(changed.set)
        try:
            while not holds():
                changed.clear()
                await changed.wait()
        finally:
            self.leave(changed.set)

    async def find(self, name: str, needing: Component | None) -> Component:
        """The component of that name, which may be deployed late."""
        return self._registry.components[name] if needing is None else await self._registry.find(name, needing)

    async def supported(self, component: Component) -> None:
        """Wait until the dependencies of a component in its present mode are active."""
        await self.until(lambda: self.on.issuperset(component.needed()))

    # -- required components ------------------------------------------------------------------------------------

    def _supervise(self) -> None:
        self._looking = False
        if self._closed:
            return
        needed: dict[str, Component | None] = {}
        in_mode = [name for name in self._in_mode if self._registry.components[name].mode != NEUTRAL]
        for name in (*sorted(self._used()), *in_mode):
            if name in self.concerned:
                self._add_needed(name, None, needed)
        self._keep_only(needed)

    def _add_needed(self, name: str, needing: Component | None, needed: dict[str, Component | None]) -> None:
        """Add a component with the one that needs it, then its own dependencies."""
        if name not in needed:
            needed[name] = needing
            component = self._registry.known(name)
            for other in () if component is None else component.needed():
                self._add_needed(other, component, needed)

    def _closure(self, name: str, found: dict[str, None], above: tuple[str, ...]) -> dict[str, None]:
        if name in above:
            raise InputError(f"components need each other in a cycle: {' -> '.join((*above, name))}")
        component = self._registry.known(name)
        for other in () if component is None else component.needed():
            self._closure(other, found, (*above, name))
        found[name] = None
        return found

    def _keep_only(self, needed: dict[str, Component | None]) -> None:
        ended: list[asyncio.Task[None]] = []
        for supervisor in [one for one in self._supervisors.values() if one.name not in needed]:
            ended.append(self._end(supervisor, tuple(ended)))
        for name, needing in needed.items():
            if name not in self._supervisors:
                self._supervisors[name] = Supervisor(name, needing, self)
                self._supervisors[name].begin(self._released.get(name))

    def _end(self, supervisor: Supervisor, after: Collection[asyncio.Task[None]]) -> asyncio.Task[None]:
        del self._supervisors[supervisor.name]
        supervisor.release(after)
        assert supervisor.task is not None  # noqa: S101
        self._released[supervisor.name] = supervisor.task
        supervisor.task.add_done_callback(lambda task: self._over(supervisor.name, task))
        return supervisor.task

    def _over(self, name: str, task: asyncio.Task[None]) -> None:
        if self._released.get(name) is task:
            del self._released[name]


def _is_concerned(component: Component) -> bool:
    """Whether the component needs others, or takes resources while it is active."""
    kind = type(component)
    return bool(component.needs) or kind.needed is not Component.needed or kind.activate is not Component.activate
