"""What the project depends on: its page is made of pyproject.toml and the metadata of what is installed.

`python tests/dependencies.py --write` writes docs/dependencies.md; `--lower` prints the lower bounds of the core and of
what its tests need as constraints for pip.
"""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "dependencies.md"
LOWER = ("core", "test", "viewer", "bt", "edit", "zenoh")
"""What `make lower-bounds` installs at its lower bounds."""


class Requirement(NamedTuple):
    """One line of pyproject.toml: where it stands, the package, its lower bound ("" for none)."""

    group: str
    package: str
    bound: str


IN_PROCESS, APART, BUILD = "imported", "a separate process", "to develop"
WHY = {
    "networkx": ("the public graph of a knowledge base, and layouts of drawings", IN_PROCESS),
    "numpy": ("layouts of networkx, and transforms", IN_PROCESS),
    "scipy": ("layouts of networkx, and the algebra of transforms", IN_PROCESS),
    "pydantic": ("plots, profiles and scenarios as validated values", IN_PROCESS),
    "pyperplan": ("the default planner", APART),
    "rich": ("trees, tables and progress on a terminal", IN_PROCESS),
    "ruamel.yaml": ("YAML 1.2 with places and comments", IN_PROCESS),
    "typer": ("the command line", IN_PROCESS),
    "typing-extensions": ("defaults of type variables, for Python before 3.13", IN_PROCESS),
    "unified-planning": (
        "other planning engines, and problems in its form (`to_unified`)",
        "imported by `planning.engines.unified` and in the engines' processes",
    ),
    "up-pyperplan": ("pyperplan as an engine of unified-planning", "found by unified-planning; not imported"),
    "up-fast-downward": ("the engine `fast-downward`", APART),
    "up-enhsp": ("the engine `enhsp`, which is a Java program", APART),
    "up-aries": ("the engine `aries`", APART),
    "kairos-planner": ("the engine `kairos`", APART),
    "py-trees": ("behaviour trees as skills", "imported by `dsc.components.behaviour_trees`"),
    "eclipse-zenoh": ("robots in several processes", "imported by `dsc.wire.zenoh_transport`"),
    "mujoco": ("robots that plots drive in cycles", "imported by `domains.robots_in_cycles.rover`"),
    "pillow": ("films of these robots", "imported by `domains.robots_in_cycles.film`"),
    "pygls": ("the language server `dsc lsp`", "imported by `dsc.editing.server`"),
    "starlette": ("the page's requests", "imported where a page is served"),
    "uvicorn": ("the page's server", "imported where a page is served"),
    "websockets": ("the page's socket", "imported where a page is served"),
    "httpx": ("requests in tests of the page", BUILD),
    "hypothesis": ("properties in tests", BUILD),
    "jsonschema": ("the published JSON Schema, tested", BUILD),
    "ipykernel": ("the kernel of a notebook around a robot, in tests", BUILD),
    "nbclient": ("execution of that notebook", BUILD),
    "nbformat": ("cells of that notebook", BUILD),
    "pytest": ("tests", BUILD),
    "pytest-asyncio": ("asynchronous tests around a robot", BUILD),
    "uvloop": ("another event loop around a robot, in tests", BUILD),
    "pytest-xdist": ("tests on all cores", BUILD),
    "mutmut": ("mutants in `make mutation`", BUILD),
    "mkdocs": ("the site of the pages", BUILD),
    "mkdocs-material": ("theme and offline search of the site", BUILD),
    "mkdocstrings-python": ("the reference, from docstrings", BUILD),
    "import-linter": ("the direction of imports, checked", BUILD),
    "mypy": ("types, checked", BUILD),
    "ruff": ("style, checked", BUILD),
    "types-networkx": ("types of networkx", BUILD),
    "pyoxigraph": ("compared with in benchmarks", BUILD),
    "python-statemachine": ("compared with in benchmarks", BUILD),
    "rdflib": ("compared with in benchmarks", BUILD),
    "sismic": ("compared with in benchmarks", BUILD),
    "transitions": ("compared with in benchmarks", BUILD),
    "xstate-statemachine": ("compared with in benchmarks", BUILD),
    "hatchling": ("builds the package", BUILD),
}
"""What each is for, and how it is met."""
LICENCES = {
    "up-fast-downward": "GPL-3.0 (the engine)", "up-enhsp": "Apache-2.0; the engine GPL-3.0", "up-aries": "MIT",
    "kairos-planner": "Apache-2.0", "eclipse-zenoh": "EPL-2.0 OR Apache-2.0",
    "pyoxigraph": "MIT OR Apache-2.0", "python-statemachine": "MIT", "rdflib": "BSD-3-Clause", "sismic": "LGPL-3.0",
    "scipy": "BSD-3-Clause", "transitions": "MIT", "xstate-statemachine": "MIT", "hatchling": "MIT",
    "mutmut": "BSD-3-Clause", "nbclient": "BSD-3-Clause", "mkdocs": "BSD-2-Clause", "mkdocs-material": "MIT", "mkdocstrings-python": "ISC",
}  # fmt: skip
"""Of what `make test` does not install, and of a package that says too little."""
SPELT = {"GPL3+": "GPL-3.0-or-later", "APACHE": "Apache-2.0", "BSD 2-Clause License": "BSD-2-Clause"}
"""Licences as packages say them, and as SPDX does."""
TITLES = {
    "core": "Core", "viewer": "Extra `viewer`", "bt": "Extra `bt`", "edit": "Extra `edit`", "physics": "Extra `physics`", "zenoh": "Extra `zenoh`", "fast": "Extra `fast`", "numeric": "Extra `numeric`",
    "durations": "Extra `durations`", "numbers": "Extra `numbers`", "test": "Extra `test`", "check": "Extra `check`", "docs": "Extra `docs`", "bench": "Extra `bench`",
    "mutation": "Extra `mutation`",
    "build": "To build the package",
}  # fmt: skip
HEAD = """# Dependencies

`python tests/dependencies.py --write` writes this page from pyproject.toml and the metadata of the installed packages.
The project itself is Apache-2.0.

`make lower-bounds` installs the core and the packages of its tests exactly at the lower bounds, in a separate
environment, and runs tests of every room. Only the engine `kairos` and Zenoh have an upper bound.

Planning engines never run in the program's process: `planning/engines/process.py` starts `planning.engines.worker` for
each and exchanges lines of JSON with it. `pyperplan` is GPL-3.0-or-later, and only that worker imports it. A program
can replace it by passing another `Planner`. A test checks that the program does not import it.
"""


