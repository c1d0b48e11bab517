"""Deployment models of robots: the demands and ports of a robot's classes, with the model that places them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from dsc.components.component import ALWAYS, Component
from dsc.components.demands import Demand
from dsc.components.wiring import choose_sources, provider_for, wiring_errors
from dsc.deployment.checks import check_deployment
from dsc.deployment.deadlines import SCHEDULE
from dsc.deployment.model import Deployment, Placed, load_deployment
from dsc.deployment.placement import PLACEMENT
from dsc.deployment.words import finding_at
from dsc.errors import Finding
from dsc.model.reading import FormPath
from dsc.profiles import configure
from dsc.text.profiles import find_profile
from knowledge_base.errors import InputError, UnknownNameError
from planning.execution.goal_skills import planner_services
from planning.robot.bringup import components_for
from planning.robot.bundles import gathered, wiring_of
from planning.robot.project_files import READABLE
from planning.robot.targets import bundle_at

NEEDS = "deployment-needs"


def check_deployment_file(file: Path) -> list[Finding]:
    """Return the mistakes of the deployment model in a file, its robot included."""
    try:
        deployment = load_deployment(file)
        return check_robot(deployment, robot_at(deployment, file.parent))
    except InputError as error:
        return [Finding(error, READABLE)]


class Parts(NamedTuple):
    """The components of a robot by name, and the names of those that other programs host."""

    components: Mapping[str, Component]
    remote: Collection[str]


def robot_at(deployment: Deployment, folder: Path) -> Parts:
    """Return the components of a deployment's robot, with its profile; none without a robot.

    Args:
        deployment: the model.
        folder: the folder that relative paths of the model start from.

    Raises:
        InputError: the robot or the profile cannot be read.
    """
    if deployment.robot is None:
        return Parts({}, ())
    with _placed_at(deployment, "robot"):
        bundle = bundle_at(_found_in(folder, deployment.robot))
    profile = None
    if deployment.profile is not None:
        with _placed_at(deployment, "profile"):
            profile = find_profile(_found_in(folder, deployment.profile), bundle.profiles or folder)
    components = components_for(bundle, profile)
    choose_sources(components, wiring_of(gathered([bundle])))
    configure(components, profile)
    return Parts({one.name: one for one in components}, bundle.remote)


@contextmanager
def _placed_at(deployment: Deployment, key: str) -> Iterator[None]:
    """Give the errors of the block that have no line the place of a key of the model."""
    try:
        yield
    except InputError as error:
        if error.place is None or error.place.line is None:
            error.place = deployment.place((key,))
        raise


def _found_in(folder: Path, name: str) -> str:
    """Return a name as a path in the folder, if it is a file's name or a folder there; else the name."""
    file = folder / name.partition(":")[0]
    return str(folder / name) if file.suffix in {".py", ".yaml", ".yml"} or file.exists() else name


def with_demands_of(deployment: Deployment, components: Iterable[Component]) -> Deployment:
    """Return the deployment with the demands of the components' classes; those of the model replace them by name.

    A component of the robot that a group places needs no separate entry.
    """
    members = {member for group in deployment.groups.values() for member in group.components}
    placed = dict(deployment.components)
    for one in components:
        if one.name in placed or one.name in members:
            placed[one.name] = _over(one, placed.get(one.name, Placed()))
    return deployment.model_copy(update={"components": placed})


def check_robot(deployment: Deployment, robot: Parts) -> list[Finding]:
    """Return the mistakes of a deployment model, also in comparison with its robot."""
    components = robot.components
    whole = with_demands_of(deployment, components.values())
    absent = [
        finding_at(deployment, ("components",), f"component '{name}' of the robot has no host", PLACEMENT)
        for name in [*components, *robot.remote]
        if name not in whole.components
    ]
    unknown = list(_unknown(deployment, robot)) if components or robot.remote else []
    errors = (
        [] if robot.remote else wiring_errors([*components.values(), planner_services()])
    )  # the ports of other programs are unknown
    unwired = [Finding(error, "wiring") for _, error in errors]
    needs = [] if unwired or unknown or robot.remote else _inactive(deployment, components)
    other_periods = _other_periods(whole, components)
    return [*absent, *unknown, *unwired, *needs, *other_periods, *check_deployment(whole)]


def _unknown(deployment: Deployment, robot: Parts) -> Iterator[Finding]:
    """Yield the components of the model, and their modes, that the robot does not have."""
    names = [*robot.components, *robot.remote]
    for name, placed in deployment.components.items():
        if name not in names:
            yield _unknown_name(deployment, ("components", name), f"the robot has no component '{name}'", names)
        modes = [*robot.components[name].modes] if name in robot.components else []
        for mode in placed.modes if modes else ():
            if mode not in modes:
                message = f"component '{name}' has no mode '{mode}'"
                yield _unknown_name(deployment, ("components", name, "modes", mode), message, modes)


def _unknown_name(deployment: Deployment, path: FormPath, message: str, valid: Collection[str]) -> Finding:
    error = UnknownNameError(message, found=str(path[-1]), valid=valid)
    error.place = deployment.place(path)
    return Finding(error, PLACEMENT)


def _other_periods(deployment: Deployment, components: Mapping[str, Component]) -> Iterator[Finding]:
    """Yield the tasks `step` whose period is not that of the component's periodic steps."""
    for name, placed in deployment.components.items():
        period = components[name].period if name in components else None
        for path, demand in placed.demands(None):
            task = demand.tasks.get("step")
            if period is not None and task is not None and task.period != period:
                message = (
                    f"task 'step' has a period of {task.period:g} s, but component '{name}' steps every {period:g} s"
                )
                yield finding_at(deployment, ("components", name, *path, "tasks", "step", "period"), message, SCHEDULE)


def _inactive(deployment: Deployment, components: Mapping[str, Component]) -> Iterator[Finding]:
    """Yield the components that an active component needs, and that are not active in the same mode of the robot."""
    for mode, active in deployment.modes.items():
        for name, state in active.items():
            for needed in _needs(components[name], state, components) if name in components else ():
                if needed in components and needed not in active:
                    message = f"component '{name}' needs '{needed}', which is not active in mode '{mode}'"
                    yield finding_at(deployment, ("modes", mode, name), message, NEEDS)


def _needs(component: Component, mode: str, components: Mapping[str, Component]) -> Iterator[str]:
    """Yield the names of the components that a component needs in a mode; a port stands for its provider."""
    for name in dict.fromkeys((*component.needs.get(ALWAYS, ()), *component.needs.get(mode, ()))):
        port = component.requirements.get(name)
        if port is None:
            yield name
        elif (provider := provider_for(port, component, components)) is not None:
            yield provider.component.name


def _over(component: Component, placed: Placed) -> Placed:
    """Return a placed component with the modes of the component, and with the demands of its class below its own."""
    declared = component.demands
    modes = dict.fromkeys((*component.modes, *declared, *placed.modes))
    below = {
        mode: _merge(declared.get(mode, Demand()), placed.modes.get(mode, Demand())) for mode in modes if mode != ALWAYS
    }
    return placed.model_copy(update={**dict(_merge(declared.get(ALWAYS, Demand()), placed)), "modes": below})


def _merge(declared: Demand, given: Demand) -> Demand:
    return Demand(
        hardware=given.hardware or declared.hardware,
        resources={**declared.resources, **given.resources},
        tasks={**declared.tasks, **given.tasks},
    )
