"""Deployment of the clean-up-table robot: simulated world, components, knowledge base, plots and planner."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Self

from domains.clean_up_table.components import Arm, Base, Camera, PatientCamera, SuctionArm, Tracks, Voice
from domains.clean_up_table.durable_world import DurableWorld, beside, require_free
from domains.clean_up_table.observations import initial_knowledge
from domains.clean_up_table.physics import Physics
from domains.clean_up_table.report import Report, summarise
from domains.clean_up_table.scenario import Scenario
from domains.clean_up_table.table_world import TableWorld
from domains.progress import Tally
from dsc.components.component import Component
from dsc.dynamic.library import Library
from dsc.model.plot import ActionPlot
from dsc.profiles import adapted, configure
from dsc.runs.archive import archive, has_run, unfinished
from dsc.sequencer.sequencer import RunEnd, Sequencer
from dsc.text.plot_files import load_library
from dsc.text.profiles import Profile
from dsc.trace import Listener, Record
from knowledge_base.errors import InputError, Place, StoreError, UnknownNameError
from knowledge_base.journal.file import Durability
from planning.bundles import Bundle
from planning.domain import PlanningDomain
from planning.engines.planner import Planner
from planning.executive import Executive, achieve_plot

HOME = Path(str(files("domains.clean_up_table")))
NAME = "clean-up-table"
MAIN_PLOT = "clean_up_table"


@dataclass(slots=True)
class CleanUpTable:
    """A table to be cleared, with the robot program that clears the table.

    Attributes:
        world: the simulated world, with its true state.
        executive: the robot program.
        tally: counts the records of the run.
        resumes: whether `run` resumes an interrupted run.
        profile: the settings profile of the robot; `None` for the default robot.
    """

    world: TableWorld
    executive: Executive
    tally: Tally = field(default_factory=Tally)
    resumes: bool = False
    profile: Profile | None = None

    def __enter__(self) -> Self:
        """Return the deployment; the end of the `with` block calls `close`."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the deployment, see `close`."""
        self.close()

    def close(self) -> None:
        """Close the executive and the file of the world."""
        self.executive.close()
        if isinstance(self.world, DurableWorld):
            self.world.close()

    def run(self, *, simulated: bool = True, prepare: Callable[[Sequencer], None] | None = None) -> Report:
        """Clear the table and return the report, also if the operator ends the run with Ctrl-C.

        Args:
            simulated: whether time jumps from event to event; a resumed run keeps its kind of time.
            prepare: called with the sequencer before the run starts.

        Raises:
            StoreError: the store cannot be read or written.
            ChangedError: plots or domain differ from their versions at the start of the resumed run.
        """
        started = time.perf_counter()

        def ready(sequencer: Sequencer) -> None:
            self._prepare(sequencer, prepare)

        try:
            if self.resumes:
                end = self.executive.resume(prepare=ready)
            else:
                end = self.executive.run(MAIN_PLOT, simulated=simulated, prepare=ready, header=self._kept())
        except KeyboardInterrupt:
            end = RunEnd(finished=False, problem="the operator ended the run")
        return summarise(self.world, self.executive.knowledge, self.tally, end, time.perf_counter() - started)

    def _prepare(self, sequencer: Sequencer, more: Callable[[Sequencer], None] | None) -> None:
        sequencer.trace.listen(_SceneWriter(self.world, sequencer))
        if more is not None:
            more(sequencer)

    def _kept(self) -> dict[str, Any]:
        """Return the header of the run with the profile, which a resumed run needs."""
        settings = {} if self.profile is None else {"settings": self.profile.model_dump(by_alias=True)}
        return {**self.header(), **settings}

    def header(self) -> dict[str, Any]:
        """Return the inputs that determine a run, for the first line of the trace."""
        plots = "".join(sorted(plot.digest for plot in self.executive.library))
        return {
            "run": NAME,
            "seed": self.world.faults.seed,
            "faults": self.world.faults.chance,
            **({} if self.profile is None else {"profile": self.profile.digest}),
            "chart": hashlib.sha256(plots.encode()).hexdigest()[:12],
            "domain": hashlib.sha256((HOME / "domain.pddl").read_bytes()).hexdigest()[:12],
        }