def requirements() -> Iterator[Requirement]:
    """All that pyproject.toml names, but for extras that are made of extras."""
    form = tomllib.loads((ROOT / "pyproject.toml").read_text())
    groups = {"core": form["project"]["dependencies"], **form["project"]["optional-dependencies"]}
    for group, texts in {**groups, "build": form["build-system"]["requires"]}.items():
        for text in texts:
            name, _, bound = text.partition(">=")
            if "[" not in name:
                yield Requirement(group, name.strip(), bound.strip())


def licence(package: str) -> str:
    """Of the installed package, or what is known of one that is not."""
    try:
        said = metadata(package)
    except PackageNotFoundError:
        return LICENCES[package]
    if package in LICENCES:
        return LICENCES[package]
    classified = [one.split(" :: ")[-1] for one in said.get_all("Classifier") or [] if one.startswith("License")]
    text = (said.get_all("License-Expression") or said.get_all("License") or [""])[0]
    text = text if text and len(text) < 60 else (classified or [text[:60]])[0]
    return SPELT.get(text, re.sub(r"^(MIT|BSD) License$", r"\1", text))


def page() -> str:
    """docs/dependencies.md."""
    lines = [HEAD]
    for group, title in TITLES.items():
        lines += [
            f"## {title}\n",
            "| package | from | licence | purpose | use |",
            "| --- | --- | --- | --- | --- |",
        ]
        for one in requirements():
            if one.group == group:
                why, how = WHY[one.package]
                lines.append(f"| {one.package} | {one.bound or 'any'} | {licence(one.package)} | {why} | {how} |")
        lines.append("")
    return "\n".join(lines)


if __name__ == "__main__":
    if "--write" in sys.argv:
        PAGE.write_text(page())
    if "--lower" in sys.argv:
        print(
            "\n".join(
                f"{one.package}=={one.bound.partition(',')[0]}"
                for one in requirements()
                if one.group in LOWER and one.bound
            )
        )
