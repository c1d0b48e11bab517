"""Push ports over a transport: one component publishes values, and each subscriber receives the newest (S1.1).

A subscriber renews its subscription periodically. So the subscriber receives the newest value also after a lost push. A
publisher that starts late, or restarts, is found by its subscribers. The publisher forgets subscribers that do not
renew.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from dsc.components.component import Component
from dsc.components.hooks import reason_of
from dsc.components.services import Service, Values, require_fitting
from dsc.components.streams import Push, Receiver, Stream
from dsc.errors import NoAnswerError, RefusedError
from dsc.wire.endpoint import Endpoint
from knowledge_base.errors import InputError

RENEWED = 1.0
"""Seconds after which a subscriber renews its subscription."""
FORGOTTEN = 5.0
"""Seconds after which a publisher forgets a subscriber that has not renewed its subscription."""
MOST_SUBSCRIBERS = 1_000
"""Maximum number of subscribers of one port; further subscribers are refused."""
MOST_LIVES = 100
"""Number of earlier instances of a publisher that a subscriber remembers."""


class Publisher:
    """The publishing end of a push port, at an endpoint.

    Args:
        endpoint: the publisher's address.
        port: the port's name.
        values: names and types of the values; subscribers that require other values are refused.

    """

    def __init__(self, endpoint: Endpoint, port: str, values: Values | None = None) -> None:
        self._endpoint = endpoint
        self._port = port
        self._values = values
        self._number = 0
        self._value: Any = None
        self._since = 0.0  # loop time of the value
        self._subscribers: dict[str, float] = {}
        endpoint.answer(f"subscribe {port}", self._subscribe)

    @property
    def newest(self) -> dict[str, Any]:
        """The newest value with its number and its age in seconds, in the form for `Subscription.take`."""
        age = asyncio.get_running_loop().time() - self._since
        return {"life": self._endpoint.life, "n": self._number, "value": self._value, "age": age}

    def put(self, value: Any, age: float = 0.0) -> None:
        """Push a value that is `age` seconds old to all subscribers; raise `InputError` if it is not plain data."""
        self._number, self._value = self._number + 1, value
        self._since = asyncio.get_running_loop().time() - age
        self._forget()
        for subscriber in self._subscribers:
            self._endpoint.push(subscriber, _kind(self._endpoint.address, self._port), self.newest)

    def _forget(self) -> None:
        now = asyncio.get_running_loop().time()
        self._subscribers = {name: until for name, until in self._subscribers.items() if until > now}

    async def _subscribe(self, sender: str, wanted: Values | None) -> dict[str, Any]:
        if self._values is not None and wanted is not None:
            offered, name = Service("push", {}, self._values), f"{self._endpoint.address}.{self._port}"
            require_fitting(name, Service("push", {}, wanted), offered)
        if len(self._subscribers) >= MOST_SUBSCRIBERS and sender not in self._subscribers:
            self._forget()
            if len(self._subscribers) >= MOST_SUBSCRIBERS:
                raise InputError(f"the port has {MOST_SUBSCRIBERS} subscribers, and takes no more")
        self._subscribers[sender] = asyncio.get_running_loop().time() + FORGOTTEN
        return self.newest


class Subscription:
    """The newest value of another component's push port; `run` renews the subscription.

    Args:
        endpoint: the subscriber's address.
        publisher: the publisher's address.
        port: the port's name.
        receive: called with each value that is newer than the known ones, and its age in seconds.
        wanted: names and types of the required values.

    Attributes:
        value: the newest known value; `None` before the first.
        problem: the reason for the publisher's refusal; `None` without a refusal.
    """

    def __init__(
        self,
        endpoint: Endpoint,
        publisher: str,
        port: str,
        receive: Callable[[Any, float], None] | None = None,
        wanted: Values | None = None,
    ) -> None:
        self.value: Any = None
        self.problem: str | None = None
        self._receive = receive
        self._wanted = wanted
        self._endpoint = endpoint
        self._publisher = publisher
        self._port = port
        self._numbers: dict[str, int] = {}  # the newest number of each instance of the publisher, the present one last
        self._at = -math.inf
        endpoint.receive(_kind(publisher, port), self._push)

    @property
    def age(self) -> float:
        """Seconds since the last message of the publisher; infinite before the first."""
        return asyncio.get_running_loop().time() - self._at

    async def run(self) -> None:
        """Subscribe, and renew the subscription, until cancelled."""
        while True:
            try:
                kind = f"subscribe {self._port}"
                newest = await self._endpoint.call(self._publisher, kind, self._wanted, FORGOTTEN)
            except NoAnswerError:
                pass  # the publisher may start later
            except RefusedError as refused:  # a restarted publisher may accept
                self.problem = str(refused)
            else:
                try:
                    self.take(newest)
                    self.problem = None
                except Exception as error:  # noqa: BLE001  # a faulty value must not end the subscription
                    self.problem = reason_of(error)
            await asyncio.sleep(RENEWED)

    def forget_age(self) -> None:
        """Return to the age before the first message, since the publisher is gone; the value stays known."""
        self._at = -math.inf

    def _push(self, sender: str, newest: Any) -> None:
        if sender == self._publisher:
            self.take(newest)

    def take(self, newest: Any) -> None:
        """Store a received `Publisher.newest`, unless it is older than the known value.

        Raises:
            InputError: `newest` is malformed; the known value is unchanged.
        """
        match newest:
            case {"life": str(life), "n": int(number), "value": value, "age": float(age) | int(age)} if age >= 0:
                self._at = asyncio.get_running_loop().time()
            case _:
                raise InputError(f"'{self._publisher}' has pushed '{self._port}' in a form that cannot be read")
        present = life not in self._numbers or next(reversed(self._numbers)) == life
        if present and number > self._numbers.get(life, 0):
            before, self.value = self.value, value
            try:
                if self._receive is not None:
                    self._receive(value, age)
            except BaseException:
                self.value = before
                raise
            self._numbers[life] = number
            if len(self._numbers) > MOST_LIVES:
                del self._numbers[next(iter(self._numbers))]


def _kind(publisher: str, port: str) -> str:
    """Return the kind of a port's pushes; ports of two publishers may have equal names."""
    return f"push {publisher}.{port}"


