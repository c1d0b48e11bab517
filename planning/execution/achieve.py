"""The plot `achieve`, which plans for any goal, executes the plan, and repairs or replaces it."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from dsc.model.plot import ActionPlot
from dsc.text.plot_files import parse_plot


@cache
def achieve_plot() -> ActionPlot:
    """Return the plot that plans for any goal; cached, because plots are immutable."""
    resource = files("planning") / "plots" / "achieve.yaml"
    return parse_plot(resource.read_text(encoding="utf-8"), str(resource))
