"""How a state can end, found from the plots it uses: its outcome events, and what its completion hands on."""

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
    """Where plots are found by name."""

    def __iter__(self) -> Iterator[ActionPlot]:
        """All of them."""
        ...

    def plot(self, name: str) -> ActionPlot:
        """Raises `UnknownNameError`."""
        ...


def outputs_of(state: AnyState, plots: Plots) -> Mapping[str, str] | None:
    """What the completion of a state hands on: name -> type (S2.1); `None` if nobody can know it beforehand.

    A dynamic state has what all its candidates have, with the same type; a plan for a goal has nothing.

    Raises:
        UnknownNameError: the state names a plot that is not there.
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
    """The outcome events of a submachine or dynamic state; nothing for other kinds.

    A state that uses a plot held in a variable has outcomes that nobody can know beforehand; none are given.

    Raises:
        UnknownNameError: the state names a plot that is not there.
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
    """What a rule can answer at a state: its outcomes, and failures of skills that the plot inside does not take.

    Raises:
        UnknownNameError: the state names a plot that is not there.
    """
    outcomes = outcomes_of(state, plots)
    return {**outcomes, **_FAILED} if isinstance(state, SubmachineState | DynamicState) else outcomes
