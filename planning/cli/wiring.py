"""Command `dsc wiring`: which provided port serves each required port of a robot, and why."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from knowledge_base.cli.console import Json, print_line

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from dsc.components.component import Component
    from dsc.text.profiles import Profile


def wiring_command(
    target: Annotated[str, typer.Argument(metavar="TARGET", help="The robot, as for dsc run.")],
    profile: Annotated[str | None, typer.Option(help="A profile of the robot, or its file.")] = None,
    as_json: Json = False,
) -> None:
    """List the required ports of a robot's components, and their providers.

    Exit status: 0 if each required port has a provider; 2 otherwise.
    """
    from dsc.components.wiring import choose_sources
    from dsc.profiles import configure
    from dsc.text.profiles import find_profile
    from planning.robot.bringup import components_for
    from planning.robot.bundles import gathered, wiring_of
    from planning.robot.targets import bundle_at

    bundle = bundle_at(target)
    settings = None if profile is None else find_profile(profile, bundle.profiles or Path())
    components = {one.name: one for one in components_for(bundle, settings)}
    of_bundle = wiring_of(gathered([bundle]))
    choose_sources(components.values(), of_bundle)
    configure(components.values(), settings)
    wires = list(_wires(components, of_bundle, settings))
    if as_json:
        print_line(wires)
    else:
        for one in wires:
            provider, by = one["provider"] or "not wired", one["by"] if one["provider"] else ""
            typer.echo(f"{one['port']:24} {provider:24} {by:10} {one['service']}")
        for one in wires:
            if one["error"]:
                typer.echo(one["error"])
        if not wires:
            typer.echo(f"the components of '{bundle.name}' require no ports")
    raise typer.Exit(2 if any(one["error"] for one in wires) else 0)


def _wires(
    components: Mapping[str, Component], of_bundle: Mapping[str, str], profile: Profile | None
) -> Iterator[dict[str, Any]]:
    """Yield each required port with its provider, with what has chosen the provider, and with its error."""
    from dsc.components.wiring import provider_for, wiring_errors
    from planning.execution.goal_skills import planner_services

    planner = planner_services()
    providers = {**components, planner.name: planner}
    errors = {port.name: str(error) for port, error in wiring_errors(providers.values())}
    for component in components.values():
        for port in component.requirements.values():
            provider = None if port.name in errors else provider_for(port, component, providers)
            by = "service"
            if profile is not None and port.name in profile.wiring:
                by = "profile"
            elif port.name in of_bundle:
                by = "bundle"
            elif port.source is not None:
                by = "component"
            yield {
                "port": port.name, "service": str(port.service), "by": by, "error": errors.get(port.name),
                "provider": None if provider is None else provider.name,
            }  # fmt: skip
