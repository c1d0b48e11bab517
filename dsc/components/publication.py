"""Pushing over a transport: one component hands values on to many, none older than the last (S1.1).

A subscriber asks for the value again and again, so that it has the newest even if a push was lost, and a publisher
that came late or came back finds its subscribers; a publisher forgets who has not asked for a while.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping
from typing import Any

from dsc.components.component import Component
from dsc.components.endpoint import Endpoint, NoAnswerError, RefusedError
from dsc.components.streams import Hears, Push, Values, require_fitting
from knowledge_base.errors import InputError, described

RENEWED = 1.0
"""Seconds after which a subscriber asks again."""
FORGOTTEN = 5.0
"""Seconds after which a publisher forgets a subscriber that does not."""
MOST_SUBSCRIBERS = 1_000
"""Subscribers of one port; more are refused."""
MOST_LIVES = 100
"""Lives of a publisher that are told from its present one."""


class Publisher:
    """Pushes at an endpoint.

    Args:
        endpoint: whose port it is.
        port: its name.
        values: what is pushed, by name with types; if it is said, who wants something else is refused.

    Attributes:
        newest: the newest value as subscribers `take` it, with its number.
    """

    def __init__(self, endpoint: Endpoint, port: str, values: Values | None = None) -> None:
        self._endpoint = endpoint
        self._port = port
        self._values = values
        self.newest: dict[str, Any] = {"life": endpoint.life, "n": 0, "value": None}
        self._subscribers: dict[str, float] = {}
        endpoint.answer(f"subscribe {port}", self._subscribe)

    def put(self, value: Any) -> None:
        """A new value, pushed to all who have subscribed; raises `InputError` if it is no plain data."""
        self.newest = {"life": self._endpoint.life, "n": self.newest["n"] + 1, "value": value}
        self._push()

    def _push(self) -> None:
        now = asyncio.get_running_loop().time()
        self._subscribers = {who: until for who, until in self._subscribers.items() if until > now}
        for who in self._subscribers:
            self._endpoint.push(who, _kind(self._endpoint.address, self._port), self.newest)

    async def _subscribe(self, sender: str, wanted: Values | None) -> dict[str, Any]:
        if self._values is not None and wanted is not None:
            require_fitting(f"{self._endpoint.address}.{self._port}", wanted, self._values)
        now = asyncio.get_running_loop().time()
        if len(self._subscribers) >= MOST_SUBSCRIBERS and sender not in self._subscribers:
            self._subscribers = {who: until for who, until in self._subscribers.items() if until > now}
            if len(self._subscribers) >= MOST_SUBSCRIBERS:
                raise InputError(f"{MOST_SUBSCRIBERS} have subscribed already, and no more are told")
        self._subscribers[sender] = now + FORGOTTEN
        return self.newest


class Subscription:
    """The newest value of another component's push port; `run` keeps it so.

    Args:
        endpoint: who subscribes.
        publisher: whose port it is.
        port: its name.
        heard: is told each value that is newer than those known.
        wanted: what it has to push at least, and of which types.

    Attributes:
        value: the newest one that is known; `None` before the first.
        problem: why the publisher has refused, if it has.
    """

    def __init__(
        self,
        endpoint: Endpoint,
        publisher: str,
        port: str,
        heard: Callable[[Any], None] | None = None,
        wanted: Values | None = None,
    ) -> None:
        self.value: Any = None
        self.problem: str | None = None
        self._tell = heard
        self._wanted = wanted
        self._endpoint = endpoint
        self._publisher = publisher
        self._port = port
        self._numbers: dict[str, int] = {}  # the newest number of each life of the publisher, the present one last
        self._at = -math.inf
        self._news = asyncio.Event()
        endpoint.hear(_kind(publisher, port), self._heard)

    @property
    def age(self) -> float:
        """Seconds since anything was heard from the publisher; infinite before the first time."""
        return asyncio.get_running_loop().time() - self._at

    async def next(self, within: float) -> Any:
        """Wait for a value that is newer than those known.

        Raises:
            NoAnswerError: none has come within so many seconds.
        """
        self._news.clear()
        try:
            async with asyncio.timeout(within):
                await self._news.wait()
        except TimeoutError:
            raise NoAnswerError(f"'{self._publisher}' has pushed no '{self._port}' within {within:g} s") from None
        return self.value

    async def run(self) -> None:
        """Subscribe, and again whenever the publisher may have forgotten, until cancelled."""
        while True:
            try:
                kind = f"subscribe {self._port}"
                newest = await self._endpoint.call(self._publisher, kind, self._wanted, FORGOTTEN)
            except NoAnswerError:
                pass  # not there yet, or not there any more: it may come
            except RefusedError as refused:  # so may another one
                self.problem = str(refused)
            else:
                try:
                    self.take(newest)
                    self.problem = None
                except Exception as error:  # noqa: BLE001  # whatever it pushes, we go on to listen
                    self.problem = described(error, named=not isinstance(error, InputError))
            await asyncio.sleep(RENEWED)

    def _heard(self, sender: str, newest: Any) -> None:
        if sender == self._publisher:
            self.take(newest)

    def take(self, newest: Any) -> None:
        """Hear what the publisher has said, `Publisher.newest`, on whatever way; nothing older than known is taken.

        Raises:
            InputError: it is not what a publisher says; nothing is taken.
        """
        match newest:
            case {"life": str(life), "n": int(number), "value": value}:
                self._at = asyncio.get_running_loop().time()
            case _:
                raise InputError(f"'{self._publisher}' has pushed '{self._port}' in a form that cannot be read")
        present = life not in self._numbers or next(reversed(self._numbers)) == life
        if present and number > self._numbers.get(life, 0):
            before, self.value = self.value, value
            try:
                if self._tell is not None:
                    self._tell(value)
            except BaseException:
                self.value = before
                raise
            self._numbers[life] = number
            if len(self._numbers) > MOST_LIVES:
                del self._numbers[next(iter(self._numbers))]
            self._news.set()


def _kind(publisher: str, port: str) -> str:
    """Ports of two publishers may have one name."""
    return f"push {publisher}.{port}"


class HostedStreams:
    """Publishes a hosted component's push ports, and subscribes for its streams, at its host's endpoint."""

    def __init__(self, component: Component, endpoint: Endpoint) -> None:
        self._publishing = [(port, Publisher(endpoint, name, port.values)) for name, port in component.pushes.items()]
        for port, publisher in self._publishing:
            port.listen(publisher.put)
        self._tasks: list[asyncio.Task[None]] = []
        for stream in component.streams.values():
            subscription = Subscription(endpoint, stream.publisher, stream.port, stream.hear, stream.values)
            stream.problem = lambda subscription=subscription: subscription.problem  # type: ignore[misc]
            self._tasks.append(asyncio.get_running_loop().create_task(subscription.run()))

    def close(self) -> list[asyncio.Task[None]]:
        """Publish nothing more; what is left is to be cancelled."""
        for port, publisher in self._publishing:
            port.leave(publisher.put)
        return self._tasks


def ports_form(component: Component) -> dict[str, Any]:
    """A component's push ports as plain data."""
    return {name: {"values": dict(port.values)} for name, port in component.pushes.items()}


def ports_of(form: Mapping[str, Any], component: Component, endpoint: Endpoint) -> dict[str, Push]:
    """The push ports that `ports_form` was made from, as seen from here."""
    return {name: _PushElsewhere(component, endpoint, name, port["values"]) for name, port in form.items()}


class _PushElsewhere(Push):
    """A push port of a component elsewhere, subscribed to while somebody listens here; its period is kept there."""

    def __init__(self, component: Component, endpoint: Endpoint, name: str, values: Mapping[str, str | None]) -> None:
        super().__init__(values, None, component, name)
        self._subscription = Subscription(endpoint, component.name, name, lambda value: self.put(**value))
        self._running: asyncio.Task[None] | None = None

    def listen(self, listener: Hears) -> None:
        """Tell the listener what arrives."""
        super().listen(listener)
        if self._running is None:
            self._running = asyncio.get_running_loop().create_task(self._subscription.run())

    def leave(self, listener: Hears) -> None:
        """Tell it no more."""
        super().leave(listener)
        if self._running is not None and not self._listeners:
            self._running.cancel()
            self._running = None
