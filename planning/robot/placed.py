"""Deployment models of robots: the demands and ports of a robot's classes, with the model that places them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from dsc.components.component import ALWAYS, Component
from dsc.components.demands import Demand
from dsc.components.wiring import choose_sources, wiring_errors
from dsc.deployment.checks import check_deployment
from dsc.deployment.model import Deployment, Placed
from dsc.deployment.placement import PLACEMENT
from dsc.deployment.words import finding_at
from dsc.errors import Finding
from dsc.profiles import configure
from dsc.text.profiles import find_profile
from knowledge_base.errors import UnknownNameError
from planning.robot.bringup import components_for
from planning.robot.bundles import gathered, wiring_of
from planning.robot.targets import bundle_at

WIRING = "deployment-wiring"


def components_at(deployment: Deployment, folder: Path) -> dict[str, Component]:
    """Return the components of a deployment's robot by name, with its profile; none without a robot.

    Args:
        deployment: the model.
        folder: the folder that relative paths of the model start from.

    Raises:
        InputError: the robot or the profile cannot be read.
    """
    if deployment.robot is None:
        return {}
    bundle = bundle_at(_found_in(folder, deployment.robot))
    name = deployment.profile
    profile = None if name is None else find_profile(_found_in(folder, name), bundle.profiles or folder)
    components = components_for(bundle, profile)
    choose_sources(components, wiring_of(gathered([bundle])))
    configure(components, profile)
    return {one.name: one for one in components}


def _found_in(folder: Path, name: str) -> str:
    """Return a name as a path in the folder, if there is such a file or folder; else the name."""
    return str(folder / name) if (folder / name.partition(":")[0]).exists() else name


def with_demands_of(deployment: Deployment, components: Iterable[Component]) -> Deployment:
    """Return the deployment with the demands of the components' classes; those of the model replace them by name.

    A component of the robot that a group places needs no separate entry.
    """
    members = {member for group in deployment.groups.values() for member in group.components}
    placed = dict(deployment.components)
    for one in components:
        if one.name in placed or one.name in members:
            placed[one.name] = _over(one.demands, placed.get(one.name, Placed()))
    return deployment.model_copy(update={"components": placed})


def check_robot(deployment: Deployment, components: Mapping[str, Component]) -> list[Finding]:
    """Return the mistakes of a deployment model, also in comparison with the components of its robot."""
    whole = with_demands_of(deployment, components.values())
    absent = [
        finding_at(deployment, ("components",), f"component '{name}' of the robot has no host", PLACEMENT)
        for name in components
        if name not in whole.components
    ]
    unknown = list(_unknown(deployment, components)) if components else []
    unwired = [Finding(error, WIRING) for _, error in wiring_errors(components.values())]
    return [*absent, *unknown, *unwired, *check_deployment(whole)]


def _unknown(deployment: Deployment, components: Mapping[str, Component]) -> Iterator[Finding]:
    """Yield the components of the model that the robot does not have."""
    for name in deployment.components:
        if name not in components:
            error = UnknownNameError(f"the robot has no component '{name}'", found=name, valid=components)
            error.place = deployment.place(("components", name))
            yield Finding(error, PLACEMENT)


def _over(declared: Mapping[str, Demand], placed: Placed) -> Placed:
    """Return a placed component with the demands of its class below its own."""
    modes = dict.fromkeys(mode for mode in (*declared, *placed.modes) if mode != ALWAYS)
    below = {mode: _merge(declared.get(mode, Demand()), placed.modes.get(mode, Demand())) for mode in modes}
    return placed.model_copy(update={**dict(_merge(declared.get(ALWAYS, Demand()), placed)), "modes": below})


def _merge(declared: Demand, given: Demand) -> Demand:
    return Demand(
        hardware=given.hardware or declared.hardware,
        resources={**declared.resources, **given.resources},
        tasks={**declared.tasks, **given.tasks},
    )
