"""The outbox: delivers parameters, modes and messages to each component in the order of dispatch."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from dsc.components.component import Component
from dsc.components.hooks import GRACE, contained, executes, reason_of
from dsc.components.life_cycle import NEUTRAL, Life
from dsc.engine.steps import SendMessage, SetParameter, SetWire, Start, SwitchMode
from dsc.errors import ProgrammingError
from dsc.messages import Told
from dsc.run_log import run_logger
from dsc.sequencer.message_checks import encoded
from knowledge_base.user_objects import has_type

_LOG = run_logger(__package__)
CLOSING = GRACE
"""Seconds for components to receive their last outputs, and for cancelled skills to stop."""
_LIVES = frozenset({Life.INIT, Life.SHUTDOWN})
"""States of the life cycle that a `switch` can command."""
_LIFE_HOOKS = frozenset({"start", "stop"})
"""Hooks that a component in Init may receive; it is started before all others."""
_SETTINGS = frozenset({"configure", "switch"})
"""Hooks that receive the settings of a component."""
_MOST_REFUSED = 1000
"""Upper bound of the number of stored refusals; a run without a store never reads them."""


Delivery = asyncio.Task[Exception | None]
"""Delivery of an output; its result is the error that a listener has received, and `None` after a success."""
Configuring = dict[str, Delivery]
"""Deliveries of the parameters and modes of a macrostep, by component."""


class Outbox:
    """One-way outputs that components have not received yet, and outputs that they refused.

    The settings of a component are its parameters and its mode. The outbox delivers them again before the next skill if
    the component has started again, or could not take them.

    Args:
        failed: receives an output that a component could not take, with the error. Per macrostep, component and
            activation it receives the first failure.

    Attributes:
        untaken: by component, the task that delivers the latest output; removed when a skill has waited for the task.
        configuring: by component, the task that delivers the latest parameter or mode of the present macrostep.
    """

    def __init__(self, failed: Callable[[Told, Exception], None]) -> None:
        self._failed = failed
        self._failures: set[tuple[str, int]] = set()  # components and activations of the present macrostep
        self.untaken: dict[str, Delivery] = {}
        self.configuring: Configuring = {}
        self._open_sets: dict[str, dict[int, Told]] = {}  # parameters of the present macrostep by component
        self._calls: dict[str, tuple[str, asyncio.Task[Any]]] = {}  # hooks that deliveries call, by component
        self._undelivered: dict[int, Told] = {}
        self._refused: deque[Told] = deque(maxlen=_MOST_REFUSED)
        self._settings: dict[str, _Settings] = {}
        self._last = 0
        self._closed = False

    @property
    def undelivered(self) -> Collection[Told]:
        """Outputs that were neither received nor refused yet."""
        return self._undelivered.values()

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
        if self._failures:
            self._failures = set()
        if self._open_sets:
            self._open_sets = {}

    def send(self, component: Component, told: Told) -> None:
        """Deliver an output to the component, after all earlier outputs.

        Consecutive parameters of one entry are one set, as each alone may violate a relation (S1.20).
        """
        outputs = self._open_sets.pop(component.name, {})
        if not _extends(told, outputs.values()):
            outputs = {}
        is_new = not outputs
        outputs[self._number(told)] = told
        if isinstance(told, SetParameter):
            self._open_sets[component.name] = outputs
        if is_new:
            self._begin(component, _hook_of(told), outputs, lambda: self._take(component, outputs))
        if not isinstance(told, SendMessage):
            self.configuring[component.name] = self.untaken[component.name]

    def restore(self, component: Component, effective: Iterable[SetParameter | SwitchMode]) -> None:
        """Deliver the state of the life cycle and the settings that were effective before a restart of the program."""
        for one in effective:
            if isinstance(one, SwitchMode) and one.mode in _LIVES:
                outputs: dict[int, Told] = {self._number(one): one}
                self._begin(component, _hook_of(one), outputs, partial(_restore_life, component, one.mode))
            else:
                self._note(component, one, self._number(one))
        self.repeat(component)

    def repeat(self, component: Component) -> None:
        """Deliver the settings again, since the component has started again."""
        settings = self._settings_of(component)
        if settings and not self._closed:
            settings.missing = True
            self._begin(component, "configure_all", {}, lambda: self._configure(component))

    def _settings_of(self, component: Component) -> _Settings:
        return self._settings.setdefault(component.name, _Settings())

    def _note(self, component: Component, told: SetParameter | SwitchMode, untaken: int | None = None) -> None:
        """Store a setting, with its number if the component has not taken it."""
        replaced = self._settings_of(component).note(told, untaken)
        if replaced is not None:
            del self._undelivered[replaced]

    def _number(self, told: Told) -> int:
        self._last += 1
        self._undelivered[self._last] = told
        return self._last

    async def _take(self, component: Component, outputs: Mapping[int, Told]) -> None:
        """Pass one output to a component, or several parameters as one set."""
        match [*outputs.values()]:
            case [SetParameter(parameter=parameter, value=value)]:
                await component.configure(parameter, encoded(value))
                component.life.announce()
            case [SwitchMode() as told]:
                await component.change_mode(told.mode)
                if told.mode == Life.INIT and component.life.state is Life.ALIVE:
                    self._settings_of(component).missing = True
                    await self._configure(component)
            case [SendMessage() as told]:
                await component.receive(told.port, encoded(told.arguments))
            case several:
                values = {one.parameter: one.value for one in several if isinstance(one, SetParameter)}
                await component.configure_all(encoded(values))
                component.life.announce()

    async def _configure(self, component: Component) -> None:
        """Pass all settings to a component, unless it has them: the parameters as one set, then the mode."""
        settings = self._settings_of(component)
        if not settings.missing:
            return
        settings.missing = False  # a start during the delivery sets it again
        try:
            if settings.parameters:
                values = {name: one.value for name, one in settings.parameters.items()}
                await component.configure_all(encoded(values))
            if settings.mode is not None:
                await component.change_mode(settings.mode.mode)
        except BaseException:
            settings.missing = True
            raise
        for number in settings.taken():
            del self._undelivered[number]

    def _begin(
        self, component: Component, hook: str, outputs: Mapping[int, Told], take: Callable[[], Awaitable[None]]
    ) -> None:
        """Begin the delivery of outputs by a call of a hook; without outputs, of all settings."""
        first = next(iter(outputs.values()), None)
        are_settings = hook in _SETTINGS and not isinstance(first, SendMessage)
        before = self.untaken.get(component.name)
        failures = self._failures

        async def in_order() -> Exception | None:
            if self._open_sets.get(component.name) is outputs:
                del self._open_sets[component.name]
            if before is not None and not before.done():  # otherwise it arrives before a skill of this step can end
                await asyncio.wait([before])
            try:
                if hook in _LIFE_HOOKS or await _is_ready(component, first):
                    with self._calling(component, hook):
                        await take()
                    self._settle(component, outputs, are_settings=are_settings)
                elif are_settings:
                    self._postpone(component, outputs)
            except Exception as error:
                if first is None:  # the next skill fails with this error
                    raise
                if are_settings and not has_type(error, ProgrammingError):  # they may succeed later
                    self._postpone(component, outputs)
                else:
                    self._refuse(outputs)
                self._report(component, first, error, failures)
                return error
            if before is not None and (why := failure(before)) is not None:
                raise why
            return None

        self.untaken[component.name] = asyncio.get_running_loop().create_task(in_order())

    def _settle(self, component: Component, outputs: Mapping[int, Told], *, are_settings: bool) -> None:
        """Note that a component has taken outputs."""
        for number, told in outputs.items():
            if are_settings and not isinstance(told, SendMessage):
                self._note(component, told)
            self._undelivered.pop(number, None)

    def _postpone(self, component: Component, outputs: Mapping[int, Told]) -> None:
        """Note settings that a component has not taken."""
        for number, told in outputs.items():
            if not isinstance(told, SendMessage):
                self._note(component, told, number)

    def _refuse(self, outputs: Mapping[int, Told]) -> None:
        """Note outputs that a component will never take."""
        for number, told in outputs.items():
            self._refused.append(told)
            del self._undelivered[number]

    def _report(self, component: Component, told: Told, error: Exception, failures: set[tuple[str, int]]) -> None:
        """Report a failure, unless the same activation knows of another failure of the component in the macrostep."""
        _LOG.warning("%s: %s", command(told), reason_of(error))
        if (component.name, told.activation) not in failures:
            failures.add((component.name, told.activation))
            self._failed(told, error)

    @contextmanager
    def _calling(self, component: Component, hook: str) -> Iterator[None]:
        """Return a context manager in which a delivery calls a hook of the component."""
        task = asyncio.current_task()
        assert task is not None  # noqa: S101  # a delivery is a task
        called = f"{component.name}.{hook}"
        self._calls[component.name] = called, task
        try:
            with contained(called, component.device_errors):
                yield
        finally:
            del self._calls[component.name]

    def unconfigured(self, start: Start, tasks: Configuring, components: Mapping[str, Component]) -> str:
        """Return the component whose outputs a skill waits for, as text with its hook; empty if it waits for none.

        Args:
            start: the start of the skill.
            tasks: the deliveries of the skill's macrostep.
            components: the deployed components by name.
        """
        name, what = next((name for name, task in tasks.items() if not task.done()), ""), "parameters and modes"
        if not name and start.component in self.untaken and not self.untaken[start.component].done():
            name, what = start.component, "messages"
        if not name:
            return ""
        called = executes(*self._calls[name]) if name in self._calls else components[name].life.hook
        return f"component '{name}', which has not received its {what}{called}"

    async def configured(self, component: Component, tasks: Configuring) -> None:
        """Wait for deliveries, and until the component has taken its outputs; repeat the settings that it lacks.

        Args:
            component: the component of a skill.
            tasks: the deliveries of the skill's macrostep; those to other components may have failed.

        Raises:
            Exception: the component has refused a setting of the macrostep, or refuses one again.
        """
        if tasks:  # also if they are done, so that skills begin in the order of the chart
            await asyncio.wait(tasks.values())
        own = tasks.get(component.name)
        if own is not None and (why := own.result()) is not None:
            raise why
        if component.name in self.untaken:
            await self._await_taken(component)
        settings = self._settings.get(component.name)
        if settings is not None and settings.missing:
            self.repeat(component)
            await self._await_taken(component)

    async def _await_taken(self, component: Component) -> None:
        """Wait until the component has received its `untaken` outputs; raise the error of a delivery, one time."""
        pending = self.untaken[component.name]
        await asyncio.wait([pending])  # `await pending` would cancel the delivery together with the skill
        if self.untaken.get(component.name) is pending:
            del self.untaken[component.name]
        why = failure(pending)
        if why is not None:
            raise why

    @property
    def busy(self) -> Collection[Delivery]:
        """Deliveries that have not ended."""
        return [task for task in self.untaken.values() if not task.done()]

    async def all_taken(self) -> None:
        """Wait until all components have received or refused their outputs, for `CLOSING` seconds at most."""
        if self.untaken:
            await asyncio.wait(self.untaken.values(), timeout=CLOSING)

    def close(self) -> Collection[Delivery]:
        """Repeat no settings from now on, and return the deliveries that the end of a run waits for."""
        self._closed = True
        return self.untaken.values()

    def failures(self) -> Iterator[str]:
        """Yield the reasons of failed deliveries that made no skill fail."""
        for name, task in self.untaken.items():
            why = failure(task) if task.done() else None
            if why is not None or task.cancelled() or not task.done():
                reason = reason_of(why) if why is not None else f"no answer within {CLOSING:g} s"
                yield f"component '{name}' did not take its last output: {reason}"


@dataclass(slots=True)
class _Settings:
    """Parameters and mode that the active states have given to one component.

    Attributes:
        parameters: the last values, by name, in the order of their last changes.
        mode: the last mode; `None` before the first.
        missing: whether the component has not taken all of them since its last start.
        untaken: numbers of the outputs that the component has not taken, by parameter; `None` stands for the mode.
    """

    parameters: dict[str, SetParameter] = field(default_factory=dict)
    mode: SwitchMode | None = None
    missing: bool = False
    untaken: dict[str | None, int] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.parameters) or self.mode is not None

    def note(self, told: SetParameter | SwitchMode, untaken: int | None = None) -> int | None:
        """Add a parameter or mode, with its number if the component has not taken it.

        Returns:
            The number of the earlier output that this one replaces, if that one was untaken.
        """
        parameter = told.parameter if isinstance(told, SetParameter) else None
        replaced = self.untaken.pop(parameter, None)
        if isinstance(told, SetParameter):
            self.parameters.pop(told.parameter, None)
            self.parameters[told.parameter] = told
        else:
            self.mode = told
        if untaken is not None:
            self.untaken[parameter] = untaken
            self.missing = True
        return replaced

    def taken(self) -> list[int]:
        """Register that the component has taken all settings, and return the numbers that were untaken."""
        taken = list(self.untaken.values())
        self.untaken.clear()
        return taken


async def _is_ready(component: Component, told: Told | None) -> bool:
    """Start a component if necessary, and return whether it can take an output, or all settings.

    A component in Shutdown takes its settings after a `switch` to `init`. All settings are delivered after each start.
    A component that is not alive has no mode to leave.

    Raises:
        NotAliveError: the component cannot start, or is in Shutdown and cannot take a message.
    """
    in_vain = told is None or (isinstance(told, SwitchMode) and told.mode == NEUTRAL)
    if component.life.state is Life.INIT or (component.life.state is Life.FATAL_ERROR and not in_vain):
        await component.life.come_alive()
    state = component.life.state
    if state is not Life.ALIVE and (in_vain or (state is Life.SHUTDOWN and not isinstance(told, SendMessage))):
        return False
    component.life.require_alive()
    return True


def _extends(told: Told, outputs: Iterable[Told]) -> bool:
    """Return whether an output is a parameter of the same set as these: of the same entry, and with another name."""
    return isinstance(told, SetParameter) and all(
        isinstance(one, SetParameter) and one.activation == told.activation and one.parameter != told.parameter
        for one in outputs
    )


def _hook_of(told: Told) -> str:
    match told:
        case SetParameter():
            return "configure"
        case SwitchMode(mode=mode):
            return "start" if mode == Life.INIT else "stop" if mode == Life.SHUTDOWN else "switch"
        case SendMessage(port=port):
            return port


async def _restore_life(component: Component, life: str) -> None:
    """Start or shut down a component that a restarted program has created."""
    await (component.life.come_alive() if life == Life.INIT else component.change_mode(life))


def failure(task: asyncio.Task[Any]) -> BaseException | None:
    """Return the error that ended a task; `None` without an error or after a cancellation."""
    return None if task.cancelled() else task.exception()


def command(told: Told | SetWire) -> str:
    """Return a command as text, as it is in a plot."""
    match told:
        case SetParameter():
            return f"set {told.component}.{told.parameter}"
        case SwitchMode():
            return f"switch {told.component} to '{told.mode}'"
        case SendMessage():
            return f"send {told.component}.{told.port}"
        case SetWire(to=None):
            return f"unwire {told.component}.{told.port}"
        case SetWire():
            return f"wire {told.component}.{told.port} to '{told.to}'"


def port_of(told: Told | SetWire) -> str:
    """Return the port of a component that receives the command, as `arm.force`; the attribute `skill` of a failure."""
    match told:
        case SetParameter():
            return f"{told.component}.{told.parameter}"
        case SwitchMode():
            return f"{told.component}.switch"
        case SendMessage() | SetWire():
            return f"{told.component}.{told.port}"
