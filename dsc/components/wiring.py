"""Connects streams of deployed components to the push ports that they name: the wiring inside one process (S1.1)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from dsc.components.streams import Push, Stream, require_fitting
from knowledge_base.errors import UnknownNameError

if TYPE_CHECKING:
    from dsc.components.component import Component


class Wiring:
    """All connections between components that are deployed together; who is deployed late is connected then.

    Raises:
        UnknownNameError: a stream names a port, or a value of it, that its component does not have.
        SchemaError: a value is of another type than the stream wants.
    """

    def __init__(self, components: Mapping[str, Component]) -> None:
        self._components = components
        self._connected: dict[Stream, Push] = {}
        for component in components.values():
            self._connect(component)

    def deployed(self, component: Component) -> None:
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

    def _connect(self, component: Component) -> None:
        for stream in component.streams.values():
            publisher = self._components.get(stream.publisher)
            if publisher is not None and stream not in self._connected:
                self._connected[stream] = port = port_for(stream, publisher)
                port.listen(stream.hear)


def port_for(stream: Stream, publisher: Component) -> Push:
    """The port that a stream names, if it fits; raises `UnknownNameError` and `SchemaError` as `Wiring`."""
    if stream.port not in publisher.pushes:
        message = f"component '{publisher.name}' has no push port '{stream.port}'"
        raise UnknownNameError(message, found=stream.port, valid=publisher.pushes)
    require_fitting(stream.source, stream.values, publisher.pushes[stream.port].values)
    return publisher.pushes[stream.port]


def require_wired(components: Iterable[Component]) -> None:
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
