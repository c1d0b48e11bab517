"""Streams carry data between components past the plots: *push newest* and *push timed* ports (S1.1, S1.15)."""

from __future__ import annotations

import asyncio
import json
import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol, Self

from dsc.components.endpoint import NoAnswerError, encoded
from dsc.components.life_cycle import Life, LifeCycle
from dsc.model.ranges import Range
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.language.checking.inputs import shown

Values = Mapping[str, str | None]
"""What is pushed, by name with types: `number`, `boolean`, a word of any other type, or `None`: any plain data."""
Hears = Callable[[dict[str, Any]], None]
"""Is given what was pushed, a copy of its own."""


class Ported(Protocol):
    """A component, as its ports and their wiring see it."""

    name: str
    life: LifeCycle
    pushes: dict[str, Push]
    streams: dict[str, Stream]


class Push:
    """A push port of a component.

    Args:
        values: what is pushed.
        period: push the newest every so many seconds (*push timed*); without, whenever there is something new.
        component, name: whose port it is; said by the component itself when it is made.

    Attributes:
        values, period: as given.

    Raises:
        InputError: the period is no positive number of seconds, or the values are no names with types.
    """

    def __init__(
        self, values: Values, period: float | None = None, component: Ported | None = None, name: str = ""
    ) -> None:
        self.values = _checked(values, "a push port")
        if period is not None and not (isinstance(period, int | float) and 0 < period < math.inf):
            raise InputError(f"the period of a push port is a positive number of seconds, not {shown(period)}")
        self.period = period
        self._component = component
        self._name = f"{component.name}.{name}" if component is not None else name
        self._newest: bytes | None = None
        self._listeners: dict[Hears, None] = {}
        self._timer: asyncio.TimerHandle | None = None

    def __getstate__(self) -> dict[str, object]:
        """What goes to another process: who listens here does not."""
        return {**self.__dict__, "_listeners": {}, "_timer": None}

    def of(self, component: Ported, name: str) -> Self:
        """The port that this declares, for one component."""
        return type(self)(self.values, self.period, component, name)

    def put(self, **values: Any) -> None:
        """Something new; from the loop's own thread.

        Raises:
            InputError: a value is missing, of another type, or no plain data.
            UnknownNameError: a value is none of those that are declared.
        """
        for name in values:
            if name not in self.values:
                raise UnknownNameError(f"'{self._name}' has no value '{name}'", found=name, valid=self.values)
        for name, kind in self.values.items():
            if name not in values:
                raise InputError(f"'{self._name}' needs its value '{name}'")
            if kind is not None:
                Range(kind).check(f"{self._name}.{name}", values[name])
        self._newest = encoded(values)
        if self.period is None:
            self._tell()
        else:
            self._keep_time()

    def listen(self, listener: Hears) -> None:
        """Tell the listener what is pushed from now on, and the newest before that."""
        self._listeners[listener] = None
        if self._newest is not None:
            listener(json.loads(self._newest))
        self._keep_time()

    def leave(self, listener: Hears) -> None:
        """Tell it no more."""
        self._listeners.pop(listener, None)

    def _tell(self) -> None:
        if self._newest is not None:
            for listener in tuple(self._listeners):
                listener(json.loads(self._newest))

    def _keep_time(self) -> None:
        if self.period is not None and self._timer is None and self._listeners and self._newest is not None:
            self._timer = asyncio.get_running_loop().call_later(self.period, self._due)

    def _due(self) -> None:
        self._timer = None
        if self._component is None or self._component.life.state not in {Life.FATAL_ERROR, Life.SHUTDOWN}:
            self._tell()  # else its silence says that it is gone
        self._keep_time()


