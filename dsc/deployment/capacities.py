"""Resources of hosts: enough for the active components of each mode (S1.21)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from dsc.deployment.model import Deployment
from dsc.deployment.words import finding_at, in_mode, quoted_list
from dsc.errors import Finding

RESOURCES = "deployment-resources"


def check_resources(deployment: Deployment) -> Iterator[Finding]:
    """Yield the resources of which a host has too little in a mode."""
    found: set[tuple[str, str, tuple[str, ...]]] = set()
    for mode, active in deployment.active().items():
        for host in deployment.hosts:
            capacity = deployment.capacity(host)
            used: dict[str, dict[str, float]] = {}
            for name, _, demand in deployment.demands_on(host, active):
                for resource, amount in demand.resources.items():
                    users = used.setdefault(resource, {})
                    users[name] = users.get(name, 0.0) + amount
            for resource, users in used.items():
                key = (host, resource, tuple(users))
                problem = _shortage(deployment, resource, capacity.get(resource), users)
                if problem and key not in found:
                    found.add(key)
                    yield finding_at(deployment, ("hosts", host), f"host '{host}' {problem}{in_mode(mode)}", RESOURCES)


def _shortage(deployment: Deployment, resource: str, capacity: float | None, users: Mapping[str, float]) -> str | None:
    declared = deployment.resources.get(resource)
    unit = f" {declared.unit}" if declared is not None and declared.unit else ""
    if declared is not None and declared.exclusive:
        return f"has one '{resource}' for {quoted_list(users)}" if len(users) > 1 else None
    if capacity is None:
        return f"has no resource '{resource}', which {quoted_list(users)} {'uses' if len(users) == 1 else 'use'}"
    if (total := sum(users.values())) <= capacity:
        return None
    parts = ", ".join(f"{name} {amount:g}" for name, amount in sorted(users.items(), key=lambda one: -one[1]))
    return f"has {capacity:g}{unit} of '{resource}', but its components use {total:g}{unit} ({parts})"
