"""`dsc doctor`."""

from __future__ import annotations

import json
import sys
from typing import Annotated, Any

import typer

PIPE_WIDTH = 120
"""Columns of a table that is not printed on a terminal."""

EVERY_ENGINE = (
    "Negative conditions, disjunctions, quantifiers, conditional effects and derived predicates are compiled away,"
    " so that every engine can do them."
)


def doctor_command(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Show which planning engines there are, what each can do, and how to install what is missing."""
    from planning.engines.doctor import findings

    found = findings()
    if as_json:
        typer.echo(json.dumps(found))
        return
    from rich.console import Console

    console = Console(width=None if sys.stdout.isatty() else PIPE_WIDTH)
    console.print(_engine_table(found["engines"]))
    for one in found["engines"]:
        if not one["ready"]:
            console.print(f"  {one['name']}: {one['to_do']}", markup=False, highlight=False)
    console.print(EVERY_ENGINE, highlight=False)
    versions = {"Python": found["python"], "Java": found["java"], **found["packages"]}
    said = ", ".join(f"{name} {version or '(none)'}" for name, version in versions.items())
    console.print(f"\n{said}; {found['system']}", markup=False, highlight=False)


def _engine_table(engines: list[dict[str, Any]]) -> Any:
    from rich.table import Table

    table = Table(title="planning engines", title_justify="left")
    for head in ("engine", "version", "can do", "plans", "by itself", "licence"):
        table.add_column(head, overflow="fold")
    for one in engines:
        plans = "the cheapest" if one["optimal"] else "better and better" if one["anytime"] else "one"
        version = one["version"] or "missing" if one["ready"] else "[yellow]missing[/]"
        races = "races" if one["races"] else "by name only"
        table.add_row(one["name"], version, ", ".join(one["can_do"]), plans, races, one["licence"])
    return table
