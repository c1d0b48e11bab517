"""Command `dsc doctor`: versions, optional parts and planning engines, with the effect of each missing installation."""

from __future__ import annotations

import json
import platform
import re
import shutil
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, requires
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from planning.engines.registry import Engine

DISTRIBUTION = "dynamic-state-charts"
EXTRAS = {
    "viewer": "dsc run --view and dsc view: runs in the browser",
    "bt": "behaviour trees of py_trees as skills",
    "zenoh": "robots in several processes or on several machines",
    "fast": "plans for large problems in less time, improved during the run",
    "numeric": "planning with numbers that actions change",
    "durations": "planning with durations and concurrent actions",
    "numbers": "planning with numbers or durations, without Java",
}
"""The extras for users, with their effect; the other extras are for the development of this project."""
PIPE_WIDTH = 120
"""Width, in columns, of a table that is not printed on a terminal."""

EVERY_ENGINE = (
    "Negative conditions, disjunctions, quantifiers, conditional effects and derived predicates are compiled away,"
    " so that every engine can do them."
)


def doctor_command(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Show engines, optional parts and versions, and how to install missing parts and their effect."""
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
    console.print("\noptional parts", style="italic")
    for name, extra in found["extras"].items():
        state = "installed" if extra["ready"] else extra["to_do"]
        console.print(f"  {name}: {extra['about']} ({state})", markup=False, highlight=False)
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


_JAVA_SECONDS = 10.0


def findings() -> dict[str, Any]:
    """Return plain data: `python`, `system`, `java`, `packages` (versions or null), `engines` and `extras`."""
    from planning.engines.registry import ENGINES, package_version

    return {
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "java": _java(),
        "packages": {name: package_version(name) for name in (DISTRIBUTION, *map(_package_name, _requirements()))},
        "engines": [_engine(one) for one in ENGINES],
        "extras": {name: {"about": about, **_extra(name)} for name, about in EXTRAS.items()},
    }


def _engine(one: Engine) -> dict[str, Any]:
    return {
        "name": one.name,
        "version": one.version,
        "ready": not one.lacks(),
        "to_do": one.lacks(),
        "can_do": ["STRIPS", *sorted(one.features)],
        "optimal": one.optimal,
        "anytime": one.anytime,
        "proves": one.proves,
        "deterministic": one.deterministic,
        "races": one.races,
        "licence": one.licence,
    }


def _extra(name: str) -> dict[str, Any]:
    from planning.engines.registry import package_version

    missing = [one for one in _requirements(name) if package_version(_package_name(one)) is None]
    return {
        "ready": not missing,
        "to_do": " ".join(["pip install", *(f"'{one}'" for one in missing)] if missing else []),
    }


def _requirements(extra: str = "") -> list[str]:
    """Return the distributions, with the bounds of their versions, that every installation or an extra requires."""
    try:
        needed = requires(DISTRIBUTION) or []
    except PackageNotFoundError:  # the project is not installed, e.g. in a plain checkout
        return []
    marked = [one.partition(";") for one in needed]
    wanted = re.compile(rf"extra == ['\"]{extra}['\"]")
    return [name.strip() for name, _, marker in marked if (wanted.search(marker) if extra else "extra" not in marker)]


def _package_name(requirement: str) -> str:
    return re.split(r"[^\w.-]", requirement, maxsplit=1)[0]


def _java() -> str | None:
    program = shutil.which("java")
    if program is None:
        return None
    try:
        said = subprocess.run(  # noqa: S603  the first on the path, as the engine starts it
            [program, "-version"], capture_output=True, text=True, timeout=_JAVA_SECONDS, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    found = re.search(r'version "([^"]+)"', said.stderr + said.stdout)
    return found.group(1) if found else None
