"""Installed engines and their features, for `dsc doctor`; imports no engine."""

from __future__ import annotations

import platform
import re
import shutil
import subprocess
from importlib.metadata import PackageNotFoundError, requires, version
from typing import TYPE_CHECKING, Any

from planning.engines.registry import DISTRIBUTION, ENGINES

if TYPE_CHECKING:
    from planning.engines.registry import Engine

_JAVA_SECONDS = 10.0


def findings() -> dict[str, Any]:
    """Return plain data: `python`, `java` (its version or null), `packages` (name -> version or null), `engines`."""
    return {
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "java": _java(),
        "packages": {name: _version(name) for name in (DISTRIBUTION, *_dependencies())},
        "engines": [_engine(one) for one in ENGINES],
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


def _dependencies() -> list[str]:
    """Return the distributions that every installation of this project requires."""
    try:
        needed = requires(DISTRIBUTION) or []
    except PackageNotFoundError:  # run from a checkout that is not installed
        return []
    return [re.split(r"[^\w.-]", one, maxsplit=1)[0] for one in needed if "extra ==" not in one]


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


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
