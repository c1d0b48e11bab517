"""Names and shape: targets exist and cross no border, used plots exist, nothing is a dead end."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from dsc.dynamic.library import Library
from dsc.engine.compiler import compile_plot
from dsc.errors import Finding
from dsc.model.plot import ActionPlot, Path
from dsc.model.states import (
    AnyState,
    CompositeState,
    DynamicState,
    OrthogonalState,
    Region,
    State,
    SubmachineState,
)
from dsc.validation.connectors import check_connectors
from dsc.validation.history import check_history
from dsc.validation.nesting import Nesting
from dsc.validation.profile import check_profile
from dsc.validation.rules import check_rules, unknown_plot
from dsc.validation.timing import check_timing
from knowledge_base.errors import SchemaError, UnknownNameError


def check_structure(plot: ActionPlot, library: Library, nesting: Nesting) -> Iterator[Finding]:
    """Findings about the plot's own states, before anything is said about what they do."""
    sound = True
    for finding in _shape(plot, library, nesting):
        sound = False
        yield finding
    if sound and plot.profile == "scxml":
        yield from _tables(plot)


def _shape(plot: ActionPlot, library: Library, nesting: Nesting) -> Iterator[Finding]:
    yield from check_profile(plot, nesting)
    yield from check_connectors(plot, nesting)
    yield from check_history(plot, nesting)
    yield from check_timing(plot, nesting)
    yield from _scope(plot, plot, (), nesting)
    for name, state, path in nesting.states:
        if isinstance(state, CompositeState):
            yield from _scope(plot, state, path, nesting)
        if isinstance(state, OrthogonalState):
            for key, region in state.regions.items():
                yield from _scope(plot, region, (*path, "regions", key), nesting)
        yield from _uses(plot, state, path, library)
        if plot.profile == "dsc":
            yield from _dead_end(plot, name, state, path, nesting)
    yield from check_rules(plot, library, nesting)


def _tables(plot: ActionPlot) -> Iterator[Finding]:
    """What only shows when all targets are known."""
    try:
        compile_plot(plot)
    except SchemaError as error:
        error.place = next((plot.place(path) for name, _, path in plot.walk() if name == error.found), None)
        yield Finding(error, "target")


def _scope(
    plot: ActionPlot, scope: ActionPlot | CompositeState | Region, path: Path, nesting: Nesting
) -> Iterator[Finding]:
    first, anywhere_inside = scope.initial, plot.profile == "scxml"
    if first is not None and not (nesting.inside(first, path) if anywhere_inside else first in scope.states):
        error = UnknownNameError(
            f"there is no state '{first}' to begin with", place=plot.place((*path, "initial")),
            found=first, valid=nesting.within(path) if anywhere_inside else scope.states,
        )  # fmt: skip
        yield Finding(error, "initial")
    for name in scope.states:
        yield from _targets(plot, (*path, "states", name), scope.states, nesting)


def _targets(
    plot: ActionPlot, path: Path, siblings: Mapping[str, AnyState], nesting: Nesting
) -> Iterator[Finding]:
    for inside, _, transition in nesting.leaving(path):
        for target in transition.targets:
            if target not in siblings:
                yield from _elsewhere(plot, target, siblings, nesting.names, (*path, *inside, "to"))


def _elsewhere(
    plot: ActionPlot, target: str, siblings: Mapping[str, AnyState], everywhere: Collection[str], path: Path
) -> Iterator[Finding]:
    """Findings about a target that is not beside its source."""
    if target not in everywhere:
        missing = UnknownNameError(
            f"there is no state '{target}'", place=plot.place(path), found=target,
            valid=siblings if plot.profile == "dsc" else everywhere,
        )  # fmt: skip
        yield Finding(missing, "target")
    elif plot.profile == "dsc":
        error = SchemaError(f"the transition to '{target}' crosses a border", place=plot.place(path), found=target)
        yield Finding(error, "no border crossing", "transitions stay in the state, region or plot around")


def _uses(plot: ActionPlot, state: AnyState, path: Path, library: Library) -> Iterator[Finding]:
    if isinstance(state, SubmachineState) and state.use.startswith("?"):
        if state.use[1:] not in plot.variables and state.use[1:] not in plot.parameters:
            valid = {f"?{name}" for name in (*plot.variables, *plot.parameters)}
            error = UnknownNameError(
                f"there is no variable '{state.use}'", place=plot.place((*path, "use")), found=state.use, valid=valid
            )
            yield Finding(error, "known plot")
    elif isinstance(state, SubmachineState) and state.use not in library:
        yield unknown_plot(plot, (*path, "use"), state.use, library)
    elif isinstance(state, DynamicState):
        for number, name in enumerate(state.dynamic):
            if name not in library:
                yield unknown_plot(plot, (*path, "dynamic", number), name, library)


def _dead_end(plot: ActionPlot, name: str, state: AnyState, path: Path, nesting: Nesting) -> Iterator[Finding]:
    if isinstance(state, State) and not any(map(nesting.leaving, nesting.way(path))):
        error = SchemaError(f"no transition leaves the state '{name}'", place=plot.place(path))
        yield Finding(error, "no dead end", "wire what it ends with, or make it `final: true`")
