"""Deployment: a bundle with its simulated world and its executive, ready for one run with a report."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

from dsc.components.component import Component
from dsc.components.hooks import contained
from dsc.components.robot import require_instances
from dsc.dynamic.knowledge_situation import ACHIEVE
from dsc.dynamic.library import Library
from dsc.errors import ProgrammingError
from dsc.profiles import adapted, configure
from dsc.runs.archive import RunRow, archive, has_run, unfinished
from dsc.sequencer.sequencer import RunEnd, Sequencer
from dsc.sequencer.signals import OnSignal
from dsc.text.profiles import Profile
from dsc.trace import Listener, Record
from knowledge_base.errors import InputError, Place, StoreError, UnknownNameError
from knowledge_base.facts import Delta
from knowledge_base.journal.file import Durability
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.store import KnowledgeBase
from knowledge_base.tracebacks import place_of, user_place
from planning.analysis.explanation import unmet
from planning.engines.planner import Planner
from planning.model.domain import PlanningDomain
from planning.problem.construction import check_goal
from planning.problem.derived import derivation
from planning.robot.bundles import Bundle, components_of, domain_of, gathered, plots_of
from planning.robot.executive import Executive, achieve_plot
from planning.robot.progress import Tally
from planning.robot.report import Judge, Report, reason_of_end, summarise
from planning.robot.simulation import Left, Setup, Simulation


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


class Deployment:
    """A robot program with its world, deployed for one run.

    Attributes:
        name: the name of the robot.
        executive: the robot program.
        simulation: the simulated world; `None` without a simulation.
        tally: counts the records of the run.
        profile: the settings profile; `None` without a profile.
        resumes: whether `run` resumes an interrupted run.
    """

    def __init__(
        self,
        bundle: Bundle,
        executive: Executive,
        simulation: Simulation | None,
        task: Task,
        profile: Profile | None,
        kept: Mapping[str, Any],
        *,
        resumes: bool,
    ) -> None:
        self.name = bundle.name
        self.executive = executive
        self.simulation = simulation
        self.tally = Tally()
        self.profile = profile
        self.resumes = resumes
        self._bundle = bundle
        self._task = task
        self._kept = kept
        executive.listen(self.tally)

    def __enter__(self) -> Self:
        """Return the deployment; the end of the `with` block calls `close`."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the deployment, see `close`."""
        self.close()

    def close(self) -> None:
        """Close the executive and the world."""
        self.executive.close()
        if self.simulation is not None:
            self.simulation.close()

    def run(
        self,
        *,
        simulated: bool = True,
        speed: float = math.inf,
        until: float | None = None,
        on_signal: OnSignal = "suspend",
        prepare: Callable[[Sequencer], None] | None = None,
    ) -> Report:
        """Run the task and return the report, also if Ctrl-C, SIGTERM or SIGHUP ends the run.

        Args:
            simulated: whether time jumps from event to event; a resumed run keeps its kind of time.
            speed: simulated seconds per real second, for people who watch.
            until: second of run time at which the run ends at the latest, see `Executive.run`; a resumed run keeps its
                limit.
            on_signal: with a store, `suspend` stops the components as at an end, and the run can be resumed; `end`
                ends the run.
            prepare: called with the sequencer before the run starts.

        Raises:
            InputError: the goal or an argument does not fit the robot.
            StoreError: the store cannot be read or written.
            ChangedError: plots or domain differ from their versions at the start of the resumed run.
        """
        started = time.perf_counter()

        def ready(sequencer: Sequencer) -> None:
            sequencer.on_signal = on_signal
            if self.simulation is not None and self.simulation.scene() is not None:
                sequencer.trace.listen(_SceneWriter(self.simulation, sequencer))
            if prepare is not None:
                prepare(sequencer)

        try:
            end = self._run(ready, simulated=simulated, speed=speed, until=until)
        except KeyboardInterrupt as interrupt:
            suspended = self.executive.store is not None and on_signal == "suspend"
            end = RunEnd(finished=False, problem=_interrupted(*interrupt.args, suspended=suspended))
        return self._report(end, time.perf_counter() - started)

    def _run(
        self, prepare: Callable[[Sequencer], None], *, simulated: bool, speed: float, until: float | None
    ) -> RunEnd:
        if self.resumes:
            return self.executive.resume(speed=speed, prepare=prepare)
        header, task = {**self.header(), **self._kept}, self._task
        if task.plot is not None:
            return self.executive.run(
                task.plot, task.arguments, simulated=simulated, speed=speed, until=until, prepare=prepare,
                header=header,
            )  # fmt: skip
        assert task.goal is not None  # noqa: S101  `deploy` requires a plot or a goal
        return self.executive.achieve(
            task.goal, simulated=simulated, speed=speed, until=until, prepare=prepare, header=header
        )

    def header(self) -> dict[str, Any]:
        """Return the inputs that determine a run, for the first line of the trace."""
        plots = "".join(sorted(plot.digest for plot in self.executive.library))
        statements = self.executive.domain.statements()
        domain = "\n".join(f"{name}\n{text}" for name, text in sorted(statements.items()))
        world = self.simulation
        return {
            "run": self.name,
            **({} if world is None else {"seed": world.seed, "faults": world.chance}),
            **({} if self.profile is None else {"profile": self.profile.digest}),
            "chart": hashlib.sha256(plots.encode()).hexdigest()[:12],
            "domain": hashlib.sha256(domain.encode()).hexdigest()[:12],
        }

    # -- the report --------------------------------------------------------------------------------------

    def left(self) -> int | None:
        """Return the number of parts of the goal that are left in the simulated world; `None` if it checks no goal."""
        found = self._left_in_world()
        return None if found is None else len(found)

    def _left_in_world(self) -> list[Left] | None:
        """Return the parts that are left in the world, which checks only the bundle's own task."""
        if self.simulation is None or not self._own_task:
            return None
        with contained(f"{type(self.simulation).__name__}.left"):
            left = self.simulation.left()
            if left is None and type(self.simulation).left is not Simulation.left:
                method = type(self.simulation).left
                place = place_of(method)
                raise ProgrammingError(f"{method.__qualname__}: it returns None instead of a list ({place})")
            return None if left is None else list(left)

    @property
    def _own_task(self) -> bool:
        return self._task in (Task(plot=self._bundle.main), Task(goal=self._bundle.goal))

    def _report(self, end: RunEnd, wall_s: float) -> Report:
        knowledge, world = self.executive.knowledge, self.simulation
        judge, left = self._judged(end)
        report = summarise(self.name, judge, left, self.tally, end, self.executive.failures, wall_s)
        if world is None:
            return report
        with contained(f"{type(world).__name__}.own_report"):
            own = world.own_report(knowledge, end)
            headline = world.headline(own, reached=report.goal_reached) if judge == "world" else None
        return replace(report, own=own, faults=tuple(world.fired), headline=headline or report.headline)

    def _judged(self, end: RunEnd) -> tuple[Judge, list[Left]]:
        knowledge, world = self.executive.knowledge, self.simulation
        if world is not None and (left := self._left_in_world()) is not None:
            why = reason_of_end(end, self.tally.gave_up)
            with contained(f"{type(world).__name__}.reason"):
                reasons = [world.reason(one, knowledge, end) or why for one in left]
            return "world", [replace(one, reason=reason) for one, reason in zip(left, reasons, strict=True)]
        goal = self._task.goal or (self._bundle.goal if self._own_task else None)
        if goal is None:
            return "outcome", []
        why = reason_of_end(end, self.tally.gave_up)
        wanted, derived = parse_condition(goal), derivation(self.executive.domain)
        if derived.recursive:
            wanted = derived.at(knowledge).condition(wanted)
        return "knowledge", [Left(what, reason=why) for what in unmet(wanted, knowledge)]


