"""Streams: data between components that bypass plots, through *push newest* and *push timed* ports (S1.1, S1.15)."""

from __future__ import annotations

import asyncio
import json
import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from typing import Any

from dsc.components.checks import Check
from dsc.components.frames import encoded
from dsc.components.life_cycle import Life, LifeCycle
from dsc.components.requirement import Provider, Requirement
from dsc.components.services import Service, Values, declared_values
from dsc.data_types import data_type
from dsc.errors import NoAnswerError, NotWiredError
from dsc.loop_calls import LoopCalls
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.user_objects import shown

Receiver = Callable[[dict[str, Any], float], None]
"""Function that receives pushed values, as a separate copy, and their age: the seconds since their `put`."""


class Push:
    """A push port of a component.

    Args:
        values: the names and types of the values.
        period: seconds between pushes of the newest values (*push timed*); without a period, each `put` pushes.
        name: `component.port`, for messages; the component sets it.
        life: the component's life cycle; in FatalError and Shutdown, a timed port does not push.
        checks: further checks for conditions on the values, see `dsc.components.checks`.

    Attributes:
        values: the names and types of the values.
        period: seconds between pushes, or `None`.
        checks: the further checks.

    Raises:
        InputError: the period is not a positive number, or the values are not names with types.
    """

    def __init__(
        self,
        values: Values,
        period: float | None = None,
        name: str = "",
        life: LifeCycle | None = None,
        checks: Iterable[Check] = (),
    ) -> None:
        self.values = declared_values(values, "a push port")
        if period is not None and not (isinstance(period, int | float) and 0 < period < math.inf):
            raise InputError(f"the period of a push port is a positive number of seconds, not {shown(period)}")
        self.period = period
        self.checks = tuple(checks)
        self._name = name
        self._life = life
        self._newest: bytes | None = None
        self._put: tuple[asyncio.AbstractEventLoop, float] | None = None  # loop and loop time of the newest values
        self._listeners: dict[Receiver, None] = {}
        self._timer: asyncio.TimerHandle | None = None
        self._calls = LoopCalls()

    @property
    def service(self) -> Service:
        """The service of the port."""
        return Service("push", {}, self.values)

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


class Stream(Requirement):
    """A required push port: the newest values of another component's port.

    A component that lists the name of the stream in its `needs` keeps the publisher active.

    Args:
        values: names and types of the wanted values.
        source: the publisher's port as `component.port`, unless the profile names another one.
        period: the shortest time in seconds between two values; earlier values are replaced by newer ones (*push
            timed*, with a period of the subscriber's choice).
        timeout: seconds after which `next` without `within` ends with `NoAnswerError`.
        keep: the number of values that wait for `take_kept`; the oldest are dropped. 0 keeps none.
        optional: whether the component also works without a publisher.

    Attributes:
        value: the newest values; `None` before the first.
        problem: returns the known reason why no values arrive, or `None`.

    Raises:
        InputError: the source is not `component.port`, the values are not names with types, or a number is invalid.
    """

    what = "a stream"

    def __init__(
        self,
        values: Values,
        source: str | None = None,
        *,
        period: float | None = None,
        timeout: float | None = None,
        keep: int = 0,
        optional: bool = False,
    ) -> None:
        super().__init__(Service("push", {}, declared_values(values, self.what)), source, optional=optional)
        for name, seconds in (("period", period), ("timeout", timeout)):
            if seconds is not None and not (isinstance(seconds, int | float) and 0 < seconds < math.inf):
                raise InputError(f"the {name} of a stream is a positive number of seconds, not {shown(seconds)}")
        self.period = period
        self.timeout = timeout
        self.keep = keep
        self.value: dict[str, Any] | None = None
        self.problem: Callable[[], str | None] = _no_problem
        self._at = -math.inf
        self._waiting: set[asyncio.Future[None]] = set()
        self._kept: deque[dict[str, Any]] = deque(maxlen=keep)
        self._taken = -math.inf  # loop time of the last value that was taken
        self._held: tuple[dict[str, Any], float] | None = None  # a value that waits for the period, and its loop time
        self._timer: asyncio.TimerHandle | None = None

    def __getstate__(self) -> dict[str, object]:
        """Return the state for pickling, without waiting tasks, which stay in this process."""
        state = dict(super().__getstate__())
        mine: dict[str, object] = {"_waiting": set(), "_kept": deque(maxlen=self.keep), "_timer": None, "_held": None}
        return {**state, **mine, "problem": _no_problem}

    @property
    def age(self) -> float:
        """Seconds since the `put` of the newest values; infinite before the first.

        A timed port repeats its values, whose age increases. An age far above the usual one indicates that the
        publisher is lost, or has no new values.
        """
        return _now() - self._at

    async def next(self, within: float | None = None) -> dict[str, Any]:
        """Wait for the next push and return its values.

        Raises:
            NoAnswerError: nothing has come after `within` seconds, or after `timeout`.
            NotWiredError: the wire was cut.
            InputError: neither `within` nor `timeout` is given.
        """
        seconds = self.timeout if within is None else within
        if seconds is None:
            raise InputError(f"`next` of '{self.name}' needs a time: next(within=1), or Stream(..., timeout=1)")
        coming: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._waiting.add(coming)
        try:
            await asyncio.wait_for(coming, seconds)
        except TimeoutError:
            why = self.problem()
            message = f"nothing has come from {self._origin()} within {seconds:g} s"
            raise NoAnswerError(f"{message}: {why}" if why else message) from None
        finally:
            self._waiting.discard(coming)
        assert self.value is not None  # noqa: S101
        return self.value

    def take_kept(self) -> list[dict[str, Any]]:
        """Return the values since the last call, the oldest first; at most `keep` values."""
        kept = list(self._kept)
        self._kept.clear()
        return kept

    def receive(self, value: dict[str, Any], age: float) -> None:
        """Store pushed values that are `age` seconds old, and resume the tasks that wait for them."""
        due = 0.0 if self.period is None else self._taken + self.period - _now()
        if due <= 0:
            self._take(value, _now() - age)
            return
        self._held = value, _now() - age
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(due, self._take_held)

    def _take_held(self) -> None:
        self._timer = None
        if self._held is not None:
            self._take(*self._held)

    def _take(self, value: dict[str, Any], at: float) -> None:
        self.value, self._at, self._taken, self._held = value, at, _now(), None
        if self.keep:
            self._kept.append(value)
        for coming in self._waiting:
            if not coming.done():
                coming.set_result(None)

    def connect(self, provider: Provider) -> None:
        """Receive the values of a push port from now on."""
        if self.provider != provider:
            super().connect(provider)
            provider.component.pushes[provider.port].listen(self.receive)

    def disconnect(self) -> None:
        """Receive no values any longer; the newest ones stay known, and `next` ends with `NotWiredError`."""
        provider = self.provider
        super().disconnect()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if provider is not None:
            provider.component.pushes[provider.port].leave(self.receive)
            self.end_waits(provider.name)

    def end_waits(self, provider: str) -> None:
        """End pending `next` with `NotWiredError`, as the wire to a provider was cut."""
        for coming in self._waiting:
            if not coming.done():
                coming.set_exception(NotWiredError(f"the wire of '{self.name}' to '{provider}' was cut"))

    def _origin(self) -> str:
        named = self.target if self.provider is None else self.provider.name
        return f"'{self.name}', which is not wired" if named is None else f"'{named}'"


def _now() -> float:
    return asyncio.get_running_loop().time()


def _no_problem() -> None:
    """Return `None`: the publisher has not refused the subscription."""
