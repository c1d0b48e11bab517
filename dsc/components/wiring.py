"""Wiring: which provided port serves which required port, by service, by the profile, and during a run (S0.16, S1.18).

A port that fits only one provider is wired by itself. A profile names the others:

```yaml
wiring:
  map_maker.scan: rear.scan     # a port
  tuner.camera: left_camera     # a component, for its parameters, its modes, or its only port that fits
```
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from dsc.components.component import Component
from dsc.components.life_cycle import Announcer
from dsc.components.requirement import Provider, Requirement
from dsc.components.services import Service, ambiguous, fits, named_service, require_fitting
from knowledge_base.errors import InputError, SchemaError, UnknownNameError


def providers_of(component: Component) -> list[Provider]:
    """Return the provided ports of a component: push ports, queries, events, messages, parameters and modes."""
    services = component.interface().services(component.skills().values())
    return [Provider(component, port, service) for port, service in services]


def choose_sources(components: Iterable[Component], wiring: Mapping[str, str]) -> None:
    """Set the sources of required ports; `wiring` has provided ports by required ports, as `component.port`.

    Raises:
        UnknownNameError: no component requires such a port.
    """
    ports = {port.name: port for one in components for port in one.requirements.values() if not port.is_hosted}
    for name, provider in wiring.items():
        if name not in ports:
            raise UnknownNameError(f"there is no required port '{name}'", found=name, valid=ports)
        ports[name].source = provider


def name_sources(owners: Iterable[Component], components: Iterable[Component]) -> None:
    """Set the source of each required port of the owners without one to its only provider among the components.

    Raises:
        InputError: several services fit a port.
    """
    deployed = {one.name: one for one in components}
    for owner in owners:
        for port in owner.requirements.values():
            if port.source is None and (provider := provider_for(port, owner, deployed)) is not None:
                port.source = provider.name


def require_wired(components: Iterable[Component]) -> None:
    """Raise the first error of `wiring_errors`, if there is one."""
    for _, error in wiring_errors(components):
        raise error


def wiring_errors(components: Iterable[Component]) -> Iterator[tuple[Requirement, InputError]]:
    """Yield each required port that has no provider, or several, or an unfit source, with the error."""
    deployed = {component.name: component for component in components}
    for component in deployed.values():
        for port in component.requirements.values():
            if port.is_hosted:
                continue
            try:
                provider = provider_for(port, component, deployed)
            except InputError as error:
                yield port, error
            else:
                if provider is None and not port.optional:
                    yield port, _missing(port, component, deployed.values())


def required_port(
    name: str, components: Mapping[str, Component], to: str | None = None
) -> tuple[Component, Requirement]:
    """Return the component and its required port for `component.port`.

    Raises:
        UnknownNameError: there is no such component or port.
        InputError: the provider `to` does not fit the port, see `provider_for`.
    """
    component, _, port = name.partition(".")
    if component not in components:
        raise UnknownNameError(f"there is no component '{component}'", found=component, valid=components)
    owner = components[component]
    owner.interface().require_port(component, port)
    required = owner.requirements[port]
    if to is not None and (provider := provider_for(required, owner, components, to)) is not None:
        required.require_reachable(provider)
    return owner, required


def provider_for(
    port: Requirement, owner: Component, components: Mapping[str, Component], chosen: str | None = None
) -> Provider | None:
    """Return the provider of a required port; `None` if no service fits.

    Args:
        port: the required port.
        owner: the component that requires it.
        components: the deployed components, by name.
        chosen: the provider that a plot names; by default the port's source.

    Raises:
        UnknownNameError: the chosen component or port does not exist.
        SchemaError: the chosen service does not fit.
        InputError: several services fit, and none is chosen.
    """
    named = chosen or port.source
    if named is not None:
        return _provider_named(port, named, components)
    found = [provider for one in components.values() if one is not owner for provider in providers_of(one)]
    fitting = [one for one in found if fits(one.name, port.service, one.service)]
    if len(fitting) > 1:
        error = ambiguous(port.name, [one.name for one in fitting])
        error.place = port.place
        raise error
    return fitting[0] if fitting else None


def _provider_named(port: Requirement, named: str, components: Mapping[str, Component]) -> Provider:
    """Return the provider `component.port`, or the only one of a component that fits."""
    name = named.partition(".")[0]
    offers: dict[str, list[tuple[str, Service]]] = {one: [] for one in components}
    if name in components:
        offers[name] = [(one.port, one.service) for one in providers_of(components[name])]
    chosen = named_service(port.name, port.service, named, offers)
    return Provider(components[name], *chosen)


def _missing(port: Requirement, owner: Component, components: Iterable[Component]) -> InputError:
    """Return the error about a port without a provider, with the reasons of those of equal pattern."""
    message = f"port '{port.name}' wants a {port.service}, and no component has one"
    reasons = []
    for one in components:
        for provider in providers_of(one) if one is not owner else ():
            if provider.service.pattern == port.service.pattern:
                try:
                    require_fitting(provider.name, port.service, provider.service)
                except InputError as error:
                    reasons.append(str(error))
    return SchemaError("; ".join([message, *reasons[:3]]), found=port.name, place=port.place)


class Wiring(Announcer):
    """The wires of a run, also to components that are deployed late; announces changes.

    Args:
        components: the deployed components, by name.

    Attributes:
        changes: by required port, the wires of states and operators, the effective one last.

    Raises:
        UnknownNameError: the source of a port, or a value of it, does not exist.
        SchemaError: the service of a source does not fit.
        InputError: several services fit a required port without a source.
    """

    def __init__(self, components: Mapping[str, Component]) -> None:
        super().__init__()
        self._components = components
        self._joined: dict[Requirement, Component] = {}
        self.changes: dict[str, list[tuple[int, str | None]]] = {}  # activations, and providers
        self._connect_all()

    def wires(self) -> dict[str, dict[str, str | None]]:
        """Return the providers of required ports by component and port; the provider of a cut wire is `None`."""
        return {
            owner.name: {port: one.provider_name() for port, one in owner.requirements.items()}
            for owner in [*self._components.values()]  # also for other threads
            if owner.requirements
        }

    def deployed(self, component: Component) -> None:
        """Connect a newly deployed component, which may replace another one."""
        for port, owner in tuple(self._joined.items()):
            if owner.name == component.name and owner is not component:
                self._leave(port)
            elif port.provider is not None and port.provider.component.name == component.name:
                port.disconnect()
        self._connect_all()

    def wire(self, port: str, to: str | None, activation: int = 0) -> None:
        """Wire a required port to a provided one, or to none, until `revert`.

        Args:
            port: the required port, as `component.port`.
            to: the provided port, as `component.port`, or the component; `None` cuts the wire.
            activation: the activation of the state that wires; 0 for an operator, whose wire stays below those of
                states.

        Raises:
            InputError: as for `provider_for`; then nothing has changed.
        """
        owner, required = required_port(port, self._components, to)
        changes = [one for one in self.changes.get(port, ()) if one[0] != activation]
        changes.insert(0 if activation == 0 else len(changes), (activation, to))
        self.changes[port] = changes
        self._connect(required, owner)

    def revert(self, activation: int) -> None:
        """End the wires of a state that is left: the ports have the wires of before."""
        for port, changes in tuple(self.changes.items()):
            if any(one == activation for one, _ in changes):
                self.changes[port] = [one for one in changes if one[0] != activation]
                owner, required = required_port(port, self._components)
                self._connect(required, owner)

    def close(self) -> None:
        """Leave all wires; the last run disconnects them."""
        for port in tuple(self._joined):
            self._leave(port)

    def _connect_all(self) -> None:
        for owner in tuple(self._components.values()):
            for port in owner.requirements.values():
                if port.provider is None or port not in self._joined:
                    self._connect(port, owner)

    def _connect(self, port: Requirement, owner: Component) -> None:
        changes = self.changes.get(port.name)
        if port.is_hosted and not changes:
            if port in self._joined:
                self._leave(port)
                self.announce()
            return
        if port not in self._joined:
            self._joined[port] = owner
            port.join()
        before = port.provider_name()
        chosen = changes[-1][1] if changes else None
        provider = None
        if not changes or chosen is not None:
            provider = self._provider(port, owner, chosen)
        if provider is None:
            port.disconnect()
        else:
            port.connect(provider)
        if port.provider_name() != before:
            self.announce()

    def _provider(self, port: Requirement, owner: Component, chosen: str | None) -> Provider | None:
        """Return the provider of a port; `None` if it is not deployed yet."""
        named = chosen or port.source
        if named is not None and named.partition(".")[0] not in self._components:
            return None
        return provider_for(port, owner, self._components, chosen)

    def _leave(self, port: Requirement) -> None:
        del self._joined[port]
        port.leave()
