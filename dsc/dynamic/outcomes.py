"""Which outcome events a state can end with, found from the plots and skills it uses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from dsc.events import GAVE_UP, NO_CANDIDATE, NO_PLAN
from dsc.model.plot import ActionPlot
from dsc.model.states import AnyState, DynamicState, SubmachineState

Outcomes = Mapping[str, Mapping[str, str] | None]
"""Event name -> its attributes with their types."""


class Plots(Protocol):
    """Where plots are found by name."""

    def plot(self, name: str) -> ActionPlot:
        """Raises `UnknownNameError`."""
        ...


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
