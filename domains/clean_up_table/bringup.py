"""The clean-up-table robot as a bundle: simulated world, components, plots and planning domain."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from domains.clean_up_table.components import Arm, Base, Camera, PatientCamera, SuctionArm, Tracks, Voice
from domains.clean_up_table.durable_world import DurableWorld, beside, require_free
from domains.clean_up_table.observations import initial_knowledge
from domains.clean_up_table.physics import Physics
from domains.clean_up_table.report import reason_for
from domains.clean_up_table.scenario import Scenario
from domains.clean_up_table.table_world import TableWorld
from domains.clean_up_table.world_faults import NOTHING_FOUND
from dsc.components.component import Component
from dsc.sequencer.run_end import RunEnd
from dsc.text.profiles import Profile
from dsc.trace import Listener
from knowledge_base.facts import Delta
from knowledge_base.journal.file import Durability
from knowledge_base.store import KnowledgeBase
from planning.engines.planner import Planner
from planning.robot.bringup import deploy as deploy_bundle
from planning.robot.bundles import Bundle
from planning.robot.robot import Robot
from planning.robot.simulation import Fault, Left, Setup, Simulation

HOME = Path(str(files("domains.clean_up_table")))
NAME = "clean-up-table"
MAIN_PLOT = "clean_up_table"


class TableSimulation(Simulation):
    """The simulated table, and the robot on wheels, with an arm and a hand, that clears the table.

    Attributes:
        world: the simulated world, with its true state.
    """

    reads_scenarios = True
    scenario_form = Scenario
    lasts = True

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.world = _world(setup)
        self.seed, self.chance = self.world.faults.seed, self.world.faults.chance

    def begin(self) -> None:
        """Write the world to its file next to the store."""
        if isinstance(self.world, DurableWorld) and self.setup.store is not None:
            self.world.create(beside(self.setup.store))

    def components(self) -> Iterable[Component]:
        """Return the components of the robot."""
        return [Base(self.world), Arm(self.world), Camera(self.world), Voice(self.world)]

    def knowledge(self) -> Delta:
        """Return the places, and the place of the robot."""
        return initial_knowledge(self.world.robot_at)

    def left(self) -> list[Left]:
        """Return every item that was ever on the table, seen or not, and is not in its destination."""
        return [Left(one.item, one.where) for one in self.world.left()]

    def reason(self, left: Left, knowledge: KnowledgeBase, end: RunEnd) -> str:
        """Return the reason from the robot's knowledge."""
        return reason_for(left.what, knowledge, end)

    def scene(self) -> list[dict[str, Any]]:
        """Return the places, the robot and the items."""
        return self.world.scene()

    def own_report(self, knowledge: KnowledgeBase, end: RunEnd) -> Mapping[str, Any]:
        """Return the items, trips and faults; `touched` lists items that a permanent fault keeps from the goal."""
        self.fired = [Fault(one.kind, one.action_id) for one in self.world.fired]
        left = [
            {"item": one.what, "where": one.where, "reason": self.reason(one, knowledge, end)} for one in self.left()
        ]
        faults = [{"kind": one.kind, "permanent": one.permanent, "items": list(one.items)} for one in self.world.fired]
        return {
            "items": sum(1 for item in self.world.items if item.on_table),
            "left": left,
            "trips": self.world.trips,
            "faults": faults,
            "touched": sorted(self.world.touched()),
        }

    def headline(self, own: Mapping[str, Any], *, reached: bool) -> str:
        """Return the number of cleared items and of trips."""
        what = "The table is clear" if reached else "Not everything could be cleared"
        return f"{what}: {own['items'] - len(own['left'])} of {own['items']} items away in {own['trips']} trips"

    def close(self) -> None:
        """Close the file of the world."""
        if isinstance(self.world, DurableWorld):
            self.world.close()


class TableOnTracks(TableSimulation):
    """The simulated table with the robot on tracks, which has a suction arm."""

    def components(self) -> Iterable[Component]:
        """Return the components of the robot."""
        return [Tracks(self.world), SuctionArm(self.world), PatientCamera(self.world), Voice(self.world)]


def _world(setup: Setup) -> TableWorld:
    if setup.resumes and setup.store is not None:
        return DurableWorld.open(beside(setup.store))
    given = setup.scenario
    scenario = (
        given if isinstance(given, Scenario) else Scenario.default() if given is None else Scenario.load(str(given))
    )
    world = scenario.world(setup.seed, setup.faults)
    if setup.store is None:
        return world
    require_free(beside(setup.store))
    return DurableWorld.from_state(world.state())


@cache
def bundle() -> Bundle:
    """Return the robot as a bundle; cached, because runs share its plots, domain and derived tables."""
    return Bundle.in_folder(
        HOME,
        name=NAME,
        about="clear a table: cups to the sink, cans to the bin",
        main=MAIN_PLOT,
        simulation=TableSimulation,
        robots={"on_wheels": TableSimulation, "on_tracks": TableOnTracks},
        foresight=Physics(),
        failures=frozenset({NOTHING_FOUND}),
    )


def deploy(
    scenario: Scenario | None = None,
    seed: int | None = None,
    faults: float | None = None,
    planner: Planner | None = None,
    listener: Listener | None = None,
    store: Path | None = None,
    durability: Durability = "process",
    profile: Profile | None = None,
) -> Robot:
    """Deploy the robot and the simulated table for one run; the caller must close the result.

    Args:
        scenario: the items on the table; by default `Scenario.default`.
        seed: the seed of the faults; by default the seed of the scenario.
        faults: the chance of a fault per skill call, in [0, 1]; by default the chance of the scenario.
        planner: see `planning.deploy`, like all further arguments.
        listener: called with every record of the run.
        store: a file without a run, which then keeps the run; a sidecar file keeps the world.
        durability: the events that the run survives.
        profile: the robot, by its name in the bundle, and the values of its parameters; by default the robot on wheels.

    Raises:
        InputError: the scenario or the profile contains an error, or the store already contains a run.
        StoreError: the store cannot be opened, or the world cannot be written.
    """
    return deploy_bundle(
        bundle(), scenario=scenario, seed=seed, faults=faults, planner=planner, listener=listener, store=store,
        durability=durability, profile=profile,
    )  # fmt: skip


def world_of(deployed: Robot) -> TableWorld:
    """Return the simulated world of this robot."""
    assert isinstance(deployed.simulation, TableSimulation)  # noqa: S101  a wrong argument is a bug of the caller
    return deployed.simulation.world
