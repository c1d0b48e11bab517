"""Parts of a plot's data as it is written: parts by path, and the plots that a part uses."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any


def part_at(data: Any, path: Iterable[str | int]) -> Any:
    """Return the part of data at a path; `None` if there is none."""
    for key in path:
        try:
            data = data[key]
        except (KeyError, IndexError, TypeError):
            return None
    return data


def used_plots(state: Any) -> list[str]:
    """Return the names of the plots that a state, or a reaction of a rule, uses."""
    if not isinstance(state, dict):
        return []
    use, dynamic = state.get("use"), state.get("dynamic")
    names = [use] if isinstance(use, str) else []
    return names + [one for one in (dynamic if isinstance(dynamic, list) else []) if isinstance(one, str)]


def plots_in(data: Any) -> list[str]:
    """Return the names of the plots that a part, and all parts inside, use."""
    inside = data.values() if isinstance(data, dict) else data if isinstance(data, list) else ()
    return [*used_plots(data), *(name for one in inside for name in plots_in(one))]
