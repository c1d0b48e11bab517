"""Tasks of robots: a plot with arguments, or a goal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from knowledge_base.errors import InputError, UnknownNameError
from planning.robot.bundles import Bundle, gathered, plots_of


@dataclass(frozen=True, slots=True)
class Task:
    """The task of one run: a plot with arguments, or a goal. Without both, the bundle's own task.

    Attributes:
        plot: the plot to run; `None` for the bundle's plot, or for a goal.
        arguments: values of the plot's parameters.
        goal: the goal to plan for.
    """

    plot: str | None = None
    arguments: Mapping[str, Any] = field(default_factory=dict)
    goal: str | None = None


def own_task(bundle: Bundle) -> Task:
    """Return the task of a bundle; raise `InputError` if it has none."""
    if bundle.main is None and bundle.goal is None:
        message = f"the bundle '{bundle.name}' has neither `main` nor `goal`: name a plot (--plot) or a goal (--goal)"
        raise InputError(message, valid=[plot.name for plot in bundle.plots])
    return Task(plot=bundle.main) if bundle.main is not None else Task(goal=bundle.goal)


def plot_task(bundle: Bundle, plot: str, given: Mapping[str, str]) -> Task:
    """Return the task to run a plot, with arguments as text.

    Raises:
        UnknownNameError: the plot or a parameter does not exist.
        InputError: a text is not a value of its parameter's type.
    """
    plots = {one.name: one for one in plots_of(gathered([bundle]))}
    if plot not in plots:
        raise UnknownNameError(f"the robot '{bundle.name}' has no plot '{plot}'", found=plot, valid=plots)
    parameters = plots[plot].parameters
    for name in given:
        if name not in parameters:
            having = [f"--plot {one.name}" for one in plots.values() if name in one.parameters and one.name != plot]
            hint = f"; the parameter belongs to {', '.join(having)}" if having else ""
            message = f"the plot '{plot}' has no parameter '{name}'{hint}"
            raise UnknownNameError(message, found=name, valid=parameters)
    values = {name: parameters[name].range.read(f"{plot}.{name}", text) for name, text in given.items()}
    return Task(plot, values)