def _interrupted(name: str = "SIGINT", *, suspended: bool) -> str:
    """Return how a run ended at the signal of that name."""
    who = "the operator" if name == "SIGINT" else name
    return f"{who} suspended the run, which can be resumed" if suspended else f"{who} ended the run"


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
) -> Deployment:
    """Deploy a bundle for one run; the caller must close the result.

    Args:
        bundle: the robot.
        task: the plot or goal to run; by default the bundle's own.
        seed: the seed of the simulation's faults.
        faults: the chance of a fault per skill call, in [0, 1].
        scenario: the initial world of the simulation: a file, or a value that the simulation reads.
        profile: the settings of the robot.
        store: a file without a run, which then keeps the run.
        durability: the events that the kept run survives, see `Executive`.
        planner: the planner; by default the one of `Executive`.
        listener: called with every record of the run.
        target: the text that `dsc run --resume` uses to find the bundle again.

    Raises:
        InputError: the bundle has no task, or no simulation for an option. The task does not fit the bundle, a file
            contains an error, or the store already contains a run.
        StoreError: the store cannot be opened, or the world cannot be written.
        ProgrammingError: the code of the simulation has failed; the message has file and line.
    """
    _require_simulated(bundle, seed=seed, faults=faults, scenario=scenario)
    if store is not None and has_run(store):
        raise InputError(f"'{store}' has a run already; resume it by --resume, or take another file")
    setup = Setup(seed, faults, scenario, profile, store)
    kept: dict[str, Any] = {} if target is None else {"target": target}
    if profile is not None:
        kept["settings"] = profile.model_dump(by_alias=True)
    task = task or own_task(bundle)
    if bundle.goal is not None and task.goal is None:
        kept["goal"] = bundle.goal
    return _deployed(bundle, setup, task, durability, planner, listener, kept)


