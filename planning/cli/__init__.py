"""Commands `dsc plan` and `dsc bundles`: find a plan, list bundles.

Each command imports its modules inside its function, so that `dsc --help` stays fast.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from knowledge_base.cli.console import Json

if TYPE_CHECKING:
    from planning.robot.bundles import Bundle


def bundles_command(
    name: Annotated[str | None, typer.Argument(help="Only this bundle, with its content.")] = None,
    as_json: Json = False,
) -> None:
    """Show the bundles of the installed packages: components, plots and planning actions to build a robot of."""
    from planning.robot.bundles import GROUP, installed

    found = installed()
    shown = list(found.values()) if name is None else [found.require(name)]
    for error in found.errors.values() if name is None else ():
        typer.echo(f"dsc: {error}", err=True)
    if as_json:
        said = [bundle.to_json() for bundle in shown]
        typer.echo(json.dumps(said if name is None else said[0]))
    elif not shown:
        typer.echo(f"no installed package has bundles (entry points '{GROUP}')")
    elif name is None:
        width = max(map(len, found))
        for bundle in shown:
            typer.echo(f"{bundle.name:<{width}}  {bundle.about or _count_text(bundle)}")
    else:
        typer.echo("\n".join(_lines(shown[0].to_json())))


def _count_text(bundle: Bundle) -> str:
    return f"plots: {len(bundle.primitive)} primitive, {len(bundle.abstract)} abstract"


def _lines(said: dict[str, Any]) -> list[str]:
    about = f": {said['about']}" if said["about"] else ""
    lines = [f"{said['name']}{about}"]
    lines += [f"component {name}: {', '.join(skills) or 'no skills'}" for name, skills in said["components"].items()]
    for what, title in (
        ("primitive", "primitive plots"), ("abstract", "abstract plots"), ("actions", "planning actions"),
        ("needs", "needs"),
    ):  # fmt: skip
        if said[what]:
            lines.append(f"{title}: {', '.join(said[what])}")
    return lines


def plan_command(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="DOMAIN... PROBLEM", help="PDDL: the domain, in one file or several, and the problem.",
            show_default=False,
        ),
    ],
    engine: Annotated[
        str | None, typer.Option(metavar="NAME", help="The engine.  [default: a race of those that suit the problem]")
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.0, help="Stop after this number of seconds.")] = 10.0,
    parallel: Annotated[bool, typer.Option("--parallel", help="Show which steps can run concurrently.")] = False,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write it as a plot (YAML) to complete; - is standard output.")
    ] = None,
    explain: Annotated[
        bool, typer.Option("--explain", help="Explain each step's purpose, or why there is no plan.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:  # fmt: skip
    """Find a plan and print its steps.

    Exit status: 0 a plan, 1 there is none, 2 bad input, 3 out of time, 4 the planner failed.
    """
    from planning.cli.solving import plan

    plan(files, engine, seconds, plot, parallel=parallel, explain=explain, as_json=as_json)