class HostedStreams:
    """Publisher of a hosted component's push ports, and subscriber for its streams, at its host's endpoint."""

    def __init__(self, component: Component, endpoint: Endpoint) -> None:
        self._publishing = [(port, Publisher(endpoint, name, port.values)) for name, port in component.pushes.items()]
        for port, publisher in self._publishing:
            port.listen(publisher.put)
        self._tasks: list[asyncio.Task[None]] = []
        for stream in component.requirements.values():
            if isinstance(stream, Stream):
                following = stream.follow_target(partial(_subscribe, stream, endpoint))
                self._tasks.append(asyncio.get_running_loop().create_task(following))

    def close(self) -> list[asyncio.Task[None]]:
        """Stop publishing; return the subscription tasks, which the caller must cancel."""
        for port, publisher in self._publishing:
            port.leave(publisher.put)
        return self._tasks


async def _subscribe(stream: Stream, endpoint: Endpoint, target: str | None) -> None:
    """Subscribe to the target of a hosted stream, until cancelled; a change of the target cuts the wire."""
    if target is None:
        return
    publisher, _, port = target.partition(".")
    subscription = Subscription(endpoint, publisher, port, stream.receive, stream.service.gives)
    stream.problem = lambda: subscription.problem
    try:
        await subscription.run()
    finally:
        endpoint.deafen(_kind(publisher, port))
        if stream.target != target:
            stream.end_waits(target)


class RemotePush(Push):
    """A push port of a remote component, with a subscription while it has listeners; the host applies the period."""

    def __init__(self, endpoint: Endpoint, component: str, port: str, values: Mapping[str, str | None]) -> None:
        super().__init__(values, name=f"{component}.{port}")
        self._subscription = Subscription(endpoint, component, port, self.take)
        self._running: asyncio.Task[None] | None = None

    def listen(self, listener: Receiver) -> None:
        """Pass all later values to the listener."""
        super().listen(listener)
        if self._running is None:
            self._running = asyncio.get_running_loop().create_task(self._subscription.run())

    def leave(self, listener: Receiver) -> None:
        """Stop calling the listener."""
        super().leave(listener)
        if self._running is not None and not self._listeners:
            self._running.cancel()
            self._running = None
