"""Command `dsc run`: run any robot, with progress, trace, store and page, and print its report."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack
from enum import StrEnum
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsc.cli.logs import PROGRAMMING_ERROR, Quiet, Verbose, show_logs
from dsc.cli.view import DataOption, NoOpen, Port
from dsc.cli.wire import REALM, Connect, Realm, ZenohFile, texts_by_name

if TYPE_CHECKING:
    from dsc.components.component import Component
    from dsc.sequencer.clock import ClockKind
    from dsc.sequencer.sequencer import Sequencer
    from knowledge_base.output_files import Output
    from knowledge_base.store import KnowledgeBase
    from planning.engines.planner import Planner
    from planning.robot.bundles import Bundle
    from planning.robot.report import Report
    from planning.robot.robot import Robot
    from planning.robot.task import Task

GOAL_REACHED, SOMETHING_LEFT = 0, 1
"""Exit statuses of `dsc run`, besides those of every command."""


class Durability(StrEnum):
    """The events that a kept run survives: a crash of the process, or also a power failure."""

    process = "process"
    power = "power"


class OnSignal(StrEnum):
    """Reactions of a kept run to Ctrl-C, SIGTERM and SIGHUP."""

    suspend = "suspend"
    end = "end"


def robots() -> Iterator[str]:
    """Yield the names of the installed robots, for the completion of a shell."""
    from contextlib import suppress

    from knowledge_base.errors import InputError
    from planning.robot.bundles import installed

    with suppress(InputError):  # an unreadable package must not end the completion
        yield from installed()


def run_command(
    target: Annotated[
        str | None,
        typer.Argument(
            metavar="TARGET",
            help="The robot: a bundle's name, MODULE:NAME, a Python file or a project folder.",
            autocompletion=robots,
        ),
    ] = None,
    goal: Annotated[str | None, typer.Option(metavar="CONDITION", help="Plan for this goal.")] = None,
    plot: Annotated[str | None, typer.Option(metavar="NAME", help="Run this plot.  [default: the robot's]")] = None,
    with_: Annotated[
        list[str] | None, typer.Option("--with", metavar="NAME=VALUE", help="A parameter of the plot; repeatable.")
    ] = None,
    scenario: Annotated[Path | None, typer.Option(help="The initial world of the simulation.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the faults; same seed, same run.")] = None,
    faults: Annotated[float | None, typer.Option(min=0.0, max=1.0, help="Chance of a fault per skill call.")] = None,
    profile: Annotated[
        str | None, typer.Option(metavar="NAME|FILE", help="The robot and the values of its parameters (YAML).")
    ] = None,
    experience: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The experience for learned choices (YAML).")
    ] = None,
    engine: Annotated[
        str | None, typer.Option(metavar="NAME", help="The planning engine.  [default: one that suits the problem]")
    ] = None,
    real_time: Annotated[bool, typer.Option("--real-time", help="Run in real time.")] = False,
    speed: Annotated[
        float | None,
        typer.Option(metavar="X", help="Simulated seconds per real second, to watch a run.  [default: no limit]"),
    ] = None,
    until: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="End at this second of run time.  [default: a week of simulated time]"),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print the report as one JSON object.")] = False,
    trace: Annotated[
        Path | None, typer.Option(help="Write every record to this file (JSON lines); - is standard output.")
    ] = None,
    store: Annotated[Path | None, typer.Option(help="Keep the run in this new file: it can be resumed.")] = None,
    durability: Annotated[
        Durability, typer.Option(help="With a store, the events that the run survives.")
    ] = Durability.process,
    on_signal: Annotated[
        OnSignal, typer.Option(help="With a store: Ctrl-C, SIGTERM and SIGHUP suspend the run, or end it.")
    ] = OnSignal.suspend,
    resume: Annotated[Path | None, typer.Option(help="Resume the interrupted run in this store.")] = None,
    monitor: Annotated[
        Path | None, typer.Option(help="Record the values that this monitoring profile (YAML) selects.")
    ] = None,
    watch: Annotated[
        bool, typer.Option("--watch", help="Change the plots of the run when their files change, for development.")
    ] = False,
    view: Annotated[bool, typer.Option("--view", help="Show it in the browser while it runs.")] = False,
    port: Port = 0,
    no_open: NoOpen = False,
    data: DataOption = None,
    allow_control: Annotated[
        bool,
        typer.Option("--allow-control", help="With --view: the page may pause the run, and post events and facts."),
    ] = False,
    no_wait: Annotated[bool, typer.Option("--no-wait", help="With --view: end with the run, not at Ctrl-C.")] = False,
    realm: Realm = REALM,
    connect: Connect = None,
    zenoh: ZenohFile = None,
    verbose: Verbose = 0,
    quiet: Quiet = False,
) -> None:
    """Run a robot.

    Exit status: 0 goal reached, 1 something is left (the report says what and why), 2 bad input. Status 3 reports an
    exception in the code of the robot, and the log says where.
    """
    from dsc.monitoring.profile import load_monitoring
    from dsc.trace import BEGINS
    from knowledge_base.errors import InputError
    from knowledge_base.output_files import Output

    show_logs(verbose, quiet=quiet)
    settings = None if profile is None or not Path(profile).suffix else Path(profile)
    monitored = None if monitor is None else load_monitoring(monitor)
    if speed is not None and real_time:
        raise InputError("a run is in real time, or in simulated time at a --speed")
    output = (
        None
        if trace is None
        else Output(trace, "--trace", scenario, settings, experience, store, resume, monitor, over=BEGINS)
    )
    planner = None if engine is None else _planner(engine)
    wire = _Wire(realm, connect or (), zenoh)
    if resume is not None:
        beginning = {
            "--goal": goal, "--plot": plot, "--with": with_, "--scenario": scenario, "--seed": seed,
            "--faults": faults, "--store": store, "--profile": profile, "--until": until, "--experience": experience,
        }  # fmt: skip
        given = [name for name, value in beginning.items() if value is not None] + ["--real-time"] * real_time
        if given:
            raise InputError(f"--resume continues a run as it began, without {', '.join(given)}")
        robot = _resume(resume, target, durability, planner, wire)
    else:
        bundle = _bundle(target)
        if bundle.remote and speed is not None:
            raise InputError("a run with components of other programs is in real time, without --speed")
        clock: ClockKind = "real" if real_time or bundle.remote else "simulated"
        robot = _robot(bundle, _task(bundle, goal, plot, with_ or []), scenario, seed, faults, profile, experience,
                             store, durability, target, planner, clock, wire)  # fmt: skip
    follow = partial(_run_with_progress, robot, speed=inf if speed is None else speed, until=until,
                     on_signal=on_signal, quiet=json or quiet, trace=output, watch=watch)  # fmt: skip
    with wire, robot:
        if monitored is not None:
            robot.monitor(monitored)
        if not view:
            report = follow()
            _print(report, as_json=json)
        else:
            report = _run_with_page(
                robot, follow, port, opens=not no_open, control=allow_control, data=data, wait=not no_wait, as_json=json
            )
    if report.programming_error is not None:
        raise typer.Exit(PROGRAMMING_ERROR)
    raise typer.Exit(GOAL_REACHED if report.goal_reached else SOMETHING_LEFT)


class _Wire:
    """The connection of a run to the components that other programs host; opened if the robot has some.

    Args:
        realm, endpoints, settings: see `dsc.wire.client_transport`.
    """

    def __init__(self, realm: str, endpoints: Collection[str], settings: Path | None) -> None:
        self._how = realm, endpoints, settings
        self._open = ExitStack()

    def connect(self, bundle: Bundle) -> Sequence[Component]:
        """Return the remote components of a bundle; errors as for `dsc.wire.connect_all`."""
        if not bundle.remote:
            return ()
        import asyncio

        from dsc.wire.realm import client_transport, connect_all

        transport = self._open.enter_context(client_transport(*self._how))
        typer.echo(f"connecting to {', '.join(bundle.remote)} in the realm '{transport.realm}'", err=True)
        try:
            return asyncio.run(connect_all(bundle.remote, transport))
        except BaseException:
            self._open.close()
            raise

    def __enter__(self) -> None:
        """Do nothing: `connect` has opened the connection."""

    def __exit__(self, *_: object) -> None:
        """Close the connection."""
        self._open.close()


def _bundle(target: str | None) -> Bundle:
    from knowledge_base.errors import InputError
    from planning.robot.bundles import installed
    from planning.robot.targets import bundle_at

    if target is None:
        raise InputError("a run needs a robot, or a store to --resume", valid=installed())
    return bundle_at(target)


def _task(bundle: Bundle, goal: str | None, plot: str | None, given: list[str]) -> Task:
    from knowledge_base.errors import InputError
    from planning.robot.task import Task, own_task, plot_task

    arguments = {name.removeprefix("?"): text for name, text in texts_by_name(given).items()}
    if goal is not None and (plot is not None or given):
        raise InputError("a run has a goal, or a plot with parameters: give --goal, or --plot and --with")
    if goal is not None:
        return Task(goal=goal)
    if plot is None and not given:
        return own_task(bundle)
    if plot is None and bundle.main is None:
        raise InputError("--with states parameters of a plot: name it with --plot")
    return plot_task(bundle, plot or str(bundle.main), arguments)


def _robot(
    bundle: Bundle,
    task: Task,
    scenario: Path | None,
    seed: int | None,
    faults: float | None,
    profile: str | None,
    experience: Path | None,
    store: Path | None,
    durability: Durability,
    target: str | None,
    planner: Planner | None,
    clock: ClockKind,
    wire: _Wire,
) -> Robot:
    from dsc.text.experience import load_experience
    from dsc.text.profiles import find_profile
    from planning.robot.bringup import deploy
    from planning.robot.targets import full_target

    settings = None if profile is None else find_profile(profile, bundle.profiles or Path())
    known = None if experience is None else load_experience(experience)
    robot = deploy(
        bundle, task, seed=seed, faults=faults, scenario=scenario, profile=settings, store=store,
        durability=durability.value, planner=planner, target=None if target is None else full_target(target),
        clock=clock, remote=wire.connect(bundle),
    )  # fmt: skip
    robot.experience = known or robot.experience
    return robot


def _planner(engine: str) -> Planner:
    """Return the planner of one engine; its processes end with the program."""
    from planning.engines.race import CachingPlanner, PlannerRace
    from planning.engines.registry import only

    return CachingPlanner(PlannerRace(choose=only(engine)))


def _resume(store: Path, target: str | None, durability: Durability, planner: Planner | None, wire: _Wire) -> Robot:
    """Deploy the robot that began the run in a store; `target` replaces the target that the store has kept."""
    from knowledge_base.errors import Place, StoreError
    from planning.robot.bringup import kept_run, resume
    from planning.robot.targets import bundle_at

    run = kept_run(store)
    wanted = target or run.header.get("target") or run.header.get("run")
    if wanted is None:
        whose = f"the run of '{run.plot}' in this store is another program's, which resumes it: Robot.resume()"
        raise StoreError(whose, place=Place(str(store)))
    bundle = bundle_at(str(wanted))
    return resume(bundle, store, durability=durability.value, planner=planner, remote=wire.connect(bundle))


def _run_with_page(
    robot: Robot,
    follow: partial[Report],
    port: int,
    *,
    opens: bool,
    control: bool,
    data: Path | None,
    wait: bool,
    as_json: bool,
) -> Report:
    """Run with a page in the browser, and return the report; with `wait`, the page stays open after the run."""
    from dsc.cli.view import page, until_interrupt, viewer_installed
    from dsc.trace import header

    viewer_installed()
    from dsc.viewer.access import PageAddress
    from dsc.viewer.live import LivePage

    live = LivePage(header(**robot.header()), PageAddress.on(port), control=control, data=data)
    robot.listen(live.receive)
    with page(live, opens=opens) as viewer:
        report = follow(prepare=live.control.attach if live.control else None)
        live.end()
        _print(report, as_json=as_json)
        if wait:
            until_interrupt(viewer)
    return report


def _run_with_progress(
    robot: Robot,
    *,
    speed: float,
    until: float | None,
    on_signal: OnSignal,
    quiet: bool,
    trace: Output | None,
    watch: bool,
    prepare: Callable[[Sequencer], None] | None = None,
) -> Report:
    """Run and return the report; print the progress unless `quiet`, and write the trace.

    With `quiet`, texts that the robot prints go to standard error: standard output has only the report.
    """
    import sys
    from contextlib import redirect_stdout

    from rich.console import Console

    from dsc.components.hooks import unawaited_coroutines
    from dsc.trace import header, write_to
    from planning.robot.garbage import settled
    from planning.robot.progress import LiveProgress, PlainProgress
    from planning.robot.tally import Tally

    with ExitStack() as stack:
        if trace is not None:
            stream = stack.enter_context(trace.stream())
            stream.write(header(**robot.header()) + "\n")
            robot.listen(write_to(stream))
        console = Console()
        if not quiet and console.is_terminal:
            tally = Tally()
            robot.listen(tally)
            live = LiveProgress(console, robot.judgement().left, tally)
            robot.listen(stack.enter_context(live))
        elif not quiet:
            robot.listen(PlainProgress(typer.echo))
        else:
            stack.enter_context(redirect_stdout(sys.stderr))
        if robot.clock == "real":
            stack.enter_context(settled())
            stack.enter_context(unawaited_coroutines())
        if watch:
            begin = stack.enter_context(_plot_watch(robot))
            prepare = begin if prepare is None else partial(_both, prepare, begin)
        report = robot.report(speed=speed, until=until, on_signal=on_signal.value, prepare=prepare)
    if not quiet:
        typer.echo("")  # between the progress and the report
    return report


def _plot_watch(robot: Robot) -> AbstractContextManager[Callable[[Sequencer], None]]:
    """Return a context in which the runs of a robot receive the changes of its plot files."""
    from planning.robot.plot_watch import PlotFiles, watched_files

    files = PlotFiles(robot.library, None if robot.origin is None else robot.origin.profile)
    return watched_files(files, partial(typer.echo, err=True))


def _both(first: Callable[[Sequencer], None], second: Callable[[Sequencer], None], sequencer: Sequencer) -> None:
    first(sequencer)
    second(sequencer)


def _print(report: Report, *, as_json: bool) -> None:
    import json

    if as_json:
        typer.echo(json.dumps(report.to_json()))
        return
    for line in report.lines():
        typer.echo(line)


# -- targets in other commands -------------------------------------------------------------------------------


def robot_knowledge(source: Path) -> KnowledgeBase | None:
    """Return the initial knowledge of a robot, for `dsc kb`; `None` if the source is not a target.

    A scenario (YAML) belongs to the first installed robot that can read it. The text `TARGET@SCENARIO` names both.
    """
    from knowledge_base.errors import InputError
    from planning.robot.bringup import deploy
    from planning.robot.bundles import installed
    from planning.robot.targets import bundle_at

    target, _, scenario = str(source).partition("@")
    if source.suffix in {".yaml", ".yml"} and not scenario:
        able = [one for one in installed().values() if one.simulation and one.simulation.reads_scenarios]
        errors = []
        for one in able:
            try:
                return deploy(one, scenario=source).knowledge
            except InputError as error:
                errors.append(error)
        if not errors:
            return None
        if len(errors) == 1:
            raise errors[0]
        briefly = (str(error).replace(str(source), source.name) for error in errors)
        reasons = "; ".join(f"{one.name}: {error}" for one, error in zip(able, briefly, strict=True))
        raise InputError(f"the scenario fits no installed robot; name one as ROBOT@{source.name} ({reasons})")
    if source.is_file() and source.suffix != ".py":
        return None
    if not (scenario or source.is_dir() or source.suffix == ".py" or ":" in target or target in installed()):
        return None
    return deploy(bundle_at(target), scenario=Path(scenario) if scenario else None).knowledge


def components_of_target(target: str) -> tuple[Component, ...]:
    """Return the components of a robot, or the components that a target names, for `dsc plot check --robot`."""
    from dsc.components.assembly import components_in
    from planning.robot.bringup import components_for
    from planning.robot.bundles import Bundle
    from planning.robot.targets import value_at

    found = value_at(target)
    return components_for(found) if isinstance(found, Bundle) else components_in(found)