def deploy(
    scenario: Scenario | None = None,
    seed: int | None = None,
    faults: float | None = None,
    planner: Planner | None = None,
    listener: Listener | None = None,
    store: Path | None = None,
    durability: Durability = "process",
    profile: Profile | None = None,
) -> CleanUpTable:
    """Deploy everything for one run; the caller must close the result.

    Args:
        scenario: the items on the table; by default `Scenario.default`.
        seed: the seed of the faults; by default the seed of the scenario.
        faults: the chance of a fault per skill call, in [0, 1]; by default the chance of the scenario.
        planner: the planner; by default pyperplan in a separate process.
        listener: called with every record of the run.
        store: a file without a run, which then keeps the run; a sidecar file keeps the world.
        durability: the events that the run survives, see `Executive`.
        profile: the robot, one of `ROBOTS`, and the values of its parameters; by default the robot on wheels.

    Raises:
        InputError: the scenario or the profile contains an error, or the store already contains a run.
        StoreError: the store cannot be opened, or the world cannot be written.
    """
    world = (scenario or Scenario.default()).world(seed, faults)
    if store is None:
        return _wired(world, planner, listener, profile)
    if has_run(store):
        raise InputError(f"'{store}' has a run already; resume it by --resume, or take another file")
    require_free(beside(store))
    lasting = DurableWorld.from_state(world.state())
    deployed = _wired(lasting, planner, listener, profile, store, durability)
    try:
        lasting.create(beside(store))
    except BaseException:
        deployed.close()
        raise
    return deployed


def resumed(
    store: Path,
    planner: Planner | None = None,
    listener: Listener | None = None,
    durability: Durability = "process",
) -> CleanUpTable:
    """Deploy everything to resume the run in a store; for the arguments see `deploy`.

    Raises:
        StoreError: the store or the world is missing or unreadable, or the run belongs to another program.
    """
    with archive(store) as runs:
        run = unfinished(runs)
    if run.header.get("run") != NAME:
        whose = f"the run of '{run.plot}' in this store is another program's, which resumes it: Executive.resume()"
        raise StoreError(whose, place=Place(str(store)))
    said = run.header.get("settings")
    profile = None if said is None else Profile.model_validate(said)
    deployed = _wired(DurableWorld.open(beside(store)), planner, listener, profile, store, durability)
    deployed.resumes = True
    return deployed


def _wired(
    world: TableWorld,
    planner: Planner | None,
    listener: Listener | None,
    profile: Profile | None,
    store: Path | None = None,
    durability: Durability = "process",
) -> CleanUpTable:
    components = robot(profile)(world)
    configure(components, profile)
    executive = Executive(
        domain(), library() if profile is None else adapted(plots(), profile), components, None, planner,
        foresight=Physics(), store=store, durability=durability,
    )  # fmt: skip
    executive.knowledge.apply(initial_knowledge(world.robot_at), "deployment", key="deployment")
    deployed = CleanUpTable(world, executive, profile=profile)
    executive.listen(deployed.tally)
    if listener is not None:
        executive.listen(listener)
    return deployed


def on_wheels(world: TableWorld) -> list[Component]:
    """Return the components of the robot with a base on wheels and an arm with a hand."""
    return [Base(world), Arm(world), Camera(world), Voice(world)]


def on_tracks(world: TableWorld) -> list[Component]:
    """Return the components of the robot with a base on tracks and a suction arm."""
    return [Tracks(world), SuctionArm(world), PatientCamera(world), Voice(world)]


ROBOTS = {"on_wheels": on_wheels, "on_tracks": on_tracks}
"""The robots for this task, by their names in profiles; each is a function that returns components."""
PROFILES = HOME / "profiles"


def robot(profile: Profile | None) -> Callable[[TableWorld], list[Component]]:
    """Return the function that returns the components of the profile's robot.

    Raises:
        UnknownNameError: the profile names an unknown robot.
    """
    name = "on_wheels" if profile is None or profile.robot is None else profile.robot
    if name not in ROBOTS:
        place = None if profile is None else profile.place(("robot",))
        raise UnknownNameError(f"there is no robot '{name}'", place=place, found=name, valid=ROBOTS)
    return ROBOTS[name]


@cache
def plots() -> tuple[ActionPlot, ...]:
    """Return the plots of this ready world; cached, because plots are immutable."""
    return tuple(load_library(HOME / "plots"))


@cache
def library() -> Library:
    """Return the library of the plots without a profile; cached, because runs share its derived tables."""
    return Library([*plots(), achieve_plot()])


@cache
def domain() -> PlanningDomain:
    """Return the planning domain of this ready world; cached."""
    return PlanningDomain.from_pddl(HOME / "domain.pddl")


def bundle() -> Bundle:
    """Return a bundle with the plots and the planning domain; the robot needs a base, an arm, a camera and a voice."""
    return Bundle(NAME, plots(), domain=domain(), about="clear a table: cups to the sink, cans to the bin")


class _SceneWriter:
    """A trace listener that writes a record `scene` after each event that changed the scene."""

    def __init__(self, world: TableWorld, sequencer: Sequencer) -> None:
        self._world = world
        self._trace = sequencer.trace
        self._drawn: list[dict[str, Any]] | None = None

    def __call__(self, record: Record) -> None:
        if record.type not in {"plot", "event"}:
            return
        scene = self._world.scene()
        if scene != self._drawn:
            self._drawn = scene
            self._trace.record("scene", things=scene)