def resume(
    bundle: Bundle,
    store: Path,
    *,
    durability: Durability = "process",
    planner: Planner | None = None,
    listener: Listener | None = None,
) -> Deployment:
    """Deploy a bundle to resume the run in a store; for the arguments see `deploy`.

    Raises:
        InputError: the simulation of the bundle does not last.
        StoreError: the store or the world is missing or unreadable, or the run belongs to another robot.
    """
    run = kept_run(store)
    if run.header.get("run") != bundle.name:
        whose = "another program's, which resumes it: Executive.resume()"
        if "run" in run.header:
            whose = f"of the robot '{run.header['run']}', not of '{bundle.name}'"
        message = f"the run of '{run.plot}' in this store is {whose}"
        raise StoreError(message, place=Place(str(store)))
    if bundle.simulation is not None and not bundle.simulation.lasts:
        raise InputError(
            f"the run cannot be resumed: the simulation of '{bundle.name}' ended with its program; a simulation that"
            " lasts sets `lasts = True` and loads its world if `setup.resumes`"
        )
    said = run.header.get("settings")
    profile = None if said is None else Profile.model_validate(said)
    setup = Setup(run.header.get("seed"), run.header.get("faults"), None, profile, store, resumes=True)
    task = Task(plot=run.plot, arguments=run.arguments)
    if run.plot == ACHIEVE:
        task = Task(goal=str(run.arguments["goal"]))
    elif run.plot == bundle.main and not run.arguments:
        task = Task(plot=bundle.main)
    return _deployed(bundle, setup, task, durability, planner, listener, {})


def kept_run(store: Path) -> RunRow:
    """Return the unfinished run of a store.

    Raises:
        StoreError: the store is missing or unreadable, or has no unfinished run.
    """
    with archive(store) as runs:
        return unfinished(runs)


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


def _require_simulated(bundle: Bundle, **options: object) -> None:
    """Raise `InputError` for an option that needs a simulation, if the bundle lacks it."""
    given = [name for name, value in options.items() if value is not None]
    if given and bundle.simulation is None:
        options_text = ", ".join(f"--{name}" for name in given)
        raise InputError(f"{options_text}: the robot '{bundle.name}' has no simulation (Bundle.simulation)")
    if "scenario" in given and bundle.simulation is not None and not bundle.simulation.reads_scenarios:
        raise InputError(f"--scenario: the simulation of '{bundle.name}' reads no scenarios (`reads_scenarios`)")


