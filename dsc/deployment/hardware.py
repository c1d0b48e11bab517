"""Required hardware: a device of the host for each demand (S1.12)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import networkx as nx

from dsc.deployment.model import Deployment
from dsc.deployment.words import finding_at, in_mode, quoted_list
from dsc.errors import Finding
from dsc.model.reading import FormPath

HARDWARE = "deployment-hardware"


def check_hardware(deployment: Deployment) -> Iterator[Finding]:
    """Yield the demands that the devices of a host do not meet.

    A device that is not shared serves one component at a time; the assignment is a maximum matching.
    """
    missing: set[FormPath] = set()
    for mode, active in deployment.active().items():
        for host in deployment.hosts:
            demands = {
                (*path, "hardware", number): (name, wanted)
                for name, path, demand in deployment.demands_on(host, active)
                for number, wanted in enumerate(demand.hardware)
            }
            served = _find_served(deployment, host, demands)
            for path in [one for one in demands if one not in served and one not in missing]:
                missing.add(path)
                yield finding_at(deployment, path, _lack(deployment, host, mode, *demands[path]), HARDWARE)


def _find_served(deployment: Deployment, host: str, demands: Mapping[FormPath, tuple[str, str]]) -> set[FormPath]:
    """Return the demands with a device, if each device that is not shared serves one demand."""
    here = {name: device for name, device in deployment.devices.items() if device.host == host}
    fitting = {
        path: [name for name, device in here.items() if wanted in {name, device.kind}]
        for path, (_, wanted) in demands.items()
    }
    shared = {path for path, names in fitting.items() if any(here[name].shared for name in names)}
    # Nodes are numbers, since networkx stores nodes in sets, and texts have another order in each process.
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(range(len(demands)))
    numbers = {name: number for number, name in enumerate(here, len(demands))}
    graph.add_edges_from(
        (one, numbers[name]) for one, names in enumerate(fitting.values()) for name in names if not here[name].shared
    )
    matching = nx.bipartite.hopcroft_karp_matching(graph, top_nodes=range(len(demands)))
    return shared | {path for one, path in enumerate(demands) if one in matching}


def _lack(deployment: Deployment, host: str, mode: str, component: str, wanted: str) -> str:
    fitting = {name: one for name, one in deployment.devices.items() if wanted in {name, one.kind}}
    here = [name for name, one in fitting.items() if one.host == host]
    if here:
        active = deployment.active()[mode]
        users = {name for name, _, one in deployment.demands_on(host, active) if {*here, wanted} & {*one.hardware}}
        others = quoted_list(sorted(users - {component})) or f"'{component}' itself"
        remedy = "add a device, or declare it `shared: true`"
        return (
            f"component '{component}' needs '{wanted}'{in_mode(mode)}, but {others} uses {quoted_list(here)}; {remedy}"
        )
    elsewhere = [f"'{name}' at host '{one.host}'" for name, one in fitting.items()]
    at_host = [f"'{name}' ({one.kind})" for name, one in deployment.devices.items() if one.host == host]
    found = f"there is {', '.join(elsewhere)}" if elsewhere else f"it has {', '.join(at_host) or 'no devices'}"
    return f"component '{component}' needs '{wanted}', but host '{host}' has no such device; {found}"
