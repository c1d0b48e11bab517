"""The outbox: delivers parameters, modes and messages to each component in the order of dispatch."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Collection, Iterable, Iterator, Sequence
from functools import partial

from dsc.components.component import Component
from dsc.components.hooks import GRACE, contained, reason_of
from dsc.components.life_cycle import Life
from dsc.engine.steps import SendMessage, SetParameter, SwitchMode
from dsc.messages import Told
from dsc.sequencer.message_checks import encoded

CLOSING = GRACE
"""Seconds for components to receive their last outputs, and for cancelled skills to stop."""
_LIFE_HOOKS = frozenset({"start", "stop"})
"""Hooks that a component in Init may receive; it is started before all others."""
_MOST_REFUSED = 1000
"""Upper bound of the number of stored refusals; a run without a store never reads them."""


Configuring = dict[str, asyncio.Task[None]]
"""Deliveries of the parameters and modes of a macrostep, by component."""


class Outbox:
    """One-way outputs that components have not received yet, and outputs that they refused.

    Attributes:
        untaken: by component, the task that delivers the latest output; removed when a skill has waited for the task.
        configuring: by component, the task that delivers the latest parameter or mode of the present macrostep.
    """

    def __init__(self) -> None:
        self.untaken: dict[str, asyncio.Task[None]] = {}
        self.configuring: Configuring = {}
        self._under_way: dict[int, Told] = {}
        self._refused: deque[Told] = deque(maxlen=_MOST_REFUSED)
        self._parameters: dict[str, dict[str, SetParameter]] = {}  # the effective ones, by component
        self._modes: dict[str, SwitchMode] = {}
        self._forgotten: set[str] = set()  # components that have started again without their settings
        self._last = 0

    @property
    def under_way(self) -> Collection[Told]:
        """Outputs that were neither received nor refused yet."""
        return self._under_way.values()

    def refused(self) -> Collection[Told]:
        """Return the outputs that components have refused since the last call."""
        if not self._refused:  # the common case; each stored macrostep reads it
            return ()
        refused = tuple(self._refused)
        self._refused.clear()
        return refused

    def begin_step(self) -> None:
        """Begin the outputs of another macrostep."""
        if self.configuring:
            self.configuring = {}

    def send(self, component: Component, told: Told) -> None:
        """Deliver an output to the component, after all earlier outputs."""
        self._begin(component, _hook_of(told), (told,), lambda: self._take(component, told))
        if not isinstance(told, SendMessage):
            self.configuring[component.name] = self.untaken[component.name]

    def restore(self, component: Component, effective: Sequence[SetParameter | SwitchMode]) -> None:
        """Deliver the settings that were effective before a restart: the parameters as one set, then the modes."""
        parameters = [one for one in effective if isinstance(one, SetParameter)]
        if parameters:
            values = {one.parameter: one.value for one in parameters}
            self._begin(component, "configure_all", parameters, lambda: component.configure_all(encoded(values)))
        for one in effective:
            if isinstance(one, SwitchMode):
                self._begin(component, "switch", (one,), partial(_restore_mode, component, one.mode))

    def repeat(self, component: Component) -> None:
        """Deliver the effective settings again, since the component has started again after a failure."""
        if component.name in self._parameters or component.name in self._modes:
            self._forgotten.add(component.name)
            self._begin(component, "configure_all", (), lambda: self._configure(component))

    def remind(self, component: Component) -> None:
        """Deliver the effective settings again if the component has refused them after its last start."""
        if component.name in self._forgotten and component.name not in self.untaken:
            self.repeat(component)

    async def _take(self, component: Component, told: Told) -> None:
        match told:
            case SetParameter():
                await component.configure(told.parameter, encoded(told.value))
            case SwitchMode():
                await component.change_mode(told.mode)
                if told.mode == Life.INIT:
                    self._forgotten.add(component.name)
                    await self._configure(component)
            case SendMessage():
                await component.receive(told.port, encoded(told.arguments))

    async def _configure(self, component: Component) -> None:
        """Pass the effective parameters, as one set, and then the mode to a component that has started again."""
        name = component.name
        values = {one.parameter: one.value for one in self._parameters.get(name, {}).values()}
        if values:
            await component.configure_all(encoded(values))
        if name in self._modes:
            await component.change_mode(self._modes[name].mode)
        self._forgotten.discard(name)

    def _note(self, told: Told) -> None:
        """Store a setting that a component has received."""
        match told:
            case SetParameter(component=name):
                self._parameters.setdefault(name, {})[told.parameter] = told
            case SwitchMode(component=name, mode=mode) if mode not in {Life.INIT, Life.SHUTDOWN}:
                self._modes[name] = told

    def _begin(
        self, component: Component, hook: str, told: Iterable[Told], take: Callable[[], Awaitable[None]]
    ) -> None:
        numbers = {self._last + n: one for n, one in enumerate(told, start=1)}
        self._under_way |= numbers
        self._last += len(numbers)

        before = self.untaken.get(component.name)

        async def in_order() -> None:
            if before is not None and not before.done():  # otherwise it arrives before a skill of this step can end
                await asyncio.wait([before])
            try:
                if hook not in _LIFE_HOOKS and component.life.state is Life.INIT:
                    await component.life.come_alive()
                with contained(f"{component.name}.{hook}", component.device_errors):
                    await take()
                for one in numbers.values():
                    self._note(one)
            except Exception:
                self._refused.extend(numbers.values())
                raise
            finally:
                for number in numbers:
                    del self._under_way[number]
            why = None if before is None else failure(before)
            if why is not None:  # the next skill fails with this error
                raise why

        self.untaken[component.name] = asyncio.get_running_loop().create_task(in_order())

    async def configured(self, tasks: Configuring) -> None:
        """Wait until the components have received or refused the parameters and modes of a macrostep."""
        # Also for tasks that are done, so that skills begin in the order of the chart.
        await asyncio.wait(tasks.values())

    def unconfigured(self, tasks: Configuring) -> str:
        """Return a component that has not received its parameters and modes, as text; empty if there is none."""
        name = next((name for name, task in tasks.items() if not task.done()), None)
        return "" if name is None else f"component '{name}', which has not received its parameters and modes"

    async def taken(self, component: Component) -> None:
        """Wait until the component has received its `untaken` outputs; raise the error of a delivery, one time."""
        pending = self.untaken[component.name]
        await asyncio.wait([pending])  # `await pending` would cancel the delivery together with the skill
        if self.untaken.get(component.name) is pending:
            del self.untaken[component.name]
        why = failure(pending)
        if why is not None:
            raise why

    async def all_taken(self) -> None:
        """Wait until all components have received or refused their outputs, for `CLOSING` seconds at most."""
        if self.untaken:
            await asyncio.wait(self.untaken.values(), timeout=CLOSING)

    def tasks(self) -> Iterable[asyncio.Task[None]]:
        """Return the deliveries that the end of a run waits for."""
        return self.untaken.values()

    def failures(self) -> Iterator[str]:
        """Yield the reasons of failed deliveries that made no skill fail."""
        for name, task in self.untaken.items():
            why = failure(task) if task.done() else None
            if why is not None or task.cancelled() or not task.done():
                reason = reason_of(why) if why is not None else f"no answer within {CLOSING:g} s"
                yield f"component '{name}' did not take its last output: {reason}"


def _hook_of(told: Told) -> str:
    match told:
        case SetParameter():
            return "configure"
        case SwitchMode(mode=mode):
            return "start" if mode == Life.INIT else "stop" if mode == Life.SHUTDOWN else "switch"
        case SendMessage(port=port):
            return port


async def _restore_mode(component: Component, mode: str) -> None:
    """Restore a component's mode; for `Init`, start the component instead."""
    await (component.life.come_alive() if mode == Life.INIT else component.change_mode(mode))


def failure(task: asyncio.Task[None]) -> BaseException | None:
    """Return the error of a task that is done; `None` without an error or after a cancellation."""
    return None if task.cancelled() else task.exception()
