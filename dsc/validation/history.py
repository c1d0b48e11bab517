"""Histories: what they begin with is there, and what is forgotten was remembered (profile `scxml`)."""

from __future__ import annotations

from collections.abc import Iterator

from dsc.errors import Finding
from dsc.model.plot import ActionPlot, Path
from dsc.model.states import CompositeState, HistoryState, OrthogonalState
from dsc.model.transitions import Source, Transition
from knowledge_base.errors import SchemaError, UnknownNameError


def check_history(plot: ActionPlot) -> Iterator[Finding]:
    """Findings about histories and about transitions that clear them."""
    for _, state, path in plot.walk():
        if isinstance(state, HistoryState):
            yield from _default(plot, state, path)
        elif isinstance(state, Source) and plot.profile == "scxml":
            for inside, _, transition in state.placed_transitions():
                yield from _cleared(plot, transition, (*path, *inside, "clear"))


def _default(plot: ActionPlot, state: HistoryState, path: Path) -> Iterator[Finding]:
    """What a history leads to is inside the state that the history belongs to (SCXML 3.10)."""
    valid = plot.within(path[:-2])
    if state.target not in valid:
        error = UnknownNameError(
            f"there is no state '{state.target}' beside the history", place=plot.place((*path, "to")),
            found=state.target, valid=valid,
        )  # fmt: skip
        yield Finding(error, "target")


def _cleared(plot: ActionPlot, transition: Transition, path: Path) -> Iterator[Finding]:
    """Harel's clear-history needs a history: directly inside the state, or with `*` at any level below."""
    holders = {name: at for name, state, at in plot.walk() if isinstance(state, CompositeState | OrthogonalState)}
    for number, written in enumerate(transition.clear):
        name, place = written.removesuffix("*"), plot.place((*path, number))
        if name not in holders:
            error = UnknownNameError(
                f"there is no composite or orthogonal state '{name}' with a history to clear",
                place=place, found=name, valid=holders,
            )  # fmt: skip
            yield Finding(error, "clear")
        elif not _remembers(plot, holders[name], below=written.endswith("*")):
            nothing = SchemaError(f"the state '{name}' has no history to clear", place=place, found=name)
            yield Finding(nothing, "clear", f"write \"{name}*\" to clear those of the levels below it")


def _remembers(plot: ActionPlot, holder: Path, *, below: bool) -> bool:
    """Whether a history is inside; those in an orthogonal state's regions are directly inside it."""
    histories = [path for _, state, path in plot.walk() if isinstance(state, HistoryState)]
    inside = [path[len(holder) :] for path in histories if path[: len(holder)] == holder]
    return any(below or len(path) == 2 or (path[0] == "regions" and len(path) == 4) for path in inside)
