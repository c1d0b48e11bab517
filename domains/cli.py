"""The command `dsc`: combines the commands of all packages, and runs ready worlds."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from enum import StrEnum
from functools import partial
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from dsc.cli.plots import app as plot_app
from dsc.cli.runs import NoOpen, Port, view_command
from dsc.cli.runs import app as runs_app
from knowledge_base.cli import app as kb_app
from knowledge_base.cli import readers
from planning.cli import bundles_command, doctor_command, plan_command

if TYPE_CHECKING:
    from domains.clean_up_table.deployment import CleanUpTable
    from domains.clean_up_table.report import Report
    from dsc.sequencer.sequencer import Sequencer
    from knowledge_base.errors import InputError
    from knowledge_base.output_files import Output
    from knowledge_base.store import KnowledgeBase

BAD_INPUT, NOT_WRITTEN, NOBODY_READS = 2, 74, 141
"""Exit statuses of every command: bad input, EX_IOERR of sysexits.h, and a shell's status for a broken pipe."""

NO_FILE = frozenset({errno.ELOOP, errno.ENAMETOOLONG, errno.ENOTDIR, errno.EACCES, errno.EPERM})
"""Error numbers for a path that leads to no file, or to a file without permission."""


class _Commands(TyperGroup):
    """The group of commands; a closed pipe of the reader ends a command with `NOBODY_READS`."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except BrokenPipeError:
            raise typer.Exit(NOBODY_READS) from None


app = typer.Typer(
    name="dsc",
    cls=_Commands,
    help="Dynamic State Charts: state charts for what you can foresee, a planner for what you cannot.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
)
app.add_typer(plot_app, name="plot")
app.add_typer(kb_app, name="kb")
app.add_typer(runs_app, name="runs")
app.command("plan")(plan_command)
app.command("doctor")(doctor_command)
app.command("bundles")(bundles_command)
app.command("view")(view_command)

WORLDS = ("clean-up-table",)


class Durability(StrEnum):
    """The events that a kept run survives: a crash of the process, or also a power failure."""

    process = "process"
    power = "power"


def _scenario(path: Path) -> KnowledgeBase:
    """Return the robot's knowledge base at the start of the scenario, for `dsc kb`."""
    from domains.clean_up_table.deployment import deploy
    from domains.clean_up_table.scenario import Scenario

    return deploy(Scenario.load(path)).executive.knowledge


readers.update(dict.fromkeys((".yaml", ".yml"), _scenario))


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"dsc {version('dynamic-state-charts')}")
        raise typer.Exit


