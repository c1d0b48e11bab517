"""Activation trees: supervisors keep components active while a state or an active component needs them (S1.9, S4.1)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import suppress

from dsc.components.component import Component
from dsc.components.hooks import GRACE, abandon, contained, reason_of
from dsc.components.life_cycle import NEUTRAL, Announcer, Life
from dsc.errors import ProgrammingError
from dsc.rank import ORDINARY, Rank
from dsc.supervision.component_registry import ComponentRegistry
from dsc.supervision.room import Room, amounts_of
from knowledge_base.errors import InputError

PAUSE = 1.0
"""Seconds before a failed component is restarted; the pause doubles after each failure."""
LONGEST = 30.0
"""Maximum number of seconds between two attempts to start a component."""


class ComponentActivation(Announcer):
    """The activation tree of a run: a supervisor for each required component.

    The tree releases supervisors of components that are not required, and announces changes of components. A component
    without resources and without needs only participates if another component needs it.

    Args:
        registry: the deployed components.
        used: returns the names of the components whose skills run or clean up.

    Attributes:
        registry: the deployed components.
        concerned: names of the components that participate.
        waiting: the reasons of the components in use that wait for resources, by name.
        waits: announces changes of `waiting`.
        room: the resources of the robot; `None` if they are not limited.
    """

    def __init__(self, registry: ComponentRegistry, used: Callable[[], Iterable[str]]) -> None:
        super().__init__()
        self.registry = registry
        self._used = used
        self.concerned: set[str] = set()
        self.waiting: dict[str, str] = {}
        self.waits = Announcer()
        self.room: Room | None = None
        self._in_order: list[str] = []  # the components in use, the earliest first
        self._rank_of: Callable[[str], Rank] = lambda _: ORDINARY
        self._in_mode: dict[str, None] = {}
        self._supervisors: dict[str, Supervisor] = {}
        self._released: dict[str, asyncio.Task[None]] = {}
        self._looking = False
        self._closed = False
        self._bugs: dict[str, ProgrammingError] = {}
        for component in registry.components.values():
            self._join(component)

    @property
    def on(self) -> frozenset[str]:
        """Names of the components that are alive and active."""
        return frozenset(supervisor.name for supervisor in self._supervisors.values() if supervisor.on)

    def share(self, room: Room, rank_of: Callable[[str], Rank]) -> None:
        """Activate components only if the room has their resources; those of a larger rank come first."""
        self.room, self._rank_of = room, rank_of
        room.listen(self.look)

    def deploy(self, component: Component) -> None:
        """Add a component to the registry; it replaces a component with an equal name."""
        before = self.registry.components.get(component.name, component)
        if before is not component:
            before.life.leave(self.look)
            if component.name in self._supervisors:
                self._end(self._supervisors[component.name], ())
                self.look()
        self._join(component)
        self.registry.deploy(component)

    def _join(self, component: Component) -> None:
        kind = type(component)
        if (
            component.needs
            or component.demands
            or component.period is not None
            or kind.needed is not Component.needed
            or kind.activate is not Component.activate
        ):
            self.concerned.add(component.name)
            component.life.listen(self.look)
        else:
            self.concerned.discard(component.name)

    def changed(self, name: str) -> None:
        """Update the supervisors after a change in the use of component `name`."""
        if name in self.concerned:
            self.look()

    def look(self) -> None:
        """Schedule an update of the supervisors; all changes until the update share it."""
        if not self._looking and not self._closed:
            self._looking = True
            asyncio.get_running_loop().call_soon(self._supervise)

    def switched(self, name: str, mode: str) -> None:
        """Store that a state has switched a component to a mode."""
        if mode in {NEUTRAL, Life.SHUTDOWN}:
            self._in_mode.pop(name, None)
        else:
            self._in_mode[name] = None
        self.changed(name)

    async def close(self) -> None:
        """Release all supervisors, and wait at most `2 * GRACE` seconds until they have ended."""
        self._closed = True
        for component in self.registry.components.values():
            component.life.leave(self.look)
        self._keep_only({})
        if self.room is not None:
            self.room.leave(self.look)
        if self._released:
            # A task may wait `GRACE` for another component, then `GRACE` for its own.
            _, others = await asyncio.wait(self._released.values(), timeout=2 * GRACE)
            for task in others:
                task.cancel()
                abandon(task)

    # -- for skills and supervisors ---------------------------------------------------------------------------

    def supervisor(self, component: Component) -> Supervisor | None:
        """Return the supervisor of a component in use; the components that it needs have supervisors afterwards.

        The result is `None` while the component waits for resources.
        """
        if self._looking or component.name not in self._supervisors:
            self._supervise()
        return self._supervisors.get(component.name)

    def supervisors_of(self, component: Component) -> Iterator[Supervisor]:
        """Yield the supervisors of the components that `component` needs in its mode, then its own supervisor.

        A supervisor follows the supervisors of its component's dependencies.

        Raises:
            InputError: components need each other in a cycle, or the hook `needed` of a component fails.
        """
        for name in self._closure(component.name, {}, ()):
            if name in self._supervisors:
                yield self._supervisors[name]

    def needed(self, component: Component | None) -> tuple[str, ...]:
        """Return the names of components that `component` needs in its mode; raise `InputError` if its hook fails.

        A hook with a programming error is not called again.
        """
        if component is None:
            return ()
        name = component.name
        error: Exception | None = self._bugs.get(name)
        if error is None:
            try:
                with contained(f"{name}.needed", component.device_errors):
                    return tuple(component.needed())
            except ProgrammingError as bug:
                error = self._bugs[name] = bug
            except Exception as failure:  # noqa: BLE001  # the skill that needs the component fails
                error = failure
        raise InputError(f"`needed` of component '{name}' has failed: {reason_of(error)}") from error

    def announce(self) -> None:
        """Update the supervisors after a change of a component, then call the listeners."""
        self.look()
        super().announce()

    # -- required components ------------------------------------------------------------------------------------

    def _supervise(self) -> None:
        self._looking = False
        if self._closed:
            return
        required: dict[str, Component | None] = {}
        in_mode = [name for name in self._in_mode if self.registry.components[name].mode != NEUTRAL]
        in_use = [name for name in (*sorted(self._used()), *in_mode) if name in self.concerned]
        for name in in_use if self.room is None else self._with_room(self.room, dict.fromkeys(in_use)):
            self._require(name, None, required)
        self._keep_only(required)

    def _with_room(self, room: Room, in_use: Iterable[str]) -> Iterator[str]:
        """Yield the components in use that have their resources, and note those that wait for resources.

        Those of larger ranks come first, then those that were used earlier. None overtakes another one that waits for
        the same resource. A component that has too little for its new mode becomes inactive, unless it works. So no two
        wait for each other.
        """
        before, self.waiting = self.waiting, {}
        awaited: set[str] = set()
        names = dict.fromkeys(in_use)
        self._in_order = list(dict.fromkeys(name for name in (*self._in_order, *names) if name in names))
        for name in sorted(self._in_order, key=self._rank_of, reverse=True):
            chain: dict[str, None] = {name: None}
            with suppress(InputError):  # the skill of the component fails with this error
                chain = self._closure(name, {}, ())
            known = {one: self.registry.known(one) for one in chain}
            wanted = {one: amounts_of(found, found.mode) for one, found in known.items() if found is not None}
            resources = {resource for amounts in wanted.values() for resource in amounts}
            is_new = name not in self._supervisors
            reason = "others wait for its resources" if is_new and resources & awaited else room.take(wanted, id(self))
            if reason:
                self.waiting[name] = reason
                awaited |= resources
            root = known[name]
            if not reason or (not is_new and root is not None and root.life.works):
                yield name
        if before != self.waiting:
            super().announce()
            self.waits.announce()

    def _require(self, name: str, needing: Component | None, required: dict[str, Component | None]) -> None:
        """Add a component together with the component that needs it, then the component's own dependencies."""
        if name not in required:
            required[name] = needing
            with suppress(InputError):  # the skill of the component fails with this error
                component = self.registry.known(name)
                for other in self.needed(component):
                    self._require(other, component, required)

    def _closure(self, name: str, found: dict[str, None], above: tuple[str, ...]) -> dict[str, None]:
        if name in above:
            raise InputError(f"components need each other in a cycle: {' -> '.join((*above, name))}")
        for other in self.needed(self.registry.known(name)):
            self._closure(other, found, (*above, name))
        found[name] = None
        return found

    def _keep_only(self, required: dict[str, Component | None]) -> None:
        ended: list[asyncio.Task[None]] = []
        for supervisor in [one for one in self._supervisors.values() if one.name not in required]:
            ended.append(self._end(supervisor, tuple(ended)))
        for name, needing in required.items():
            if name not in self._supervisors:
                self._supervisors[name] = Supervisor(name, needing, self, self._released.get(name))

    def _end(self, supervisor: Supervisor, after: Collection[asyncio.Task[None]]) -> asyncio.Task[None]:
        def over(task: asyncio.Task[None]) -> None:
            if self._released.get(supervisor.name) is task:
                del self._released[supervisor.name]
            if self.room is not None and supervisor.name not in self._supervisors:
                self.room.release(supervisor.name, id(self))

        del self._supervisors[supervisor.name]
        supervisor.release(after)
        self._released[supervisor.name] = supervisor.task
        supervisor.task.add_done_callback(over)
        return supervisor.task


