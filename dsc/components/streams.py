"""Streams: data between components that bypass plots, through *push newest* and *push timed* ports (S1.1, S1.15)."""

from __future__ import annotations

import asyncio
import json
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from dsc.components.frames import encoded
from dsc.components.life_cycle import Life, LifeCycle
from dsc.data_types import data_type
from dsc.errors import NoAnswerError
from dsc.loop_calls import LoopCalls
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.language.checking.inputs import shown

Values = Mapping[str, str | None]
"""Names of pushed values with types, see `dsc.data_types`; `None` accepts any plain data."""
Receiver = Callable[[dict[str, Any], float], None]
"""Function that receives pushed values, as a separate copy, and their age: the seconds since their `put`."""
_EXAMPLE = "{'metres': 'number'}"


class Push:
    """A push port of a component.

    Args:
        values: the names and types of the values.
        period: seconds between pushes of the newest values (*push timed*); without a period, each `put` pushes.
        name: `component.port`, for messages; the component sets it.
        life: the component's life cycle; in FatalError and Shutdown, a timed port does not push.

    Attributes:
        values: the names and types of the values.
        period: seconds between pushes, or `None`.

    Raises:
        InputError: the period is not a positive number, or the values are not names with types.
    """

    def __init__(
        self, values: Values, period: float | None = None, name: str = "", life: LifeCycle | None = None
    ) -> None:
        self.values = _checked(values, "a push port")
        if period is not None and not (isinstance(period, int | float) and 0 < period < math.inf):
            raise InputError(f"the period of a push port is a positive number of seconds, not {shown(period)}")
        self.period = period
        self._name = name
        self._life = life
        self._newest: bytes | None = None
        self._put: tuple[asyncio.AbstractEventLoop, float] | None = None  # loop and loop time of the newest values
        self._listeners: dict[Receiver, None] = {}
        self._timer: asyncio.TimerHandle | None = None
        self._calls = LoopCalls()

    def __getstate__(self) -> dict[str, object]:
        """Return the state for pickling, without listeners, which stay in this process."""
        return {**self.__dict__, "_listeners": {}, "_timer": None, "_put": None}

    def put(self, **values: Any) -> None:
        """Set new values, from any thread; listeners are called in their own loop's thread.

        Raises:
            InputError: a value is missing, has another type, or is not plain data.
            UnknownNameError: a value is not declared.
        """
        self.take(values, 0.0)

    def take(self, values: Mapping[str, Any], age: float) -> None:
        """Set values that are `age` seconds old; raise as `put`."""
        for name in values:
            if name not in self.values:
                raise UnknownNameError(f"'{self._name}' has no value '{name}'", found=name, valid=self.values)
        for name, kind in self.values.items():
            if name not in values:
                raise InputError(f"'{self._name}' needs its value '{name}'")
            if kind is not None:
                data_type(kind).check(f"'{self._name}.{name}'", values[name])
        self._calls.call(self._take, encoded(dict(values)), age)

    def _take(self, newest: bytes, age: float) -> None:
        self._newest, self._put = newest, None
        with suppress(RuntimeError):  # no loop is running: the values count as new when a loop first reads them
            loop = asyncio.get_running_loop()
            self._put = loop, loop.time() - age
        if self.period is None:
            self._push()
        else:
            self._start_timer()

    def listen(self, listener: Receiver) -> None:
        """Pass the newest values and all later ones to the listener, in the running loop's thread."""
        self._calls.bind()
        self._listeners[listener] = None
        if self._newest is not None:
            listener(json.loads(self._newest), self._age())
        self._start_timer()

    def leave(self, listener: Receiver) -> None:
        """Stop calling the listener."""
        self._listeners.pop(listener, None)

    def _push(self) -> None:
        if self._newest is not None:
            for listener in tuple(self._listeners):
                listener(json.loads(self._newest), self._age())

    def _age(self) -> float:
        loop = asyncio.get_running_loop()
        if self._put is None or self._put[0] is not loop:
            self._put = loop, loop.time()
        return loop.time() - self._put[1]

    def _start_timer(self) -> None:
        if self.period is not None and self._timer is None and self._listeners and self._newest is not None:
            self._timer = asyncio.get_running_loop().call_later(self.period, self._due)

    def _due(self) -> None:
        self._timer = None
        if self._life is None or self._life.state not in {Life.FATAL_ERROR, Life.SHUTDOWN}:
            self._push()
        self._start_timer()


class Stream:
    """A component's subscription to a push port of another component, which must also be among its `needs`.

    Args:
        source: the port, as `component.port`.
        values: names and types of the required values.

    Attributes:
        source: the port, as `component.port`.
        values: names and types of the required values.
        value: the newest values; `None` before the first.
        problem: returns the known reason why no values arrive, or `None`.

    Raises:
        InputError: the source is not `component.port`, or the values are not names with types.
    """

    def __init__(self, source: str, values: Values) -> None:
        self.publisher, _, self.port = source.partition(".") if isinstance(source, str) else ("", "", "")
        if not self.publisher or not self.port:
            raise InputError(f"a stream comes from a port, as in 'laser.scan', not {shown(source)}")
        self.source = source
        self.values = _checked(values, "a stream")
        self.value: dict[str, Any] | None = None
        self.problem: Callable[[], str | None] = _no_problem
        self._at = -math.inf
        self._waiting: set[asyncio.Future[None]] = set()

    def __getstate__(self) -> dict[str, object]:
        """Return the state for pickling, without waiting tasks, which stay in this process."""
        return {**self.__dict__, "_waiting": set(), "problem": _no_problem}

    @property
    def age(self) -> float:
        """Seconds since the `put` of the newest values; infinite before the first.

        A timed port repeats its values, whose age increases. An age far above the usual one indicates that the
        publisher is lost, or has no new values.
        """
        return _now() - self._at

    async def next(self, within: float) -> dict[str, Any]:
        """Wait for the next push and return its values; raise `NoAnswerError` after `within` seconds."""
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

    def receive(self, value: dict[str, Any], age: float) -> None:
        """Store pushed values that are `age` seconds old, and resume the tasks that wait for them."""
        self.value = value
        self._at = _now() - age
        for coming in self._waiting:
            if not coming.done():
                coming.set_result(None)


def require_fitting(source: str, wanted: Values, offered: Values) -> None:
    """Raise an error unless a port pushes the values of a stream.

    Raises:
        UnknownNameError: the port lacks a value.
        SchemaError: a value of the port has another type.
    """
    for name, kind in wanted.items():
        if name not in offered:
            raise UnknownNameError(f"'{source}' pushes no '{name}'", found=name, valid=offered)
        if kind is not None and offered[name] != kind:
            found = offered[name] or "plain data of any type"
            raise SchemaError(f"'{source}' pushes '{name}' as {found}, and {kind} is wanted", found=name)


def _now() -> float:
    return asyncio.get_running_loop().time()


def _no_problem() -> None:
    """Return `None`: the publisher has not refused the subscription."""


def _checked(values: object, what: str) -> Values:
    if not isinstance(values, Mapping) or not all(
        isinstance(name, str) and name.isidentifier() and (kind is None or isinstance(kind, str))
        for name, kind in values.items()
    ):
        raise InputError(f"the values of {what} are names with types, as in {_EXAMPLE}, not {shown(values)}")
    return {name: None if kind is None else str(data_type(kind)) for name, kind in values.items()}