def _deployed(
    bundle: Bundle,
    setup: Setup,
    task: Task,
    durability: Durability,
    planner: Planner | None,
    listener: Listener | None,
    kept: Mapping[str, Any],
) -> Deployment:
    simulation = simulated(bundle, setup)
    try:
        components = _components(bundle, simulation)
        configure(components, setup.profile)
        executive = Executive(
            _domain(bundle), _library(bundle, setup.profile), components, None, planner,
            foresight=bundle.foresight, store=setup.store, durability=durability, failures=bundle.failures,
        )  # fmt: skip
    except BaseException:
        if simulation is not None:
            simulation.close()
        raise
    deployed = Deployment(bundle, executive, simulation, task, setup.profile, kept, resumes=setup.resumes)
    try:
        if simulation is not None and setup.store is not None and not setup.resumes:
            with contained(f"{type(simulation).__name__}.begin", _MAY_RAISE):
                simulation.begin()
        begin(executive.knowledge, bundle, simulation, "deployment", key="deployment")
        if task.goal is not None:
            check_goal(parse_condition(task.goal, "goal"), executive.knowledge)
    except BaseException:
        deployed.close()
        raise
    if listener is not None:
        executive.listen(listener)
    return deployed


def components_for(bundle: Bundle) -> tuple[Component, ...]:
    """Return new components of a bundle, those of its simulation included, to read their declarations."""
    return require_instances(_components(bundle, simulated(bundle, Setup())))


def initial_knowledge(bundle: Bundle, simulation: Simulation | None) -> Delta:
    """Return the initial knowledge of a bundle and its simulation; errors as for `deploy`."""
    if simulation is None:
        return bundle.knowledge
    with contained(f"{type(simulation).__name__}.knowledge", _MAY_RAISE):
        try:
            return bundle.knowledge.then(simulation.knowledge())
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
    """Return the simulation of a bundle; raise `ProgrammingError` for an exception of its code."""
    if bundle.simulation is None:
        return None
    with contained(bundle.simulation.__name__, _MAY_RAISE):
        return bundle.simulation(setup)


def _components(bundle: Bundle, simulation: Simulation | None) -> list[Component]:
    with contained(f"the components of '{bundle.name}'", _MAY_RAISE):
        found = [*components_of(gathered([bundle])), *(() if simulation is None else simulation.components())]
    return [*require_instances(found)]


_MAY_RAISE = (InputError, OSError)
"""Exceptions of a simulation about its input: a scenario, a profile or a store."""


_domains: dict[Bundle, PlanningDomain] = {}
_libraries: dict[Bundle, Library] = {}
"""Domains and libraries of bundles, which their runs share with all derived tables; bundles are few."""


def _domain(bundle: Bundle) -> PlanningDomain:
    if bundle not in _domains:
        _domains[bundle] = domain_of(gathered([bundle]))
    return _domains[bundle]


def _library(bundle: Bundle, profile: Profile | None) -> Library:
    if profile is not None:
        return Library([*adapted(plots_of(gathered([bundle])), profile), achieve_plot()])
    if bundle not in _libraries:
        _libraries[bundle] = Library([*plots_of(gathered([bundle])), achieve_plot()])
    return _libraries[bundle]


class _SceneWriter:
    """A trace listener that writes a record `scene` after each event that changed the scene."""

    def __init__(self, world: Simulation, sequencer: Sequencer) -> None:
        self._world = world
        self._trace = sequencer.trace
        self._drawn: list[dict[str, Any]] | None = None

    def __call__(self, record: Record) -> None:
        if record.type not in {"plot", "event"}:
            return
        scene = self._world.scene()
        if scene is not None and scene != self._drawn:
            self._drawn = scene
            self._trace.record("scene", things=scene)
