"""Names and shape: targets exist and cross no border, used plots exist, nothing is a dead end."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from dsc.dynamic.library import Library
from dsc.engine.compiler import compile_plot
from dsc.errors import Finding
from dsc.model.plot import ActionPlot, Path
from dsc.model.states import (
    AnyState,
    CompositeState,
    DynamicState,
    HistoryState,
    OrthogonalState,
    Region,
    State,
    SubmachineState,
)
from dsc.validation.profile import check_profile
from knowledge_base.errors import Place, SchemaError, UnknownNameError

Paths = Mapping[str, Path]
"""All states of a plot by name -> where they stand."""
RESPONSES = frozenset({"retry", "continue", "replan", "give_up"})
"""What a rule may do besides going to a named state."""


def check_structure(plot: ActionPlot, library: Library) -> Iterator[Finding]:
    """Findings about the plot's own states, before anything is said about what they do."""
    sound = True
    for finding in _shape(plot, library):
        sound = False
        yield finding
    if sound and plot.profile == "scxml":
        yield from _tables(plot)


def _shape(plot: ActionPlot, library: Library) -> Iterator[Finding]:
    yield from check_profile(plot)
    names = {name: path for name, _, path in plot.walk()}
    yield from _scope(plot, plot, (), names)
    for name, state, path in plot.walk():
        if isinstance(state, CompositeState):
            yield from _scope(plot, state, path, names)
        if isinstance(state, OrthogonalState):
            for key, region in state.regions.items():
                yield from _scope(plot, region, (*path, "regions", key), names)
        yield from _uses(plot, state, path, library)
        if plot.profile == "dsc":
            yield from _dead_end(plot, name, state, path)
        if isinstance(state, HistoryState):
            yield from _history(plot, state, path, names)
    yield from _rules(plot, set(names), library)


def _tables(plot: ActionPlot) -> Iterator[Finding]:
    """What only shows when all targets are known."""
    try:
        compile_plot(plot)
    except SchemaError as error:
        error.place = next((plot.place(path) for name, _, path in plot.walk() if name == error.found), None)
        yield Finding(error, "target")


def _scope(
    plot: ActionPlot, scope: ActionPlot | CompositeState | Region, path: Path, names: Paths
) -> Iterator[Finding]:
    first = scope.initial
    deeper = plot.profile == "scxml" and first is not None and _is_within(names.get(first, ()), path)
    if first is not None and first not in scope.states and not deeper:
        error = UnknownNameError(
            f"there is no state '{first}' to begin with", place=plot.place((*path, "initial")), found=first,
            valid=_within(plot, path) if plot.profile == "scxml" else scope.states,
        )  # fmt: skip
        yield Finding(error, "initial")
    for name, state in scope.states.items():
        if isinstance(state, State):
            yield from _targets(plot, state, (*path, "states", name), scope.states, names)


def _targets(
    plot: ActionPlot, state: State, path: Path, siblings: Mapping[str, AnyState], names: Paths
) -> Iterator[Finding]:
    for inside, _, transition in state.placed_transitions():
        place = plot.place((*path, *inside, "to"))
        for target in transition.targets:
            yield from _target(plot, target, siblings, names, place)


def _target(
    plot: ActionPlot, target: str, siblings: Mapping[str, AnyState], everywhere: Paths, place: Place | None
) -> Iterator[Finding]:
    if target not in siblings and not (plot.profile == "scxml" and target in everywhere):
        if target in everywhere:
            error = SchemaError(f"the transition to '{target}' crosses a border", place=place, found=target)
            yield Finding(error, "no border crossing", "transitions stay in the state, region or plot around")
        else:
            missing = UnknownNameError(
                f"there is no state '{target}'", place=place, found=target,
                valid=siblings if plot.profile == "dsc" else everywhere,
            )
            yield Finding(missing, "target")


def _within(plot: ActionPlot, path: Path) -> set[str]:
    return {name for name, _, other in plot.walk() if _is_within(other, path)}


def _is_within(path: Path, around: Path) -> bool:
    return len(path) > len(around) and path[: len(around)] == around


def _history(plot: ActionPlot, state: HistoryState, path: Path, names: Paths) -> Iterator[Finding]:
    """What a history leads to is inside the state that the history belongs to (SCXML 3.10)."""
    around = path[:-2]
    if not _is_within(names.get(state.target, ()), around):
        error = UnknownNameError(
            f"there is no state '{state.target}' beside the history", place=plot.place((*path, "to")),
            found=state.target, valid=_within(plot, around),
        )  # fmt: skip
        yield Finding(error, "target")


def _uses(plot: ActionPlot, state: AnyState, path: Path, library: Library) -> Iterator[Finding]:
    if isinstance(state, SubmachineState) and state.use.startswith("?"):
        if state.use[1:] not in plot.variables and state.use[1:] not in plot.parameters:
            valid = {f"?{name}" for name in (*plot.variables, *plot.parameters)}
            yield _unknown(plot, (*path, "use"), state.use, valid, "variable")
    elif isinstance(state, SubmachineState) and state.use not in library:
        yield _unknown(plot, (*path, "use"), state.use, {other.name for other in library})
    elif isinstance(state, DynamicState):
        for number, name in enumerate(state.dynamic):
            if name not in library:
                yield _unknown(plot, (*path, "dynamic", number), name, {other.name for other in library})


def _unknown(plot: ActionPlot, path: Path, name: str, valid: set[str], what: str = "plot") -> Finding:
    error = UnknownNameError(f"there is no {what} '{name}'", place=plot.place(path), found=name, valid=valid)
    return Finding(error, "known plot")


def around(plot: ActionPlot, path: Path) -> Iterator[State]:
    """The composite and orthogonal states around the one at `path`."""
    scope: Any = plot
    for kind, name in zip(path[:-2:2], path[1:-2:2], strict=True):
        scope = getattr(scope, str(kind))[name]
        if isinstance(scope, State):
            yield scope


def _dead_end(plot: ActionPlot, name: str, state: AnyState, path: Path) -> Iterator[Finding]:
    if not isinstance(state, State) or any(True for _ in state.transitions()):
        return
    if not any(any(True for _ in other.transitions()) for other in around(plot, path)):
        error = SchemaError(f"no transition leaves the state '{name}'", place=plot.place(path))
        yield Finding(error, "no dead end", "wire what it ends with, or make it `final: true`")


def _rules(plot: ActionPlot, names: set[str], library: Library) -> Iterator[Finding]:
    for number, rule in enumerate(plot.rules):
        path: Path = ("rules", number)
        if rule.do.use is not None and rule.do.use not in library:
            yield _unknown(plot, (*path, "do", "use"), rule.do.use, {other.name for other in library})
        if rule.do.then not in RESPONSES | names:
            error = UnknownNameError(
                f"a rule cannot '{rule.do.then}'", place=plot.place((*path, "do", "then")),
                found=rule.do.then, valid=RESPONSES | names,
            )  # fmt: skip
            yield Finding(error, "rule response")
        for name in rule.of:
            if name not in names:
                missing = UnknownNameError(
                    f"there is no state '{name}'", place=plot.place((*path, "of")), found=name, valid=names
                )
                yield Finding(missing, "rule")
