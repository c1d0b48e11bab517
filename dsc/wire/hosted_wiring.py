"""Wiring of hosted components: their required ports use components of the same program, and of others (S0.17, S1.18).

Streams are not wired here: each host subscribes to them, see `dsc.wire.publication.HostedStreams`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from functools import partial

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

    Each required port is wired to its `target`: its source, see `dsc.components.wiring.name_sources`, unless a client
    changes the wire. A port whose provider is missing is not wired yet; its calls end with `NotWiredError`. Providers
    may start later, and may restart.

    Args:
        components: the hosted components of this program.
        transport: the transport to other programs.
    """

    def __init__(self, components: Iterable[Component], transport: Transport) -> None:
        self._hosted = {one.name: one for one in components}
        self._transport = transport
        self._remote: dict[str, asyncio.Task[RemoteComponent]] = {}
        self._watched: dict[str, Component] = {}

    async def run(self) -> None:
        """Wire all ports, until cancelled."""
        try:
            async with asyncio.TaskGroup() as group:
                for owner in self._hosted.values():
                    for port in owner.requirements.values():
                        if not isinstance(port, Stream):
                            group.create_task(self._keep_wired(port, owner))
        finally:
            for finding in self._remote.values():
                finding.cancel()
            for provider in self._watched.values():
                provider.watch(watching=False)

    async def _keep_wired(self, port: Requirement, owner: Component) -> None:
        """Wire a port to its target, also after changes of the target, until cancelled."""
        port.join()
        try:
            await port.follow_target(partial(self._wire, port, owner))
        finally:
            port.leave()

    async def _wire(self, port: Requirement, owner: Component, target: str | None) -> None:
        """Wire a port to its target, when the program of the target is found; log the reason if it does not fit."""
        if target is None:
            port.disconnect()
            return
        provider = await self._provider(target.partition(".")[0])
        try:
            found = provider_for(port, owner, {provider.name: provider}, target)
        except InputError as error:
            _LOG.warning("port '%s' is not wired: %s", port.name, error)
            return
        if found is not None:
            port.connect(found)
            if provider.name not in self._watched:
                self._watched[provider.name] = provider
                provider.watch(watching=True)

    async def _provider(self, name: str) -> Component:
        """Return a component of this program, or of another one; all ports share the connection to it."""
        if name in self._hosted:
            return self._hosted[name]
        if name not in self._remote:
            self._remote[name] = asyncio.get_running_loop().create_task(self._find(name))
        return await asyncio.shield(self._remote[name])

    async def _find(self, name: str) -> RemoteComponent:
        while True:
            try:
                return await RemoteComponent.connect(name, self._transport)
            except (NoAnswerError, RefusedError) as error:
                _LOG.info("component '%s' is not there yet: %s", name, error)
            await asyncio.sleep(PAUSE)
