"""Command `dsc controller`: compile plots to controllers that need nothing else."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from knowledge_base.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    from dsc.controllers.model import Controller
    from dsc.model.plot import ActionPlot

app = typer.Typer(
    name="controller",
    rich_markup_mode=None,
    no_args_is_help=True,
    help="Compile plots to controllers that need nothing of this package.",
)
MOST_QUEUED = 10_000


@app.callback()
def controller() -> None:
    """Compile plots to controllers that need nothing of this package."""


@app.command()
def build(
    chart: Annotated[Path, typer.Argument(metavar="CHART", help="A plot (YAML) or a chart (.scxml).")],
    target: Annotated[str, typer.Option("--target", metavar="LANGUAGE", help="python or c99.")],
    out: Annotated[str, typer.Option("--out", metavar="FILE", help="Where it goes; - is standard output.")] = "-",
    queue: Annotated[
        int, typer.Option("--queue", min=1, max=MOST_QUEUED, help="Capacity of the queue of posted events.")
    ] = 16,
) -> None:
    """Write a plot as one Python module or one C99 file; report all forms that a controller cannot have."""
    from dsc.cli.plots import load_chart
    from dsc.controllers.c_text import c_text
    from dsc.controllers.python_text import python_text
    from knowledge_base.output_files import Output

    targets: dict[str, Callable[[Controller, int], str]] = {"python": python_text, "c99": c_text}
    if target not in targets:
        raise UnknownNameError(f"--target: there is no language '{target}'", found=target, valid=targets)
    output = Output(out, "--out", chart)
    output.write(targets[target](_compile(load_chart(chart)), queue))


def _compile(plot: ActionPlot) -> Controller:
    """Return the model of a plot without mistakes; a form that a controller cannot have precedes other mistakes."""
    from dsc.controllers.building import compile_controller
    from dsc.dynamic.library import Library
    from dsc.errors import PlotError
    from dsc.validation import raise_findings, validate_plot

    try:
        controller = compile_controller(plot)
    except PlotError:
        raise
    except InputError:
        raise_findings(validate_plot(plot, Library([plot])))
        raise
    raise_findings(validate_plot(plot, Library([plot])))
    return controller
