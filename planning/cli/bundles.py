"""`dsc bundles`."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from planning.bundles import Bundle


def bundles_command(
    name: Annotated[str | None, typer.Argument(help="Only this one, with all that it has.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Show the bundles of the installed packages: components, plots and planning actions to build a robot of."""
    from knowledge_base.errors import UnknownNameError
    from planning.bundles import GROUP, installed

    found = installed()
    if name is not None and name not in found:
        raise UnknownNameError(f"there is no bundle '{name}'", found=name, valid=found)
    shown = list(found.values()) if name is None else [found[name]]
    if as_json:
        said = [bundle.to_json() for bundle in shown]
        typer.echo(json.dumps(said if name is None else said[0]))
    elif not shown:
        typer.echo(f"no installed package has bundles (entry points '{GROUP}')")
    elif name is None:
        width = max(map(len, found))
        for bundle in shown:
            typer.echo(f"{bundle.name:<{width}}  {bundle.about or _counted(bundle)}")
    else:
        typer.echo("\n".join(_lines(shown[0].to_json())))


def _counted(bundle: Bundle) -> str:
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
