"""Commands `dsc runs`: list, show, replay and check kept runs; they only read the store, also during a run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dsc.runs.archive import RunArchive, RunRow, StepRow

app = typer.Typer(
    name="runs", rich_markup_mode=None, no_args_is_help=True, help="Look at runs that were kept with --store."
)
DIVERGED = 1
"""Exit status of `replay` after a difference."""

Store = Annotated[Path, typer.Argument(metavar="FILE", help="The store.")]
Number = Annotated[int | None, typer.Option("--run", min=1, help="Which run.  [default: the last one]")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


@app.command("list")
def list_(file: Store, as_json: AsJson = False) -> None:
    """List the runs: plot, number of steps, time and end."""
    from dsc.runs.archive import archive

    with archive(file) as runs:
        found = [_summary(runs, run) for run in runs.runs()]
    if as_json:
        _print_json(found)
        return
    for one in found:
        typer.echo(f"{one['run']:4}  {one['plot']}  {one['steps']} steps, {one['seconds']:.1f} s, {one['state']}")


@app.command()
def show(file: Store, run: Number = None, as_json: AsJson = False) -> None:
    """Print the macrosteps of a run, one a line, and the running skills of an unfinished run."""
    from dsc.runs.archive import archive

    with archive(file) as runs:
        row = runs.run(run)
        steps = list(runs.steps(row.number))
        summary = _summary(runs, row) | {"header": row.header, "arguments": row.arguments}
        under_way = _open(runs, row)
    if as_json:
        _print_json(summary | {"under_way": under_way, "macrosteps": [_step_form(step) for step in steps]})
        return
    for step in steps:
        typer.echo(f"{step.time:8.1f} s {step.number:5}  {_taken(step)}: {', '.join(_innermost(step.configuration))}")
    typer.echo(f"{row.plot}: {summary['state']}")
    for one in under_way:
        typer.echo(f"  under way since {one['since']:.1f} s: {one['skill']} ({one['id']})")


@app.command()
def replay(file: Store, run: Number = None, as_json: AsJson = False) -> None:
    """Replay the messages of a run and compare the results. Exit status: 0 the same, 1 a difference."""
    from dsc.sequencer.replay import replay as again

    done = again(file, run)
    found = None if done.divergence is None else str(done.divergence)
    if as_json:
        _print_json({"run": done.run, "steps": done.steps, "divergence": found})
    elif found is None:
        typer.echo(f"run {done.run}: {done.steps} steps, all as they were")
    else:
        typer.echo(f"run {done.run}: {done.steps} steps as they were, then {found}")
    raise typer.Exit(DIVERGED if found else 0)


@app.command()
def check(file: Store) -> None:
    """Check that each row of a store, runs and knowledge, is as written; it reads all rows."""
    from dsc.runs.archive import archive
    from knowledge_base.journal.archive import Archive

    Archive(file.resolve(), None).require_all()
    with archive(file, again=True) as runs:
        for run in runs.require_all():
            last = runs.last(run.number)
            typer.echo(f"run {run.number}: {last.number} steps as they were written, {_state(run)}")


def _summary(runs: RunArchive, run: RunRow) -> dict[str, Any]:
    last = runs.last(run.number)
    return {"run": run.number, "plot": run.plot, "steps": last.number, "seconds": last.time, "state": _state(run)}


def _state(run: RunRow) -> str:
    if run.ended is None:
        return "unfinished"
    return f"ended early: {run.ended['problem']}" if run.ended["problem"] else "finished"


def _open(runs: RunArchive, run: RunRow) -> list[dict[str, Any]]:
    return [] if run.ended is not None else [
        {"id": start.action_id, "skill": f"{start.component}.{start.skill}", "since": since}
        for start, since in runs.under_way()
    ]  # fmt: skip


def _taken(step: StepRow) -> str:
    """The message of the macrostep, in the words of the trace."""
    events = [one.data for one in step.records if one.type == "event"]
    if events:
        return f"{events[-1]['name']} ({events[-1]['source']})"
    if step.message:
        said = {"timer": "a period", "set": "a parameter"}
        return next((words for key, words in said.items() if key in step.message), "a change of knowledge")
    return "start" if step.number == 1 else "everything is left"


def _innermost(configuration: Iterable[str]) -> Iterator[str]:
    """The active states without active states inside."""
    active = list(configuration)
    yield from (path for path in active if not any(other.startswith(path + "/") for other in active))


def _step_form(step: StepRow) -> dict[str, Any]:
    return {
        "step": step.number, "t": step.time, "version": step.version, "message": step.message,
        "configuration": step.configuration,
    }  # fmt: skip


def _print_json(data: Any) -> None:
    import json

    typer.echo(json.dumps(data))
