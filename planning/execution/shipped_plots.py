"""The shipped plots: `achieve`, which reaches a goal, and `serve_goals`, which serves a queue of goals."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from dsc.model.plot import ActionPlot
from dsc.text.plot_files import parse_plot

_NAMES = ("achieve", "serve_goals")


@cache
def shipped_plots() -> tuple[ActionPlot, ...]:
    """Return the plots that each robot has; cached, because plots are immutable."""
    folder = files("planning") / "plots"
    found = [folder / f"{name}.yaml" for name in _NAMES]
    return tuple(parse_plot(one.read_text(encoding="utf-8"), str(one)) for one in found)
