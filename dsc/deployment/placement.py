"""Placement: names that a deployment model declares, and the host of each component."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from dsc.deployment.model import Deployment
from dsc.deployment.words import finding_at
from dsc.errors import Finding
from dsc.model.reading import FormPath
from knowledge_base.errors import UnknownNameError

PLACEMENT = "deployment-placement"


def check_placement(deployment: Deployment) -> Iterator[Finding]:
    """Yield names that the model does not declare, and components with no host or with several."""
    hosts, components = deployment.hosts, deployment.components
    for name, host in hosts.items():
        yield from _unknown(deployment, ("hosts", name, "platform"), "platform", host.platform, deployment.platforms)
    for name, device in deployment.devices.items():
        yield from _unknown(deployment, ("devices", name, "host"), "host", device.host, hosts)
    places: dict[str, list[str]] = {name: [] if one.host is None else [one.host] for name, one in components.items()}
    for name, group in deployment.groups.items():
        yield from _unknown(deployment, ("groups", name, "host"), "host", group.host, hosts)
        for number, member in enumerate(group.components):
            path = ("groups", name, "components", number)
            yield from _unknown(deployment, path, "component", member, components)
            places.setdefault(member, []).append(f"group {name}")
    for name, one in components.items():
        if one.host is not None:
            yield from _unknown(deployment, ("components", name, "host"), "host", one.host, hosts)
        if len(places[name]) != 1:
            found = (
                f"has several hosts: {', '.join(places[name])}" if places[name] else "has no host, and is in no group"
            )
            yield finding_at(deployment, ("components", name), f"component '{name}' {found}", PLACEMENT)
    yield from _modes(deployment)


def _modes(deployment: Deployment) -> Iterator[Finding]:
    for mode, active in deployment.modes.items():
        for name, state in active.items():
            path = ("modes", mode, name)
            if name not in deployment.components:
                yield from _unknown(deployment, path, "component", name, deployment.components)
            elif state != "neutral" and deployment.components[name].modes:
                modes = {"neutral", *deployment.components[name].modes}
                yield from _unknown(deployment, path, f"mode of component '{name}' with the name", state, modes)


def _unknown(deployment: Deployment, path: FormPath, kind: str, name: str, valid: Collection[str]) -> Iterator[Finding]:
    if name not in valid:
        error = UnknownNameError(f"there is no {kind} '{name}'", found=name, valid=valid)
        error.place = deployment.place(path)
        yield Finding(error, PLACEMENT)
