"""Command `dsc controller`: compile plots to controllers that need nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

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
    from dsc.controllers import build_controller
    from knowledge_base.output_files import Output

    output = Output(out, "--out", chart)
    output.write(build_controller(load_chart(chart), target, queue))
