"""Outcomes of states, derived from the plots they use: outcome events, and the outputs at completion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Protocol

from dsc.events import GAVE_UP, NO_CANDIDATE, NO_PLAN, SKILL_ERROR, TIMED_OUT
from dsc.model.plot import ActionPlot
from dsc.model.states import AnyState, DynamicState, SubmachineState

Outcomes = Mapping[str, Mapping[str, str] | None]
"""Event name -> its attributes with their types."""

_FAILED: Outcomes = {
    SKILL_ERROR: {"skill": "text", "reason": "text"},
    TIMED_OUT: {"skill": "text", "reason": "text", "seconds": "number"},
}


class Plots(Protocol):
    """Provider of plots by name."""

    def __iter__(self) -> Iterator[ActionPlot]:
        """Yield all plots."""
        ...

    def plot(self, name: str) -> ActionPlot:
        """Return the plot of that name; raise `UnknownNameError`."""
        ...


def outputs_of(state: AnyState, plots: Plots) -> Mapping[str, str] | None:
    """Return the outputs of a state at completion: name -> type (S2.1); `None` if they depend on a variable.

    A dynamic state has the outputs that all its candidates share, with the same type. A plan for a goal has none.

    Raises:
        UnknownNameError: the state names a missing plot.
    """
    if isinstance(state, SubmachineState):
        return None if state.use.startswith("?") else _outputs(plots.plot(state.use))
    if not isinstance(state, DynamicState) or state.goal is not None:
        return {}
    first, *others = [set(_outputs(plots.plot(name)).items()) for name in state.dynamic] or [set()]
    return dict(sorted(first.intersection(*others)))


def _outputs(plot: ActionPlot) -> dict[str, str]:
    return {name: output.type for name, output in plot.outputs.items()}


def outcomes_of(state: AnyState, plots: Plots) -> Outcomes:
    """Return the outcome events of a submachine or dynamic state; nothing for other kinds.

    The outcomes of a plot held in a variable are unknown beforehand; the result is empty.

    Raises:
        UnknownNameError: the state names a missing plot.
    """
    if isinstance(state, SubmachineState):
        return {} if state.use.startswith("?") else plots.plot(state.use).emits
    if not isinstance(state, DynamicState):
        return {}
    found: dict[str, Mapping[str, str] | None] = {}
    for candidate in state.dynamic:
        found.update(plots.plot(candidate).emits)
    if state.goal is None:
        return {**found, NO_CANDIDATE: {}}
    return {**found, NO_PLAN: {"reason": "text"}, GAVE_UP: {"reason": "text"}}


def answerable(state: AnyState, plots: Plots) -> Outcomes:
    """Return the events that a rule can answer at a state: outcomes, and skill failures that its plot does not take.

    Raises:
        UnknownNameError: the state names a missing plot.
    """
    outcomes = outcomes_of(state, plots)
    return {**outcomes, **_FAILED} if isinstance(state, SubmachineState | DynamicState) else outcomes
