"""Wiring of hosted components: their required ports use components of the same program, and of others (S0.17).

Streams are not wired here: each host subscribes to them, see `dsc.wire.publication.HostedStreams`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable

from dsc.components.component import Component
from dsc.components.requirement import Requirement
from dsc.components.streams import Stream
from dsc.components.wiring import provider_for
from dsc.errors import NoAnswerError, RefusedError
from dsc.run_log import run_logger
from dsc.wire.endpoint import Transport
from dsc.wire.remote import RemoteComponent
from knowledge_base.errors import InputError

_LOG = run_logger(__package__)

PAUSE = 1.0
"""Seconds between two attempts to find the program of a provider."""


class HostedWiring:
    """The wires of hosted components, while `run` runs.

    Each required port has a source, see `dsc.components.wiring.name_sources`. A port whose provider is missing is not
    wired yet; its calls end with `NotWiredError`. Providers may start later, and may restart.

    Args:
        components: the hosted components of this program.
        transport: the transport to other programs.
    """

    def __init__(self, components: Iterable[Component], transport: Transport) -> None:
        self._hosted = {one.name: one for one in components}
        self._transport = transport

    async def run(self) -> None:
        """Wire all ports, until cancelled."""
        ports: dict[str, list[tuple[Requirement, Component]]] = {}
        for owner in self._hosted.values():
            for port in owner.requirements.values():
                if port.source is not None and not isinstance(port, Stream):
                    ports.setdefault(port.source.partition(".")[0], []).append((port, owner))
        async with asyncio.TaskGroup() as group:
            for name, clients in ports.items():
                group.create_task(self._serve(name, clients))

    async def _serve(self, name: str, clients: list[tuple[Requirement, Component]]) -> None:
        """Wire the ports to the component of that name, until cancelled."""
        provider = self._hosted.get(name) or await self._find(name)
        fitting = [port for port, owner in clients if _connect(port, owner, provider)]
        provider.watch(watching=True)
        try:
            await asyncio.Event().wait()
        finally:
            provider.watch(watching=False)
            for port in fitting:
                port.leave()

    async def _find(self, name: str) -> RemoteComponent:
        while True:
            try:
                return await RemoteComponent.connect(name, self._transport)
            except (NoAnswerError, RefusedError) as error:
                _LOG.info("component '%s' is not there yet: %s", name, error)
            await asyncio.sleep(PAUSE)


def _connect(port: Requirement, owner: Component, provider: Component) -> bool:
    """Wire a port; return whether the provider fits, and log the reason if not."""
    try:
        found = provider_for(port, owner, {provider.name: provider})
    except InputError as error:
        _LOG.warning("port '%s' is not wired: %s", port.name, error)
        return False
    if found is None:
        return False
    port.join()
    port.connect(found)
    return True
