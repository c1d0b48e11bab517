"""Deployment models: the hosts of a robot, and what its components need of them (S1.12, S0.16)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from pydantic import Field

from dsc.components.demands import Amount, Demand
from dsc.deployment.schedule import Policy
from dsc.model.language import Frozen, Written
from dsc.model.reading import FormPath
from dsc.text.yaml import load_document, read_file, read_model
from knowledge_base.origin import origin_of

EVERY_MODE = "all"
"""Name of the only mode of a deployment that declares no modes: all components are active, in all their modes."""


class Platform(Frozen):
    """A kind of host.

    Attributes:
        cores: number of processor cores.
        scheduling: the choice of each core among ready tasks.
        resources: capacity of each resource by name.
    """

    cores: int = Field(default=1, ge=1, le=1024)
    scheduling: Policy = "fixed_priority"
    resources: dict[str, Amount] = Field(default_factory=dict)


class Host(Frozen):
    """A computer of the robot; `resources` are capacities that differ from those of its platform."""

    platform: str
    resources: dict[str, Amount] = Field(default_factory=dict)


class Device(Frozen):
    """A device at a host; `shared` permits several components to use it at the same time."""

    kind: str
    host: str
    shared: bool = False


class Resource(Frozen):
    """A resource of hosts, divided among components; only one component at a time has an `exclusive` resource."""

    unit: str = ""
    exclusive: bool = False


class Placed(Demand):
    """A component on a host, with its demands in all modes, and with further ones in some of its modes.

    Attributes:
        host: name of the host; without it, a group places the component.
        modes: further demands by mode of the component.
    """

    host: str | None = None
    modes: dict[str, Demand] = Field(default_factory=dict)

    def demands(self, mode: str | None) -> Iterator[tuple[FormPath, Demand]]:
        """Yield the demands in a mode of the component, with their paths; those of all modes for `None`."""
        yield (), self
        for name, demand in self.modes.items():
            if mode in {None, name}:
                yield ("modes", name), demand


class Group(Frozen):
    """Components that are placed on one host together."""

    host: str
    components: tuple[str, ...]


class Deployment(Written):
    """A deployment model.

    Attributes:
        name: name of the deployment (`deployment`).
        robot: the robot with these components, as for `dsc run`; a path is relative to the file.
        profile: a profile of the robot.
        platforms: kinds of hosts.
        hosts: computers.
        devices: devices at hosts.
        resources: resources of hosts, with their units.
        components: components with their demands.
        groups: components that are placed together.
        modes: for each mode of the robot, its active components with their modes; `neutral` has no further demands.
            Without modes, all components are active, in all their modes together.
    """

    name: str = Field(alias="deployment", pattern=r"^[a-zA-Z_][\w\-]*$")
    about: str | None = None
    robot: str | None = None
    profile: str | None = None
    platforms: dict[str, Platform] = Field(min_length=1)
    hosts: dict[str, Host] = Field(min_length=1)
    devices: dict[str, Device] = Field(default_factory=dict)
    resources: dict[str, Resource] = Field(default_factory=dict)
    components: dict[str, Placed] = Field(default_factory=dict)
    groups: dict[str, Group] = Field(default_factory=dict)
    modes: dict[str, dict[str, str]] = Field(default_factory=dict)

    def host_of(self, component: str) -> str | None:
        """Return the name of the host of a component: its own, or that of its group; `None` without either."""
        if (own := self.components[component].host) is not None:
            return own
        return next((group.host for group in self.groups.values() if component in group.components), None)

    def active(self) -> Mapping[str, Mapping[str, str | None]]:
        """Return the active components of each mode of the robot, with their modes; `None` stands for all modes."""
        return self.modes or {EVERY_MODE: dict.fromkeys(self.components)}

    def demands_on(self, host: str, active: Mapping[str, str | None]) -> Iterator[tuple[str, FormPath, Demand]]:
        """Yield the demands of the active components on a host: component, path in the model, and demand."""
        for name, mode in active.items():
            if self.host_of(name) == host:
                for path, demand in self.components[name].demands(mode):
                    yield name, ("components", name, *path), demand

    def amount(self, resource: str, amount: float) -> str:
        """Return an amount of a resource with its unit, e.g. `memory 200 MB`."""
        unit = self.resources[resource].unit if resource in self.resources else ""
        return f"{resource} {amount:g} {unit}".rstrip()

    def capacity(self, host: str) -> dict[str, float]:
        """Return the capacity of each resource of a host."""
        found = self.hosts[host]
        return self.platforms[found.platform].resources | found.resources


def parse_deployment(text: str, source: str | None = None) -> Deployment:
    """Return the deployment model that YAML text contains; `source` is the file name in messages.

    Raises:
        InputError: the text is not a deployment model; the message has the place and the nearest valid key.
    """
    document = load_document(text, origin_of(text, source))
    return read_model(Deployment, document).written_at(document.places)


def load_deployment(path: Path | str) -> Deployment:
    """Return the deployment model in a file; errors as for `parse_deployment` and `read_file`."""
    return parse_deployment(read_file(path), str(path))
