"""Commands `dsc runs`: inspect, learn from, or end kept runs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from knowledge_base.cli.console import Json, print_line
from knowledge_base.spelling import number_text

if TYPE_CHECKING:
    from dsc.runs.archive import RunArchive, RunRow, StepRow
    from knowledge_base.world.live_rows import Rows

app = typer.Typer(
    name="runs", rich_markup_mode=None, no_args_is_help=True, help="Look at runs that were kept with --store."
)
DIVERGED = 1
"""Exit status of `replay` after a difference."""

Store = Annotated[Path, typer.Argument(metavar="FILE", help="The store.")]
Number = Annotated[int | None, typer.Option("--run", min=1, help="Which run.  [default: the last one]")]


def kept_relations(store: Path) -> Mapping[str, Rows]:
    """Return the relations of the last run in a store, for `dsc kb`; a query of them reads the records of the run."""
    from dsc.model.relations import RELATIONS

    @cache
    def rows() -> Mapping[str, Rows]:
        from dsc.runs.archive import archive
        from dsc.viewer.recorded_run import TYPES, RecordedRun

        recorded = RecordedRun()
        with archive(store) as runs:
            for record in runs.records(runs.run().number):
                if record.type in TYPES:
                    recorded.take({"type": record.type, **record.data})
        return recorded.rows()

    return {name: partial(lambda name: rows()[name](), name) for name in RELATIONS}


@app.command("list")
def list_(file: Store, as_json: Json = False) -> None:
    """List the runs: plot, number of steps, time and end."""
    from dsc.runs.archive import archive

    with archive(file) as runs:
        found = [_summary(runs, run) for run in runs.runs()]
    if as_json:
        print_line(found)
        return
    for one in found:
        typer.echo(f"{one['run']:4}  {one['plot']}  {one['steps']} steps, {one['seconds']:.1f} s, {one['state']}")


@app.command()
def learn(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="The stores.")],
    out: Annotated[Path | None, typer.Option("--out", help="Write the experience to this YAML file.")] = None,
    steps: Annotated[bool, typer.Option("--steps", help="Learn the steps of plans, too, as their costs.")] = False,
    as_json: Json = False,
) -> None:
    """Learn from the runs how often candidates of dynamic states are done, and how long they take."""
    from dsc.runs.learning import learn as learned_from
    from dsc.text.experience import experience_to_yaml
    from knowledge_base.output_files import Output

    output = None if out is None else Output(out, "--out", *files)
    experience = learned_from(files, steps=steps)
    if output is not None:
        output.write(experience_to_yaml(experience))
    if as_json:
        print_line(experience.to_form()["tries"])
        return
    for (plot, candidate, situation), tries in sorted(experience.tries.items()):
        about = ", ".join(f"{text} is {str(truth).lower()}" for text, truth in situation)
        typer.echo(f"{plot}: {candidate}{f' ({about})' if about else ''}: {tries}")


@app.command()
def show(file: Store, run: Number = None, as_json: Json = False) -> None:
    """Print the macrosteps of a run, one per line, and the running skills of an unfinished run."""
    from dsc.runs.archive import archive

    with archive(file) as runs:
        row = runs.run(run)
        steps = list(runs.steps(row.number))
        summary = _summary(runs, row) | {"header": row.header, "arguments": row.arguments}
        running_actions = _open(runs, row)
    if as_json:
        print_line(summary | {"under_way": running_actions, "macrosteps": [_step_form(step) for step in steps]})
        return
    for step in steps:
        typer.echo(
            f"{step.time:8.1f} s {step.number:5}  {_describe(step)}: {', '.join(_innermost(step.configuration))}"
        )
    typer.echo(f"{row.plot}: {summary['state']}")
    for one in running_actions:
        typer.echo(f"  under way since {one['since']:.1f} s: {one['skill']} ({one['id']})")


_TRUTHS = {True: "true", False: "false", None: "unknown"}


@app.command()
def conditions(
    file: Annotated[Path, typer.Argument(metavar="TRACE.jsonl|STORE", help="A trace, or a store with runs.")],
    as_json: Json = False,
) -> None:
    """Print the conditions that the states of a run watch or have watched, with their truth and their parts."""
    from dsc.cli.view import complain
    from dsc.monitoring.watched import conditions_in
    from dsc.trace import Record
    from dsc.viewer.record_sources import records_of

    with records_of(file) as log:
        complain(file, log)
        found = conditions_in(Record.from_line(log.line(number)) for number in range(1, len(log) + 1))
    for one in found:
        if as_json:
            print_line(one.to_json())
            continue
        until = "" if one.ended is None else f" until {one.ended:.1f} s"
        last = "" if one.last is None else f", the last at {one.last:.1f} s"
        typer.echo(f"{_TRUTHS[one.truth]:8}{one.text}")
        for text, truth in one.parts.items() if len(one.parts) > 1 else ():
            typer.echo(f"  {_TRUTHS[truth]:8}{text}")
        typer.echo(f"        {one.skill} since {one.since:.1f} s{until}; {one.reports} reports{last}")
    if not found and not as_json:
        typer.echo("no state has watched a condition")


@app.command()
def replay(file: Store, run: Number = None, as_json: Json = False) -> None:
    """Replay the messages of a run and compare the results.

    Exit status: 0 without a difference, 1 with a difference.
    """
    from dsc.sequencer.replay import replay as again

    done = again(file, run)
    found = None if done.divergence is None else str(done.divergence)
    if as_json:
        print_line({"run": done.run, "steps": done.steps, "divergence": found})
    elif found is None:
        typer.echo(f"run {done.run}: {done.steps} steps, all as they were")
    else:
        typer.echo(f"run {done.run}: {done.steps} steps as they were, then {found}")
    raise typer.Exit(DIVERGED if found else 0)


@app.command()
def end(
    file: Store, reason: Annotated[str, typer.Option(help="The problem with which the run ends.")] = "discarded"
) -> None:
    """End the unfinished run of a store, which then cannot be resumed; its robot can start the next run."""
    from dsc.runs.store import RunStore
    from knowledge_base.store import KnowledgeBase

    with KnowledgeBase.open(None, file) as knowledge:
        RunStore(knowledge, file).discard(reason)
    typer.echo(f"the run has ended: {reason}")


@app.command()
def prune(
    file: Store,
    keep: Annotated[int, typer.Option(min=1, help="The number of runs to keep.")] = 100,
    as_json: Json = False,
) -> None:
    """Delete all but the latest runs of a store, and the knowledge before them; its file becomes smaller."""
    from dsc.runs.pruning import prune as pruned
    from knowledge_base.store import KnowledgeBase

    before = file.stat().st_size if file.exists() else 0
    with KnowledgeBase.open(None, file) as knowledge:
        deleted = pruned(knowledge, file, keep)
    size = file.stat().st_size
    if as_json:
        print_line({"deleted": deleted, "bytes_before": before, "bytes": size})
        return
    typer.echo(f"{deleted} runs deleted: {size / 1000:,.0f} kB, before {before / 1000:,.0f} kB")


@app.command()
def forget(file: Store) -> None:
    """Delete all runs of a store, also those that another version of dsc has written; the knowledge stays."""
    from dsc.runs.pruning import forget_runs

    typer.echo(f"{number_text(forget_runs(file), 'run')} deleted; the knowledge is unchanged")


@app.command()
def check(file: Store) -> None:
    """Check that no row of a store, of runs or of knowledge, has changed since it was written; all rows are read."""
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
    if run.ended["programming_error"]:
        return f"programming error: {run.ended['programming_error']}"
    return f"ended early: {run.ended['problem']}" if run.ended["problem"] else "finished"


def _open(runs: RunArchive, run: RunRow) -> list[dict[str, Any]]:
    return [] if run.ended is not None else [
        {"id": start.action_id, "skill": f"{start.component}.{start.skill}", "since": since}
        for start, since in runs.running_actions()
    ]  # fmt: skip


def _describe(step: StepRow) -> str:
    """Return the message of the macrostep, in the terms of the trace."""
    events = [one.data for one in step.records if one.type == "event"]
    if events:
        return f"{events[-1]['name']} ({events[-1]['source']})"
    if step.message:
        said = {"timer": "a period", "set": "a parameter"}
        return next((words for key, words in said.items() if key in step.message), "a change of knowledge")
    return "start" if step.number == 1 else "everything is left"


def _innermost(configuration: Iterable[str]) -> Iterator[str]:
    """Yield the active states that have no active states inside them."""
    active = list(configuration)
    yield from (path for path in active if not any(other.startswith(path + "/") for other in active))


def _step_form(step: StepRow) -> dict[str, Any]:
    return {
        "step": step.number, "t": step.time, "version": step.version, "message": step.message,
        "configuration": step.configuration,
    }  # fmt: skip
