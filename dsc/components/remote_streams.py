"""Push ports and streams of components over a transport: of those that are hosted, and of those elsewhere (S1.1)."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from dsc.components.publication import Publisher, Subscription
from dsc.components.streams import Hears, Push

if TYPE_CHECKING:
    from dsc.components.component import Component
    from dsc.components.endpoint import Endpoint


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
