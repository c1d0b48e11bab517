"""Check of the states that a plot names, for forms that cannot express a missing state."""

from __future__ import annotations

from collections.abc import Iterator

from dsc.model.plot import ActionPlot, Path, initial_of
from dsc.model.states import CompositeState, HistoryState, OrthogonalState
from dsc.model.transitions import TransitionSource
from knowledge_base.errors import UnknownNameError


def require_targets(plot: ActionPlot) -> None:
    """Raise `UnknownNameError` if an initial state or target is not a state of the plot."""
    names = [name for name, _, _ in plot.walk()]
    for target, path in _named(plot):
        if target not in names:
            place = plot.place(path)
            raise UnknownNameError(f"there is no state '{target}'", place=place, found=target, valid=names)


def _named(plot: ActionPlot) -> Iterator[tuple[str, Path]]:
    """Yield the names of states that occur in the plot, each with its path."""
    yield initial_of(plot), ("initial",)
    for _, state, path in plot.walk():
        if isinstance(state, CompositeState):
            yield initial_of(state), (*path, "initial")
        elif isinstance(state, OrthogonalState):
            yield from ((initial_of(one), (*path, "regions", key, "initial")) for key, one in state.regions.items())
        elif isinstance(state, HistoryState):
            yield state.target, (*path, "to")
        if isinstance(state, TransitionSource):
            for inside, _, transition in state.placed_transitions():
                yield from ((target, (*path, *inside, "to")) for target in transition.targets)