class Stream:
    """What a component takes from a push port of another; it shall also be among its `needs`.

    Args:
        source: the port, `component.port`.
        values: what it has to push at least, and of which types.

    Attributes:
        source, values: as given.
        value: the newest that has come; `None` before the first.
        problem: says why nothing can come, if that is known.

    Raises:
        InputError: the source is no `component.port`, or the values are no names with types.
    """

    def __init__(self, source: str, values: Values) -> None:
        self.publisher, _, self.port = source.partition(".") if isinstance(source, str) else ("", "", "")
        if not self.publisher or not self.port:
            raise InputError(f"a stream comes from a port, as in 'laser.scan', not {shown(source)}")
        self.source = source
        self.values = _checked(values, "a stream")
        self.value: dict[str, Any] | None = None
        self.problem: Callable[[], str | None] = _none_known
        self._at = -math.inf
        self._waiting: set[asyncio.Future[None]] = set()

    def __getstate__(self) -> dict[str, object]:
        """What goes to another process: who waits here does not."""
        return {**self.__dict__, "_waiting": set(), "problem": _none_known}

    def of(self) -> Self:
        """The stream that this declares, for one component."""
        return type(self)(self.source, self.values)

    @property
    def age(self) -> float:
        """Seconds since the value has come; infinite before the first. Far above the period, the port is silent."""
        return asyncio.get_running_loop().time() - self._at

    async def next(self, within: float) -> dict[str, Any]:
        """Wait for what comes next.

        Raises:
            NoAnswerError: nothing has come within so many seconds.
        """
        coming: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._waiting.add(coming)
        try:
            async with asyncio.timeout(within):
                await coming
        except TimeoutError:
            why = self.problem()
            message = f"nothing has come from '{self.source}' within {within:g} s"
            raise NoAnswerError(f"{message}: {why}" if why else message) from None
        finally:
            self._waiting.discard(coming)
        assert self.value is not None  # noqa: S101
        return self.value

    def hear(self, value: dict[str, Any]) -> None:
        """Something has been pushed."""
        self.value = value
        self._at = asyncio.get_running_loop().time()
        for coming in self._waiting:
            if not coming.done():
                coming.set_result(None)


def require_fitting(source: str, wanted: Values, offered: Values) -> None:
    """Raise an error unless a port pushes what a stream wants.

    Raises:
        UnknownNameError: it has no such value.
        SchemaError: the value is of another type.
    """
    for name, kind in wanted.items():
        if name not in offered:
            raise UnknownNameError(f"'{source}' pushes no '{name}'", found=name, valid=offered)
        if kind is not None and offered[name] != kind:
            said = offered[name] or "plain data of any type"
            raise SchemaError(f"'{source}' pushes '{name}' as {said}, and {kind} is wanted", found=name)


def _none_known() -> None:
    """Nobody has been refused."""


def _checked(values: object, what: str) -> Values:
    if not isinstance(values, Mapping) or not all(
        isinstance(name, str) and name.isidentifier() and (kind is None or isinstance(kind, str))
        for name, kind in values.items()
    ):
        raise InputError(f"the values of {what} are names with types, as in {_EXAMPLE}, not {shown(values)}")
    return dict(values)


_EXAMPLE = "{'metres': 'number'}"


class Wiring:
    """All connections between components that are deployed together; who is deployed late is connected then.

    Raises:
        UnknownNameError: a stream names a port, or a value of it, that its component does not have.
        SchemaError: a value is of another type than the stream wants.
    """

    def __init__(self, components: Mapping[str, Ported]) -> None:
        self._components = components
        self._connected: dict[Stream, Push] = {}
        for component in components.values():
            self._connect(component)

    def deployed(self, component: Ported) -> None:
        """A component is there, maybe in place of another one."""
        for stream, port in list(self._connected.items()):
            if stream.publisher == component.name:
                del self._connected[stream]
                port.leave(stream.hear)
        for one in self._components.values():
            self._connect(one)

    def close(self) -> None:
        """Disconnect everything."""
        for stream, port in self._connected.items():
            port.leave(stream.hear)
        self._connected = {}

    def _connect(self, component: Ported) -> None:
        for stream in component.streams.values():
            publisher = self._components.get(stream.publisher)
            if publisher is not None and stream not in self._connected:
                self._connected[stream] = port = port_for(stream, publisher)
                port.listen(stream.hear)


def port_for(stream: Stream, publisher: Ported) -> Push:
    """The port that a stream names, if it fits; raises `UnknownNameError` and `SchemaError` as `Wiring`."""
    if stream.port not in publisher.pushes:
        message = f"component '{publisher.name}' has no push port '{stream.port}'"
        raise UnknownNameError(message, found=stream.port, valid=publisher.pushes)
    require_fitting(stream.source, stream.values, publisher.pushes[stream.port].values)
    return publisher.pushes[stream.port]


def require_wired(components: Iterable[Ported]) -> None:
    """Raise an error unless all streams of these components have the ports that they name.

    Raises:
        UnknownNameError: there is no such component, port or value.
        SchemaError: a value is of another type.
    """
    deployed = {component.name: component for component in components}
    for component in deployed.values():
        for stream in component.streams.values():
            if stream.publisher not in deployed:
                message = f"component '{component.name}' takes '{stream.source}', and there is no such component"
                raise UnknownNameError(message, found=stream.publisher, valid=deployed)
            port_for(stream, deployed[stream.publisher])
