"""The order of findings about a project, with paths as the user sees them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from dsc.errors import Finding
from knowledge_base.errors import Place


def in_order(findings: Sequence[Finding]) -> list[Finding]:
    """Return the findings without repetition, in the order of their places."""
    for one in findings:
        one.error.place = _seen_from_here(one.error.place)
    unique = {(str(one.place), one.error.message): one for one in findings}
    places = {key: one.place or Place() for key, one in unique.items()}
    return [unique[key] for key in sorted(unique, key=lambda key: (
        places[key].source or "~", places[key].line or 0, places[key].column or 0, key[1],
    ))]  # fmt: skip


def _seen_from_here(place: Place | None) -> Place | None:
    """Return a place with the path of its file relative to the present folder, if the file is inside it."""
    here = Path.cwd()
    if place is None or place.source is None or not Path(place.source).is_relative_to(here):
        return place
    return replace(place, source=str(Path(place.source).relative_to(here)))
