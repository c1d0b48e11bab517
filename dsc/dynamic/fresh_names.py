"""Names of the elements that the expansion of rules and handlers adds to a plot, each with words for people."""

from __future__ import annotations

import itertools
from collections import ChainMap
from collections.abc import Container
from typing import Any

from dsc.model.declarations import PlotVariable
from dsc.model.plot import ActionPlot, AddedNames


class FreshNames:
    """Generator of unused names in one plot.

    Attributes:
        variables: the added variables by name.
        words: for each added name, the words that people read instead.
    """

    def __init__(self, plot: ActionPlot) -> None:
        self._names = {name for name, _, _ in plot.walk()}
        self._events = {*plot.receives, *plot.emits}
        self._declared = plot.parameters, plot.all_variables, plot.outputs
        self.variables: dict[str, PlotVariable] = {}
        self.words = AddedNames({}, {}, {})

    def state(self, wanted: str, words: str) -> str:
        """Return an unused name for a state: the wanted name, or the wanted name with a number."""
        name = _find_unused(wanted, self._names)
        self._names.add(name)
        self.words.states[name] = words
        return name

    def event(self, wanted: str, words: str) -> str:
        """Return an unused name for an internal event: the wanted name, or the wanted name with a number."""
        name = _find_unused(wanted, self._events)
        self._events.add(name)
        self.words.events[name] = words
        return name

    def variable(self, wanted: str, words: str, type_: str, initial: Any = None) -> str:
        """Add a variable and return its unused name: the wanted name, or the wanted name with a number."""
        taken = ChainMap[str, object](self.variables, *self._declared)  # type: ignore[arg-type]
        name = _find_unused(wanted.lower().replace("-", "_"), taken)
        declared = {"type": type_} if initial is None else {"type": type_, "initial": initial}
        self.variables[name] = PlotVariable.model_validate(declared)
        self.words.variables[name] = words
        return name


def _find_unused(name: str, taken: Container[str]) -> str:
    """Return the name if it is not in `taken`; else the name with the smallest unused number from 2."""
    numbered = (f"{name}_{number}" for number in itertools.count(2))
    return name if name not in taken else next(other for other in numbered if other not in taken)
