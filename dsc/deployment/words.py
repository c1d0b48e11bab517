"""Words of findings and reports: times, modes, and lists of names."""

from __future__ import annotations

from collections.abc import Iterable

from dsc.deployment.model import EVERY_MODE, Deployment
from dsc.deployment.tasks import NANOSECONDS
from dsc.errors import Finding
from dsc.model.reading import FormPath
from knowledge_base.errors import InputError

_UNITS = ((1.0, 1.0, "s"), (1e-3, 1e3, "ms"), (0.0, 1e6, "us"))
"""Minimum of the seconds, factor, and name of each unit."""


def finding_at(deployment: Deployment, path: FormPath, message: str, code: str) -> Finding:
    """Return a mistake at a part of a deployment model."""
    return Finding(InputError(message, place=deployment.place(path)), code)


def shown_time(nanoseconds: int) -> str:
    """Return a time with a suitable unit, e.g. `2.5 ms`."""
    seconds = nanoseconds / NANOSECONDS
    factor, unit = next((factor, unit) for least, factor, unit in _UNITS if abs(seconds) >= least)
    return f"{seconds * factor:.6g} {unit}" if seconds else "0 s"


def in_mode(mode: str) -> str:
    """Return the mode of the robot as the end of a clause; nothing without modes."""
    return "" if mode == EVERY_MODE else f" in mode '{mode}'"


def quoted_list(names: Iterable[str]) -> str:
    """Return names in quotes, e.g. `'front' and 'rear'`."""
    return " and ".join(f"'{name}'" for name in names)
