"""The clean-up-table robot, wired: simulated world, skills, knowledge, plots, planner."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Self

from domains.clean_up_table.components import Arm, Base, Camera, Voice, initial_knowledge
from domains.clean_up_table.durable_world import DurableWorld, beside, require_free
from domains.clean_up_table.physics import Physics
from domains.clean_up_table.report import Report, summarise
from domains.clean_up_table.scenario import Scenario
from domains.clean_up_table.second_robot import PatientCamera, SuctionArm, Tracks
from domains.clean_up_table.table_world import TableWorld
from domains.tally import Tally
from dsc.components.component import Component
from dsc.dynamic.library import Library
from dsc.model.plot import ActionPlot
from dsc.model.profile import Profile
from dsc.profiles import adapted, configure
from dsc.runs.archive import archive, has_run, unfinished
from dsc.sequencer.sequencer import RunEnd, Sequencer
from dsc.text.plot_files import load_library
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
    """A table to be cleared, with everything that is needed to clear it.

    Attributes:
        world: the simulated truth.
        executive: the robot program over it.
        tally: counts what happens.
        resumes: whether there is a run to go on with.
        profile: what the robot was made after; `None` is the usual one.
    """

    world: TableWorld
    executive: Executive
    tally: Tally = field(default_factory=Tally)
    resumes: bool = False
    profile: Profile | None = None

    def __enter__(self) -> Self:
        """Itself; `close` at the end."""
        return self

    def __exit__(self, *_: object) -> None:
        """`close`."""
        self.close()

    def close(self) -> None:
        """End the planner's process, if there is one of its own, and give back the files."""
        self.executive.close()
        if isinstance(self.world, DurableWorld):
            self.world.close()

    def run(self, *, simulated: bool = True, prepare: Callable[[Sequencer], None] | None = None) -> Report:
        """Clear the table and report; the report says so if the operator ends the run (Ctrl-C).

        Args:
            simulated: whether time jumps from event to event; a run that is resumed goes on as it began.
            prepare: called with the sequencer before the run starts.

        Raises:
            StoreError: the store cannot be read or written.
            ChangedError: a run is to be resumed with other plots, or another domain.
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
        """The header, and what a robot is made after, for who resumes the run."""
        settings = {} if self.profile is None else {"settings": self.profile.model_dump(by_alias=True)}
        return {**self.header(), **settings}

    def header(self) -> dict[str, Any]:
        """What determines a run, for the first line of its trace."""
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
    """Wire everything for one run; close it when done.

    Args:
        scenario: what stands on the table; the default one if left out.
        seed: which faults happen; the scenario's own if left out.
        faults: chance of a fault per skill call in [0, 1]; the scenario's own if left out.
        planner: finds plans; pyperplan in a process of its own if left out.
        listener: is told every record of the run.
        store: a file to keep the run in, with the world beside it; one that has no run yet.
        durability: what the run outlives, see `Executive`.
        profile: which of `ROBOTS` does it, and what its parameters are worth; the one on wheels if left out.

    Raises:
        InputError: the scenario or the profile is wrong, or the store has a run already.
        StoreError: the store cannot be opened, or the world not be written.
    """
    world = (scenario or Scenario.default()).world(seed, faults)
    if store is None:
        return _wired(world, planner, listener, profile)
    if has_run(store):
        raise InputError(f"'{store}' has a run already; go on with it by --resume, or take another file")
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
    """Wire everything to go on with the run in a store; arguments as for `deploy`.

    Raises:
        StoreError: the store or its world is not there, or cannot be read; or the run in it is another program's.
    """
    with archive(store) as runs:
        run = unfinished(runs)
    if run.header.get("run") != NAME:
        whose = f"the run of '{run.plot}' in this store is another program's, which goes on with it: Executive.resume()"
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
    executive.knowledge.apply(initial_knowledge(world), "deployment", key="deployment")
    deployed = CleanUpTable(world, executive, profile=profile)
    executive.listen(deployed.tally)
    if listener is not None:
        executive.listen(listener)
    return deployed


def on_wheels(world: TableWorld) -> list[Component]:
    """A base on wheels, an arm with a hand."""
    return [Base(world), Arm(world), Camera(world), Voice(world)]


def on_tracks(world: TableWorld) -> list[Component]:
    """A base on tracks, an arm that holds by suction; see `second_robot`."""
    return [Tracks(world), SuctionArm(world), PatientCamera(world), Voice(world)]


ROBOTS = {"on_wheels": on_wheels, "on_tracks": on_tracks}
"""The robots that can do it, by the names that profiles have for them."""
PROFILES = HOME / "profiles"


def robot(profile: Profile | None) -> Callable[[TableWorld], list[Component]]:
    """What makes the components of the robot that a profile names; raises `UnknownNameError`."""
    name = "on_wheels" if profile is None or profile.robot is None else profile.robot
    if name not in ROBOTS:
        place = None if profile is None else profile.place("robot")
        raise UnknownNameError(f"there is no robot '{name}'", place=place, found=name, valid=ROBOTS)
    return ROBOTS[name]


@cache
def plots() -> tuple[ActionPlot, ...]:
    """The plots of this domain; read once, since plots never change."""
    return tuple(load_library(HOME / "plots"))


@cache
def library() -> Library:
    """The plots as no profile changes them; what is worked out for one run serves the next."""
    return Library([*plots(), achieve_plot()])


@cache
def domain() -> PlanningDomain:
    """The planning domain; read once, too."""
    return PlanningDomain.from_pddl(HOME / "domain.pddl")


def bundle() -> Bundle:
    """The task for others to build upon: plots and planning domain, for a base, an arm, a camera and a voice."""
    return Bundle(NAME, plots(), domain=domain(), about="clear a table: cups to the sink, cans to the bin")


class _SceneWriter:
    """Writes a `scene` record whenever a component's answer has changed what there is to draw."""

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
