"""Bringup of robots: a bundle with its simulated world becomes a `Robot`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dsc.components.assembly import require_instances
from dsc.components.component import Component
from dsc.components.hooks import contained
from dsc.components.wiring import choose_sources
from dsc.dynamic.knowledge_situation import ACHIEVE
from dsc.dynamic.library import Library
from dsc.profiles import configure
from dsc.runs.archive import RunRow, archive, has_run, is_unfinished, unfinished
from dsc.sequencer.clock import ClockKind
from dsc.text.profiles import Profile, adapted
from dsc.trace import Listener
from knowledge_base.errors import InputError, Place, StoreError
from knowledge_base.facts import Delta
from knowledge_base.journal.file import Durability
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.store import KnowledgeBase
from knowledge_base.tracebacks import place_of, user_place
from planning.engines.planner import Planner
from planning.execution.shipped_plots import shipped_plots
from planning.problem.construction import check_goal
from planning.robot.bundles import Bundle, components_of, conversions_of, gathered, plots_of, resources_of, wiring_of
from planning.robot.program import Origin
from planning.robot.robot import Robot, kind_of
from planning.robot.simulation import Setup, Simulation, components_in, knowledge_of
from planning.robot.task import Task, own_task


def deploy(
    bundle: Bundle,
    task: Task | None = None,
    *,
    seed: int | None = None,
    faults: float | None = None,
    scenario: object = None,
    profile: Profile | None = None,
    store: Path | None = None,
    durability: Durability = "process",
    planner: Planner | None = None,
    listener: Listener | None = None,
    target: str | None = None,
    clock: ClockKind | None = None,
    remote: Sequence[Component] = (),
) -> Robot:
    """Return the robot of a bundle, with its simulated world; the caller must close it.

    Args:
        bundle: the robot.
        task: the plot or goal to run; by default the bundle's own.
        seed: the seed of the simulation's faults.
        faults: the chance of a fault per skill call, in [0, 1].
        scenario: the initial world of the simulation: a file, or a value that the simulation reads.
        profile: the settings of the robot.
        store: a file without a run, which then keeps the run.
        durability: the events that the kept run survives, see `Robot`.
        planner: the planner; by default the one of `Robot`.
        listener: called with every record of the run.
        target: the text that `dsc run --resume` uses to find the bundle again.
        clock: the kind of time; by default simulated if the bundle has a simulation, otherwise see `Robot`.
        remote: the components of `Bundle.remote`, which other programs host, see `dsc.wire.connect_all`.

    Raises:
        InputError: the bundle has no task, or no simulation for an option. The task does not fit the bundle, a file
            contains an error, or the store already contains a run.
        StoreError: the store cannot be opened, or the world cannot be written.
        ProgrammingError: the code of the simulation has failed; the message has file and line.
    """
    _require_simulated(bundle, seed=seed, faults=faults, scenario=scenario)
    if store is not None and has_run(store):
        choices = "resume it by --resume, or take" if is_unfinished(store) else "the run has ended: take"
        raise InputError(f"'{store}' has a run already; {choices} another file")
    setup = Setup(seed, faults, scenario, profile, store)
    kept: dict[str, Any] = {} if target is None else {"target": target}
    if profile is not None:
        kept["settings"] = profile.model_dump(by_alias=True)
    task = task or own_task(bundle)
    if bundle.goal is not None and task.goal is None:
        kept["goal"] = bundle.goal
    if clock is None and bundle.simulation is not None:
        clock = "simulated"
    return _deploy(bundle, setup, task, durability, planner, listener, kept, clock, remote)


def resume(
    bundle: Bundle,
    store: Path,
    *,
    durability: Durability = "process",
    planner: Planner | None = None,
    listener: Listener | None = None,
    remote: Sequence[Component] = (),
) -> Robot:
    """Deploy a bundle to resume the run in a store; for the arguments see `deploy`.

    Raises:
        InputError: the simulation of the bundle does not last.
        StoreError: the store or the world is missing or unreadable, or the run belongs to another robot.
    """
    run = kept_run(store)
    if run.header.get("run") != bundle.name:
        whose = "another program's, which resumes it: Robot.resume()"
        if "run" in run.header:
            whose = f"of the robot '{run.header['run']}', not of '{bundle.name}'"
        message = f"the run of '{run.plot}' in this store is {whose}"
        raise StoreError(message, place=Place(str(store)))
    said = run.header.get("settings")
    profile = None if said is None else Profile.model_validate(said)
    kind = bundle.simulation_for(profile)
    if kind is not None and not kind.lasts:
        raise InputError(
            f"the run cannot be resumed: the simulation of '{bundle.name}' ended with its program; a simulation that"
            " lasts sets `lasts = True` and loads its world if `setup.resumes`"
        )
    setup = Setup(run.header.get("seed"), run.header.get("faults"), None, profile, store, resumes=True)
    task = Task(plot=run.plot, arguments=run.arguments)
    if run.plot == ACHIEVE:
        task = Task(goal=str(run.arguments["goal"]))
    elif run.plot == bundle.main and not run.arguments:
        task = Task(plot=bundle.main)
    return _deploy(bundle, setup, task, durability, planner, listener, {}, kind_of(run), remote)


def kept_run(store: Path) -> RunRow:
    """Return the unfinished run of a store.

    Raises:
        StoreError: the store is missing or unreadable, or has no unfinished run.
    """
    with archive(store, latest=True) as runs:
        return unfinished(runs)


def _require_simulated(bundle: Bundle, **options: object) -> None:
    """Raise `InputError` for an option that needs a simulation, if the bundle lacks it."""
    given = [name for name, value in options.items() if value is not None]
    if given and bundle.simulation is None:
        options_text = ", ".join(f"--{name}" for name in given)
        raise InputError(f"{options_text}: the robot '{bundle.name}' has no simulation (Bundle.simulation)")
    if "scenario" in given and bundle.simulation is not None and not bundle.simulation.reads_scenarios:
        raise InputError(f"--scenario: the simulation of '{bundle.name}' reads no scenarios (`reads_scenarios`)")


def _deploy(
    bundle: Bundle,
    setup: Setup,
    task: Task,
    durability: Durability,
    planner: Planner | None,
    listener: Listener | None,
    kept: Mapping[str, Any],
    clock: ClockKind | None,
    remote: Sequence[Component],
) -> Robot:
    _require_remote(bundle, remote)
    simulation = simulated(bundle, setup)
    try:
        components = [*_components(bundle, simulation), *remote]
        choose_sources(components, wiring_of(gathered([bundle])))
        configure(components, setup.profile)
        robot = Robot(
            bundle.planning_domain, _library(bundle, setup.profile), components, None, planner,
            clock=clock, foresight=bundle.foresight, store=setup.store, durability=durability, failures=bundle.failures,
            origin=Origin(bundle, task, simulation, setup.profile, kept, setup.resumes),
            resources=resources_of(gathered([bundle])),
        )  # fmt: skip
    except BaseException:
        if simulation is not None:
            simulation.close()
        raise
    try:
        if simulation is not None and setup.store is not None and not setup.resumes:
            with _usable(f"{type(simulation).__name__}.begin"):
                simulation.begin()
        begin(robot.knowledge, bundle, simulation, "deployment", key="deployment")
        if task.goal is not None:
            check_goal(parse_condition(task.goal, "goal"), robot.knowledge)
    except BaseException:
        robot.close()
        raise
    if listener is not None:
        robot.listen(listener)
    return robot


def _require_remote(bundle: Bundle, remote: Sequence[Component]) -> None:
    """Raise `InputError` for a remote component of the bundle that is not given."""
    given = {one.name for one in remote}
    for name in bundle.remote:
        if name not in given:
            message = f"another program hosts the component '{name}' of '{bundle.name}': `deploy(remote=...)` takes it"
            raise InputError(message, found=name)


def devices(
    bundle: Bundle, *, seed: int | None = None, faults: float | None = None, profile: Profile | None = None
) -> tuple[Component, ...]:
    """Return new components of a bundle, those of its simulation included, to host them; errors as for `deploy`."""
    _require_simulated(bundle, seed=seed, faults=faults)
    components = require_instances(_components(bundle, simulated(bundle, Setup(seed, faults, profile=profile))))
    choose_sources(components, wiring_of(gathered([bundle])))
    configure(components, profile)
    return components


def components_for(bundle: Bundle, profile: Profile | None = None) -> tuple[Component, ...]:
    """Return new components of a bundle and its simulation, to read their declarations."""
    return require_instances(_components(bundle, simulated(bundle, Setup(profile=profile))))


def initial_knowledge(bundle: Bundle, simulation: Simulation | None) -> Delta:
    """Return the initial knowledge of a bundle and its simulation; errors as for `deploy`."""
    if simulation is None:
        return bundle.knowledge
    with _usable(f"{type(simulation).__name__}.knowledge"):
        try:
            return bundle.knowledge.then(knowledge_of(simulation))
        except InputError as error:
            error.place = error.place or user_place(error)
            raise


def begin(
    knowledge: KnowledgeBase, bundle: Bundle, simulation: Simulation | None, author: str, key: str | None = None
) -> None:
    """Apply the initial knowledge of a bundle and its simulation; an error has the place of the simulation's method."""
    delta = initial_knowledge(bundle, simulation)
    try:
        knowledge.apply(delta, author, key=key)
    except InputError as error:
        if simulation is not None:
            error.place = error.place or place_of(type(simulation).knowledge)
        raise


