"""Plots and other large data of a kept run by their hashes; a store keeps each of them one time."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from typing import Any

from dsc.model.plot import ActionPlot
from dsc.runs.tables import Form

_BY_HASH = "$form"
_MOST_REMEMBERED = 256


class Shortener:
    """Function that replaces plots by hashes; `put` receives the hash and text of each new plot."""

    def __init__(self, put: Callable[[str, str], None]) -> None:
        self._put = put
        self._known: dict[int, tuple[Any, str]] = {}  # by identity; the kept value prevents a reuse of its id

    def __call__(self, values: Mapping[str, Any]) -> Form:
        """Return the values, with plots replaced by hashes."""
        return {name: self.short(value) if isinstance(value, dict) else value for name, value in values.items()}

    def short(self, value: Any) -> Any:
        """Return the hash form of a plot, or any other value unchanged."""
        if not isinstance(value, Mapping) or not ({"plot", "states"} <= value.keys() or _BY_HASH in value):
            return value
        return self.reference(value)

    def reference(self, value: Mapping[str, Any]) -> Form:
        """Store plain data, and return their hash form."""
        return {_BY_HASH: self.hash(value)}

    def hash(self, value: Mapping[str, Any]) -> str:
        """Store a plot, or other plain data, and return its hash."""
        known = self._known.get(id(value))
        if known is None:
            text = json.dumps(value)  # the order of states is significant
            known = value, hashlib.sha256(text.encode()).hexdigest()
            self._put(known[1], text)
            if len(self._known) >= _MOST_REMEMBERED:
                self._known.clear()
            self._known[id(value)] = known
        return known[1]


def full(values: Mapping[str, Any], form: Callable[[str], Any]) -> Form:
    """Return the values with hashes replaced by plots; `form` returns the plot of a hash."""
    return {name: full_value(value, form) for name, value in values.items()}


def full_value(value: Any, form: Callable[[str], Any]) -> Any:
    """Return the plot if the value is a hash form; else the value."""
    return form(value[_BY_HASH]) if isinstance(value, dict) and _BY_HASH in value else value


def plot_hashes(plots: Mapping[str, ActionPlot | None], short: Shortener) -> Form:
    """Return changed plots by name as hashes; a removed plot is `None`."""
    return {name: None if plot is None else short.hash(plot.to_form()) for name, plot in plots.items()}


def plots_of_hashes(hashes: Mapping[str, str | None], find: Callable[[str], Any]) -> dict[str, ActionPlot | None]:
    """Return the changed plots of `plot_hashes`; `find` returns the plot of a hash."""
    return {name: None if one is None else ActionPlot.model_validate(find(one)) for name, one in hashes.items()}
