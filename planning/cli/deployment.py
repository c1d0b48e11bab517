"""Command `dsc deployment`: check, draw and simulate deployment models."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dsc.cli.findings import JSON, SARIF, SELECT, STRICT, report
from knowledge_base.cli.console import Json, print_json
from knowledge_base.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dsc.deployment.cores import Core
    from dsc.deployment.model import Deployment

app = typer.Typer(
    name="deployment",
    rich_markup_mode=None,
    no_args_is_help=True,
    help="Deployment models: hosts, devices, components, real-time tasks and resources.",
)

_File = Annotated[Path, typer.Argument(metavar="FILE", help="A deployment model (YAML).")]
_MOST_JOBS = 1_000_000
"""Maximum number of simulated jobs of a core."""
_WRONG = 2
"""Exit status with findings or missed deadlines."""


@app.command()
def check(file: _File, json: JSON = False, sarif: SARIF = False, select: SELECT = None, strict: STRICT = False) -> None:
    """Check placement, required hardware and services, resources, and the deadlines of real-time tasks.

    Exit status: 0 without findings; 2 with findings.
    """
    from planning.robot.placed import check_deployment_file

    found = check_deployment_file(file)
    nothing = "" if found else "\n".join([*_tables(_whole(file)[0]), f"{file}: no mistakes found"])
    wrong = report([(file, one) for one in found], nothing, json=json, sarif=sarif, selection=select, strict=strict)
    raise typer.Exit(_WRONG if wrong else 0)


@app.command()
def draw(
    file: _File,
    svg: Annotated[
        str, typer.Option("--svg", metavar="OUT.svg", help="Draw it to a file; - is standard output.")
    ] = "-",
    timeline: Annotated[
        bool, typer.Option("--timeline", help="Draw the worst case of each core over time instead.")
    ] = False,
) -> None:
    """Draw the hosts with their devices, components and wires, or the worst case of their real-time tasks."""
    from dsc.deployment.diagram import draw_deployment
    from dsc.deployment.timeline import draw_worst_cases
    from knowledge_base.output_files import Output

    output = Output(svg, "--svg", file)
    deployment, wires = _whole(file)
    output.write(draw_worst_cases(deployment) if timeline else draw_deployment(deployment, wires))


@app.command()
def simulate(
    file: _File,
    seconds: Annotated[float, typer.Option(min=0.001, max=3600, help="Simulated seconds.")] = 10.0,
    seed: Annotated[int, typer.Option(help="Seed of offsets, jitter and execution times.")] = 0,
    json: Json = False,
) -> None:
    """Simulate the real-time tasks of each core, and compare their response times with the worst case.

    Exit status: 0 if all deadlines are met; 2 otherwise.
    """
    from dsc.deployment.cores import cores_of

    deployment, _ = _whole(file)
    rows = [row for core in cores_of(deployment) for row in _simulation_rows(core, seconds, seed)]
    if json:
        print_json(rows)
    else:
        for row in rows:
            typer.echo(_row_text(row))
        if not rows:
            typer.echo("the components have no real-time tasks")
    raise typer.Exit(_WRONG if any(row["missed"] for row in rows) else 0)


def _whole(file: Path) -> tuple[Deployment, dict[str, str]]:
    """Return the deployment in a file with the demands of its robot, and the providers by required port.

    Raises:
        InputError: the file is not a deployment model, or a component or task has no place.
    """
    from dsc.components.wiring import provider_for
    from dsc.deployment.deadlines import check_tasks
    from dsc.deployment.model import load_deployment
    from dsc.deployment.placement import check_placement
    from planning.robot.placed import robot_at, with_demands_of

    deployment = load_deployment(file)
    components, remote = robot_at(deployment, file.parent)
    whole = with_demands_of(deployment, components.values())
    for check in (check_placement, check_tasks):
        for wrong in check(whole):
            raise wrong.error
    ports = [(port, one) for one in components.values() for port in one.requirements.values() if not remote]
    found = {port.name: provider_for(port, one, components) for port, one in ports}
    return whole, {name: provider.name for name, provider in found.items() if provider is not None}


def _tables(deployment: Deployment) -> Iterator[str]:
    """Yield the lines of a table for each core: its tasks with their worst response times."""
    from dsc.deployment.cores import cores_of, verdict_of
    from dsc.deployment.words import in_mode, shown_time

    for core in cores_of(deployment):
        verdict = verdict_of(core)
        order = core.policy.replace("_", " ")
        proof = "; the bound alone proves it" if verdict.within_bound else ""
        yield (
            f"{core.host}, core {core.number}{in_mode(core.mode)}, {order}: utilisation {core.utilisation:.1%}, bound"
            f" {core.bound:.1%}; all deadlines are met{proof}"
        )
        yield f"  {'task':24} {'period':>10} {'worst case':>10} {'deadline':>10} {'response':>10}"
        for task in core.tasks:
            worst = verdict.responses.get(task.name)
            times = (task.period, task.worst_case, task.deadline)
            cells = " ".join(f"{shown_time(time):>10}" for time in times)
            yield f"  {task.name:24} {cells} {'-' if worst is None else shown_time(worst):>10}"


def _simulation_rows(core: Core, seconds: float, seed: int) -> Iterator[dict[str, Any]]:
    """Yield for each task of a core its worst response, computed and in a random schedule, and its missed deadlines."""
    from collections import Counter
    from random import Random

    from dsc.deployment.cores import verdict_of
    from dsc.deployment.schedule import random_jobs, run_jobs
    from dsc.deployment.tasks import NANOSECONDS

    until = round(seconds * NANOSECONDS)
    if sum(until // task.period for task in core.tasks) > _MOST_JOBS:
        raise InputError(f"--seconds {seconds:g} are more than {_MOST_JOBS} jobs; simulate a shorter time")
    jobs = list(random_jobs(core.tasks, until, Random(seed)))  # noqa: S311  a simulation
    schedule = run_jobs(jobs, core.policy, until)
    responses, worst = schedule.responses(), verdict_of(core).responses
    missed, begun = Counter(job.task.name for job in schedule.misses), Counter(job.task.name for job in jobs)
    for task in core.tasks:
        found = {
            "response": responses.get(task.name),
            "worst_response": worst.get(task.name),
            "deadline": task.deadline,
        }
        yield {
            "host": core.host, "core": core.number, "mode": core.mode, "task": task.name, "jobs": begun[task.name],
            "missed": missed[task.name],
        } | {name: None if time is None else time / NANOSECONDS for name, time in found.items()}  # fmt: skip


def _row_text(row: dict[str, Any]) -> str:
    from dsc.deployment.tasks import NANOSECONDS
    from dsc.deployment.words import in_mode, shown_time

    times = {
        name: "-" if row[name] is None else shown_time(round(row[name] * NANOSECONDS))
        for name in ("response", "worst_response", "deadline")
    }
    where = f"{row['host']}.{row['core']}{in_mode(row['mode'])}"
    return (
        f"{where} {row['task']:24} {row['jobs']:>6} jobs, {row['missed']} missed;"
        f" response {times['response']}, at worst {times['worst_response']}, deadline {times['deadline']}"
    )