def simulated(bundle: Bundle, setup: Setup) -> Simulation | None:
    """Return the simulation of a bundle for the profile's robot.

    Raises:
        ProgrammingError: the code of the simulation raises an exception.
        UnknownNameError: the bundle does not have the profile's robot.
    """
    kind = bundle.simulation_for(setup.profile)
    if kind is None:
        return None
    with _usable(kind.__name__):
        return kind(setup)


def _components(bundle: Bundle, simulation: Simulation | None) -> list[Component]:
    with _usable(f"the components of '{bundle.name}'"):
        found = [*components_of(gathered([bundle])), *(() if simulation is None else components_in(simulation))]
    return [*require_instances(found)]


@contextmanager
def _usable(name: str) -> Iterator[None]:
    """Raise `ProgrammingError` for an exception of the user's code, except errors of input, paths and storage."""
    try:
        with contained(name, _MAY_RAISE):
            yield
    except FileNotFoundError as error:  # the code opens a file without a check
        with contained(name):
            raise error from None


_MAY_RAISE = (InputError, OSError)
"""Exceptions of a simulation about its input: a scenario, a profile or a store."""


def _library(bundle: Bundle, profile: Profile | None) -> Library:
    if profile is None:
        return bundle.library
    found = gathered([bundle])
    return Library([*adapted(plots_of(found), profile), *shipped_plots()], conversions_of(found))
