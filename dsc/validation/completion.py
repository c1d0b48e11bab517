"""Completion: who can be done handles it, and who would be done too early does not (S0.11)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache

from dsc.dynamic.library import Library
from dsc.errors import Finding
from dsc.events import DONE
from dsc.model.actions import Trigger
from dsc.model.connectors import Connector
from dsc.model.plot import ActionPlot, initial_of
from dsc.model.states import (
    AnyState,
    CompositeState,
    DynamicState,
    FinalState,
    OrthogonalState,
    State,
    SubmachineState,
)
from dsc.model.transitions import Source
from dsc.validation.nesting import Nesting
from knowledge_base.errors import SchemaError


def check_completion(
    plot: ActionPlot, wired: Mapping[str, AnyState], library: Library, nesting: Nesting
) -> Iterator[Finding]:
    """Findings about `done`; `wired` has the states with the plot's rules carried out."""
    silent = cache(lambda used: _ends_silently(library.plot(used)))  # many states may use one plot
    for name, state, path in nesting.states:
        if type(state) is State and DONE in state.on and any(isinstance(a, Trigger) for a in state.entry):
            error = SchemaError(
                f"state '{name}' has no content, so it is done at once and would cancel its skill",
                place=plot.place((*path, "on", DONE)),
            )
            yield Finding(error, "done at once", "wire the outcome of the skill")
        after = wired[name]
        if isinstance(after, State) and DONE not in after.on and _completes(state, silent):
            error = SchemaError(f"state '{name}' does not handle its completion", place=plot.place((*path, "on")))
            yield Finding(error, "completion is wired", "add `done: STATE` under `on`")


def _completes(state: AnyState, silent: Callable[[str], bool]) -> bool:
    if isinstance(state, SubmachineState):
        return state.use.startswith("?") or silent(state.use)
    if isinstance(state, DynamicState):
        return state.goal is not None or any(map(silent, state.dynamic))
    if isinstance(state, CompositeState):
        return any(isinstance(inner, FinalState) for inner in state.states.values())
    return isinstance(state, OrthogonalState)


def _ends_silently(plot: ActionPlot) -> bool:
    """Whether the plot can reach a top-level final state without firing a declared outcome."""
    waiting = {initial_of(plot)} | {
        target for state in plot.states.values() if isinstance(state, State) for target in _silent_ways(plot, state)
    }
    seen: set[str] = set()
    while waiting:  # connectors are passed through; what the way to them has fired, they need not fire again
        name = waiting.pop()
        seen.add(name)
        reached = plot.states.get(name)
        if isinstance(reached, FinalState) and reached.emit is None:
            return True
        if isinstance(reached, Connector):
            waiting |= _silent_ways(plot, reached) - seen
    return False


def _silent_ways(plot: ActionPlot, source: Source) -> set[str]:
    """Where transitions lead that fire no declared outcome."""
    silent = (one for _, one in source.transitions() if not set(one.emitted) & set(plot.emits))
    return {transition.target for transition in silent if transition.target is not None}
