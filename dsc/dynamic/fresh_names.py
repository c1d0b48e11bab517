"""Unused names for states, events and variables that rules and handlers add to a plot."""

from __future__ import annotations

import itertools
from collections import ChainMap
from collections.abc import Container
from typing import Any

from dsc.model.plot import ActionPlot, PlotVariable


class FreshNames:
    """Gives unused names in one plot.

    Attributes:
        variables: the added ones.
    """

    def __init__(self, plot: ActionPlot) -> None:
        self._names = {name for name, _, _ in plot.walk()}
        self._events = {*plot.receives, *plot.emits}
        self._declared = plot.parameters, plot.variables, plot.outputs
        self.variables: dict[str, PlotVariable] = {}

    def state(self, wanted: str) -> str:
        """Return a name for a state: the wanted one, or with a number if it is taken."""
        name = _unused(wanted, self._names)
        self._names.add(name)
        return name

    def event(self, wanted: str) -> str:
        """Return a name for an internal event: the wanted one, or with a number if it is taken."""
        name = _unused(wanted, self._events)
        self._events.add(name)
        return name

    def variable(self, wanted: str, type_: str, initial: Any = None) -> str:
        """Add a variable under the wanted name, or with a number if it is taken; return its name."""
        taken = ChainMap[str, object](self.variables, *self._declared)  # type: ignore[arg-type]
        name = _unused(wanted.lower().replace("-", "_"), taken)
        declared = {"type": type_} if initial is None else {"type": type_, "initial": initial}
        self.variables[name] = PlotVariable.model_validate(declared)
        return name


def _unused(name: str, taken: Container[str]) -> str:
    """Return the name, followed by a number if it is taken."""
    numbered = (f"{name}_{number}" for number in itertools.count(2))
    return name if name not in taken else next(other for other in numbered if other not in taken)
