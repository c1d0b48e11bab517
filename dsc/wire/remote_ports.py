"""Required ports of hosted components, as a client sees them: a run changes their wires at the host (S1.18)."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any, ClassVar

from dsc.components.requirement import USUAL, Provider, Requirement
from dsc.components.services import Service
from dsc.errors import NoAnswerError, RefusedError
from dsc.run_log import run_logger
from dsc.wire.endpoint import Endpoint
from knowledge_base.errors import InputError

_LOG = run_logger(__package__)
WITHIN = 3.0
"""Seconds to wait for the host's answer; a host that returns later receives the wire then."""


class RemoteRequirement(Requirement):
    """A required port of a hosted component, which its host wires to the source unless a run changes the wire.

    Args:
        service: the wanted service.
        source: the provider that the host connects.
        name: the port as `component.port`.
        wires: sends changes to the host.
    """

    what = "a required port of a hosted component"
    is_hosted: ClassVar[bool] = True

    def __init__(self, service: Service, source: str | None, name: str, wires: RemoteWires) -> None:
        super().__init__(service, source, optional=True)
        self.name = name
        self._wires = wires

    def provider_name(self) -> str | None:
        """Return the provider of the run's wire, or else the source."""
        return self.target

    def require_reachable(self, provider: Provider) -> None:
        """Raise `InputError` if the provider is a component of this program, which the host does not know."""
        if not provider.component.is_remote:
            message = f"the host of '{self.name}' cannot reach '{provider.name}', which is a component of this program"
            raise InputError(f"{message}: host it, too (`dsc host`)", found=provider.name)

    def connect(self, provider: Provider) -> None:
        """Let the host wire the port to a provider."""
        super().connect(provider)
        self._change(provider.name)

    def disconnect(self) -> None:
        """Let the host cut the wire."""
        super().disconnect()
        self._change(None)

    def release(self) -> None:
        """Let the host wire the source again."""
        self.provider = None
        self._change(USUAL)

    def _change(self, to: str | None) -> None:
        if to != self._redirect:
            self.redirect(to)
            self._wires.send(self.name.partition(".")[2], to)


class RemoteWires:
    """Sender of changed wires to the host of a component; a host that was silent or has restarted receives them again.

    Args:
        endpoint: the client's address.
        component: the host's address.
    """

    def __init__(self, endpoint: Endpoint, component: str) -> None:
        self._endpoint = endpoint
        self._component = component
        self._wires: dict[str, str | None] = {}  # those that the host does not wire by itself
        self._unsent: dict[str, str | None] = {}
        self._sending: asyncio.Task[None] | None = None

    def send(self, port: str, to: str | None) -> None:
        """Send the provider of a port, `None` for no wire, or `USUAL` for the source of the port."""
        self._wires.pop(port, None)
        if to != USUAL:
            self._wires[port] = to
        self._unsent[port] = to
        self.repeat()

    def send_all(self) -> None:
        """Send all wires to a host that has restarted."""
        self._unsent = {**self._unsent, **self._wires}
        self.repeat()

    def repeat(self) -> None:
        """Send what the host has not answered."""
        if self._unsent and (self._sending is None or self._sending.done()):
            self._sending = asyncio.get_running_loop().create_task(self._send())

    async def _send(self) -> None:
        while self._unsent:
            port, to = next(iter(self._unsent.items()))
            try:
                await self._endpoint.call(self._component, "wire", {"port": port, "to": to}, WITHIN)
            except NoAnswerError as error:
                _LOG.warning("the wire of '%s.%s' has not changed yet: %s", self._component, port, error)
                return
            except RefusedError as error:
                _LOG.warning("the wire of '%s.%s' has not changed: %s", self._component, port, error)
            if self._unsent.get(port, to) == to:
                del self._unsent[port]


def requirement_form(port: Requirement) -> dict[str, Any]:
    """Return a required port as plain data, for `requirement_of`."""
    service = port.service
    return {
        "source": port.source,
        "service": [service.pattern, dict(service.takes), dict(service.gives), sorted(service.defaults)],
    }


def requirement_of(name: str, form: Mapping[str, Any], wires: RemoteWires) -> RemoteRequirement:
    """Return the port of a form that `requirement_form` returned."""
    pattern, takes, gives, defaults = form["service"]
    return RemoteRequirement(Service(pattern, takes, gives, frozenset(defaults)), form["source"], name, wires)