@app.callback()
def dsc(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Dynamic State Charts: state charts for what you can foresee, a planner for what you cannot."""


@app.command()
def run(
    world: Annotated[str | None, typer.Argument(help="The ready world to run: clean-up-table.")] = None,
    scenario: Annotated[Path | None, typer.Option(help="The items on the table (YAML).")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the faults; same seed, same run.")] = None,
    faults: Annotated[float | None, typer.Option(min=0.0, max=1.0, help="Chance of a fault per skill call.")] = None,
    profile: Annotated[
        str | None, typer.Option(metavar="NAME|FILE", help="The robot and the values of its parameters (YAML).")
    ] = None,
    real_time: Annotated[bool, typer.Option("--real-time", help="Run in real time.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print the report as one JSON object.")] = False,
    trace: Annotated[
        Path | None, typer.Option(help="Write every record to this file (JSON lines); - is standard output.")
    ] = None,
    store: Annotated[Path | None, typer.Option(help="Keep the run in this new file: it can be resumed.")] = None,
    durability: Annotated[
        Durability, typer.Option(help="With a store, the events that the run survives.")
    ] = Durability.process,
    resume: Annotated[Path | None, typer.Option(help="Resume the interrupted run in this store.")] = None,
    view: Annotated[bool, typer.Option("--view", help="Show it in the browser while it runs.")] = False,
    port: Port = 0,
    no_open: NoOpen = False,
    allow_control: Annotated[
        bool,
        typer.Option("--allow-control", help="With --view: the page may pause the run, and post events and facts."),
    ] = False,
    no_wait: Annotated[bool, typer.Option("--no-wait", help="With --view: end with the run, not at Ctrl-C.")] = False,
) -> None:
    """Run a ready world. Exit status: 0 goal reached, 1 something is left (the report says what and why)."""
    from domains.clean_up_table.deployment import PROFILES, deploy, resumed
    from domains.clean_up_table.scenario import Scenario
    from dsc.text.profiles import find_profile
    from dsc.trace import BEGINS
    from knowledge_base.errors import InputError, UnknownNameError
    from knowledge_base.output_files import Output

    file = None if profile is None or not Path(profile).suffix else Path(profile)
    output = None if trace is None else Output(trace, "--trace", scenario, file, store, resume, over=BEGINS)
    if resume is not None:
        beginning = {
            "WORLD": world, "--scenario": scenario, "--seed": seed, "--faults": faults, "--store": store,
            "--profile": profile,
        }  # fmt: skip
        given = [name for name, value in beginning.items() if value is not None] + ["--real-time"] * real_time
        if given:
            raise InputError(f"--resume continues a run as it began, without {', '.join(given)}")
        deployed = resumed(resume, durability=durability.value)
    else:
        if world is None:
            raise InputError("a run needs a world, or a store to --resume", valid=WORLDS)
        if world not in WORLDS:
            raise UnknownNameError(f"there is no world '{world}'", found=world, valid=WORLDS)
        chosen = Scenario.load(scenario) if scenario is not None else Scenario.default()
        robot = None if profile is None else find_profile(profile, PROFILES)
        deployed = deploy(chosen, seed, faults, store=store, durability=durability.value, profile=robot)
    follow = partial(_followed, deployed, simulated=not real_time, quiet=json, trace=output)
    with deployed:
        if not view:
            report = follow()
            _print(report, as_json=json)
        else:
            report = _viewed(deployed, follow, port, opens=not no_open, control=allow_control, wait=not no_wait)
    raise typer.Exit(0 if report.goal_reached else 1)


def _viewed(
    deployed: CleanUpTable, follow: partial[Report], port: int, *, opens: bool, control: bool, wait: bool
) -> Report:
    """Run with a page in the browser, and return the report; with `wait`, the page stays open after the run."""
    from dsc.cli.runs import page, until_interrupt, viewer_installed
    from dsc.trace import header

    viewer_installed()
    from dsc.viewer.access import PageAddress
    from dsc.viewer.live import LivePage

    live = LivePage(header(**deployed.header()), PageAddress.on(port), control=control)
    deployed.executive.listen(live.hear)
    with page(live, opens=opens) as viewer:
        report = follow(prepare=live.control.attach if live.control else None)
        live.end()
        _print(report, as_json=bool(follow.keywords["quiet"]))
        if wait:
            until_interrupt(viewer)
    return report


def _followed(
    deployed: CleanUpTable,
    *,
    simulated: bool,
    quiet: bool,
    trace: Output | None,
    prepare: Callable[[Sequencer], None] | None = None,
) -> Report:
    """Run and return the report; print the progress unless `quiet`, and write the trace."""
    from contextlib import ExitStack

    from rich.console import Console

    from domains.progress import LiveProgress, PlainProgress
    from dsc.trace import header, write_to

    with ExitStack() as stack:
        if trace is not None:
            stream = stack.enter_context(trace.stream())
            stream.write(header(**deployed.header()) + "\n")
            deployed.executive.listen(write_to(stream))
        console = Console()
        if not quiet and console.is_terminal:
            left = deployed.world.left
            live = LiveProgress(console, lambda: len(left()), deployed.tally)
            deployed.executive.listen(stack.enter_context(live))
        elif not quiet:
            deployed.executive.listen(PlainProgress(typer.echo))
        return deployed.run(simulated=simulated, prepare=prepare)


def _print(report: Report, *, as_json: bool) -> None:
    import json

    if as_json:
        typer.echo(json.dumps(report.to_json()))
        return
    typer.echo("")
    for line in report.lines():
        typer.echo(line)


def main() -> None:
    """Run the command line; report bad input as one message with exit status 2, and never as a traceback."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # a terminal may not support every character
            stream.reconfigure(errors="backslashreplace")
    try:
        _command()
    except BrokenPipeError:
        sys.exit(NOBODY_READS)
    except OSError as error:
        from knowledge_base.output_files import FULL

        if error.errno not in FULL:
            raise
        named = "" if error.filename is None else f" '{error.filename}'"
        typer.echo(f"dsc: cannot write{named}: {error.strerror}", err=True)
        sys.exit(NOT_WRITTEN)
    finally:
        _drop_unwritten()


def _command() -> None:
    as_json = "--json" in sys.argv
    try:
        status = app(standalone_mode=not as_json)  # without --json, Typer itself reports wrong arguments
    except Exception as error:
        from knowledge_base.errors import InputError

        wrong = _unusable(error) or (_misused(error) if as_json else error)
        if not isinstance(wrong, InputError):
            raise
        _tell(wrong, as_json=as_json)
        sys.exit(BAD_INPUT)
    sys.exit(status)


def _unusable(error: Exception) -> InputError | None:
    """Return the error for a path argument that the operating system refused; `None` for any other error."""
    from knowledge_base.errors import InputError

    if isinstance(error, RuntimeError) and isinstance(error.__context__, OSError):
        error = error.__context__  # Python 3.11 raises a RuntimeError for circular links
    if not isinstance(error, OSError) or error.errno not in NO_FILE or error.filename is None:
        return None
    return InputError(f"cannot use '{error.filename}': {error.strerror}", found=str(error.filename))


def _misused(error: Exception) -> Exception:
    """Return an `InputError` for wrong arguments of a command; return any other error unchanged."""
    from knowledge_base.errors import InputError

    message = getattr(error, "format_message", None)
    if message is None:
        return error
    option, valid = getattr(error, "option_name", None), getattr(error, "possibilities", None) or ()
    said = f"no such option: {option}" if option else message().partition("\n")[0].removesuffix(".")
    return InputError(said, found=option, valid=valid)


def _tell(error: InputError, *, as_json: bool) -> None:
    """Print the error on standard error, or with --json as JSON on standard output."""
    import json

    from knowledge_base.errors import Place

    if not as_json:
        typer.echo(f"dsc: {error}", err=True)
        return
    place = error.place or Place()
    where = {"file": place.source, "line": place.line, "column": place.column}
    said = {"outcome": "bad_input", "message": error.message, **where, "found": error.found, "nearest": error.nearest}
    typer.echo(json.dumps(said))


def _drop_unwritten() -> None:
    """Discard unwritten output, so that Python reports no second error at its exit."""
    try:
        if sys.stdout is not None:  # `None` if the process started without standard output
            sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
