"""Comparison of plots and domain with those that a kept run began with."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from dsc.dynamic.library import Library
from dsc.errors import ChangedError
from dsc.model.plot import ActionPlot
from dsc.runs.archive import RunArchive, RunRow
from knowledge_base.errors import Place


def require_unchanged(runs: RunArchive, run: RunRow, library: Library, domain: Mapping[str, str]) -> None:
    """Raise `ChangedError` if a plot, or another thing that plots rely on, has changed since the run began."""
    found = [*_changed_plots(runs, run, library), *_changed_statements(run.domain, domain)]
    if found:
        raise ChangedError(found, place=Place(str(runs.path)))


def plots_of(runs: RunArchive, run: RunRow) -> Library:
    """The plots with which the run was begun."""
    return Library(ActionPlot.model_validate(runs.form(digest)) for digest in run.plots.values())


def _changed_plots(runs: RunArchive, run: RunRow, library: Library) -> Iterator[str]:
    from dsc.text.plot_difference import differences  # noqa: PLC0415  loads the drawing, too; only a changed plot needs it

    before = plots_of(runs, run)
    for plot in before:
        if plot.name not in library:
            yield f"the plot '{plot.name}' is missing"
        elif plot != library.plot(plot.name):
            what = ", ".join(map(str, differences(plot, library.plot(plot.name))))
            yield f"the plot '{plot.name}' has changed: {what or 'its description'}"
    for plot in library:
        if plot.name not in before:
            yield f"the plot '{plot.name}' is new"


def _changed_statements(before: Mapping[str, str], now: Mapping[str, str]) -> Iterator[str]:
    for name, text in before.items():
        if name not in now:
            yield f"the {name} is missing"
        elif now[name] != text:
            yield f"the {name} was '{text}', now it is '{now[name]}'"
    yield from (f"the {name} is new" for name in now if name not in before)
