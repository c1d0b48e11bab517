"""Review of names: those that differ only in case or Unicode form look alike, and are different names."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Iterator

from dsc.errors import Finding
from dsc.model.plot import Path
from dsc.validation.subject import Subject


def review_names(subject: Subject) -> Iterator[Finding]:
    """Yield warnings about states, data and events of a plot, and about the plot and others of its library."""
    plot = subject.plot
    yield from _alike(subject, "states", ((name, path) for name, _, path in subject.states))
    data: tuple[tuple[Path, Iterable[str]], ...] = (
        (("parameters",), plot.parameters),
        (("variables",), plot.variables),
        (("outputs",), plot.outputs),
    )
    if plot.robot is not None:
        data += tuple((("robot", group), getattr(plot.robot, group)) for group in ("sensors", "motors", "constants"))
    yield from _alike(subject, "variables", ((name, (*group, name)) for group, names in data for name in names))
    events = (("emits", plot.emits), ("receives", plot.receives))
    yield from _alike(subject, "events", ((name, (group, name)) for group, names in events for name in names))
    others = [one.name for one in subject.library if one.name != plot.name]
    yield from _alike(subject, "plots", [*((name, None) for name in others), (plot.name, ("plot",))])


def _alike(subject: Subject, kind: str, names: Iterable[tuple[str, Path | None]]) -> Iterator[Finding]:
    """Yield a warning for each name that looks like an earlier one; a name without path has no warning."""
    seen: dict[str, str] = {}
    for name, path in names:
        other = seen.setdefault(unicodedata.normalize("NFKC", name).casefold(), name)
        if other != name and path is not None:
            is_case = name.casefold() == other.casefold()
            form = "case" if is_case else "Unicode form"
            message = f"the {kind} '{other}' and '{name}' differ only in their {form}"
            yield subject.finding(path, "distinct-names", message, "rename one of them", level="warning")
