"""The target languages of controllers."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from dsc.controllers.building import compile_controller
from dsc.controllers.c_text import c_text
from dsc.controllers.model import Controller
from dsc.controllers.python_text import python_text
from dsc.dynamic.library import Library
from dsc.errors import PlotError
from dsc.model.plot import ActionPlot
from dsc.validation import raise_findings, validate_plot
from knowledge_base.errors import InputError, UnknownNameError

TARGETS: Mapping[str, Callable[[Controller, int], str]] = {"python": python_text, "c99": c_text}
"""The writers of controllers by target language; each gets the model and the capacity of the queue."""


def build_controller(plot: ActionPlot, target: str, queue: int = 16) -> str:
    """Return the text of a plot's controller.

    Args:
        plot: the plot.
        target: one of `TARGETS`.
        queue: the capacity of the queue of posted events.

    Raises:
        UnknownNameError: there is no such target language.
        PlotError: the plot has mistakes, or forms that a controller cannot have; the error lists all of them.
    """
    if target not in TARGETS:
        raise UnknownNameError(f"there is no target language '{target}'", found=target, valid=TARGETS)
    return TARGETS[target](_compile(plot), queue)


def _compile(plot: ActionPlot) -> Controller:
    """Return the model of a plot without mistakes; a form that a controller cannot have precedes other mistakes."""
    try:
        controller = compile_controller(plot)
    except PlotError:
        raise
    except InputError:
        raise_findings(validate_plot(plot, Library([plot])))
        raise
    raise_findings(validate_plot(plot, Library([plot])))
    return controller