class Supervisor:
    """The task that keeps one component alive and active until its release, and restarts it after a crash (S2.12).

    Args:
        name: the component's name.
        needing: the component that needs it; `None` if a skill does.
        activation: the activation tree, which announces changes of the component.
        after: the task of an earlier supervisor of the component, or `None`.

    Attributes:
        name: the component's name.
        task: the task of the supervisor, which runs until the component is inactive again.
        failures: the number of failed attempts to start or activate the component.
        problem: the error in the search for the component, or in its hook `needed`; else `None`.
    """

    def __init__(
        self, name: str, needing: Component | None, activation: ComponentActivation, after: asyncio.Task[None] | None
    ) -> None:
        self.name = name
        self.failures = 0
        self.problem: Exception | None = None
        self._component: Component | None = None
        self._needing = needing
        self._activation = activation
        self._on = False
        self._was_active = False
        self._activated = False
        self._before_end: Collection[asyncio.Task[None]] = ()
        self.task = asyncio.get_running_loop().create_task(self._run(after))

    def release(self, after: Collection[asyncio.Task[None]]) -> None:
        """End supervision: the component becomes inactive, after the tasks `after` of components that needed it."""
        self._before_end = after
        self.task.cancel()

    @property
    def on(self) -> bool:
        """Whether the component is alive and active."""
        life = None if self._component is None else self._component.life
        return self._on and life is not None and life.state is Life.ALIVE and life.activated

    @property
    def bug(self) -> ProgrammingError | None:
        """The programming error in a hook of the component, after which it is in FatalError; else `None`."""
        return None if self._component is None else self._component.life.bug

    @property
    def lost(self) -> bool:
        """Whether the component has failed, was shut down, or has returned to Init."""
        life = None if self._component is None else self._component.life.state
        return life in {Life.FATAL_ERROR, Life.SHUTDOWN} or (life is Life.INIT and self._was_active)

    async def _run(self, after: asyncio.Task[None] | None) -> None:
        try:
            if after is not None:
                await asyncio.wait([after], timeout=GRACE)
            await self._supervise()
        except Exception as error:  # noqa: BLE001  # an error of `reach` or `needed`, which dependent skills raise
            self.problem = error
            self._activation.announce()
        finally:
            await self._deactivate()

    async def _supervise(self) -> None:
        self._component = component = await self._activation.registry.find(self.name, self._needing)
        component.life.listen(self._activation.announce)
        self._activation.announce()
        pause = PAUSE
        while True:
            await self._activation.until(lambda: self._activation.on.issuperset(self._activation.needed(component)))
            lasted = await self._once(component)
            pause = PAUSE if lasted > PAUSE else await _rest(component, pause)

    async def _once(self, component: Component) -> float:
        """Start and activate the component; return the seconds for which it was active."""
        await component.life.come_alive()
        if component.life.state is Life.ALIVE:
            self._activated = True
            await component.life.become_active(id(self), active=True)
        if component.life.state is not Life.ALIVE:
            self.failures += 1
            self._activation.announce()
            return 0.0
        began = asyncio.get_running_loop().time()
        self._on = self._was_active = True
        self._activation.announce()
        await component.life.until(lambda: component.life.state is not Life.ALIVE)
        self._on = False
        return asyncio.get_running_loop().time() - began

    async def _deactivate(self) -> None:
        self._on = False
        if self._component is None:
            return
        life = self._component.life
        life.leave(self._activation.announce)
        if not self._activated:
            return
        if self._before_end:
            await asyncio.wait(self._before_end, timeout=GRACE)
        try:
            async with asyncio.timeout(GRACE):
                await life.become_active(id(self), active=False)
        except TimeoutError:
            if life.state is Life.ALIVE:
                life.become(Life.FATAL_ERROR, f"it could not be switched off within {GRACE:g} s")


async def _rest(component: Component, pause: float) -> float:
    """Wait before a failed component restarts, unless it recovers earlier; return the length of the next pause.

    A component in Shutdown stays in Shutdown until a `switch` to `init`.
    """
    before = component.life.state
    with suppress(TimeoutError):
        async with asyncio.timeout(None if before is Life.SHUTDOWN else pause):
            await component.life.until(lambda: component.life.state is not before)
    return min(2 * pause, LONGEST)
