"""The clean-up-table robot, wired: simulated world, skills, knowledge, plots, planner."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from domains.clean_up_table.foresight import Physics
from domains.clean_up_table.report import Report, summarise
from domains.clean_up_table.scenario import Scenario
from domains.clean_up_table.skills import Arm, Base, Camera, Voice, initial_knowledge
from domains.clean_up_table.world import World
from domains.tally import Tally
from dsc.model.plot import ActionPlot
from dsc.sequencer.sequencer import RunEnd, Sequencer
from dsc.text.plots import load_library
from dsc.trace import Listener, Record
from knowledge_base.store import KnowledgeBase
from planning.domain import PlanningDomain
from planning.engines.planner import Planner
from planning.executive import Executive

HOME = Path(str(files("domains.clean_up_table")))
MAIN_PLOT = "clean_up_table"


@dataclass(slots=True)
class CleanUpTable:
    """A table to be cleared, with everything that is needed to clear it.

    Attributes:
        world: the simulated truth.
        executive: the robot program over it.
        tally: counts what happens.
    """

    world: World
    executive: Executive
    tally: Tally = field(default_factory=Tally)

    def run(self, *, simulated: bool = True, prepare: Callable[[Sequencer], None] | None = None) -> Report:
        """Clear the table and report; the report says so if the operator ends the run (Ctrl-C).

        Args:
            simulated: whether time jumps from event to event.
            prepare: called with the sequencer before the run starts.
        """
        started = time.perf_counter()
        try:
            end = self.executive.run(
                MAIN_PLOT, simulated=simulated, prepare=lambda sequencer: self._prepare(sequencer, prepare)
            )
        except KeyboardInterrupt:
            end = RunEnd(finished=False, problem="the operator ended the run")
        return summarise(self.world, self.executive.knowledge, self.tally, end, time.perf_counter() - started)

    def _prepare(self, sequencer: Sequencer, more: Callable[[Sequencer], None] | None) -> None:
        sequencer.trace.listen(_SceneWriter(self.world, sequencer))
        if more is not None:
            more(sequencer)

    def header(self) -> dict[str, Any]:
        """What determines a run, for the first line of its trace."""
        plots = "".join(sorted(plot.digest for plot in self.executive.library))
        return {
            "run": "clean-up-table",
            "seed": self.world.faults.seed,
            "faults": self.world.faults.chance,
            "chart": hashlib.sha256(plots.encode()).hexdigest()[:12],
            "domain": hashlib.sha256((HOME / "domain.pddl").read_bytes()).hexdigest()[:12],
        }


def deploy(
    scenario: Scenario | None = None,
    seed: int | None = None,
    faults: float | None = None,
    planner: Planner | None = None,
    listener: Listener | None = None,
) -> CleanUpTable:
    """Wire everything for one run; close `executive` when done.

    Args:
        scenario: what stands on the table; the default one if left out.
        seed: which faults happen; the scenario's own if left out.
        faults: chance of a fault per skill call in [0, 1]; the scenario's own if left out.
        planner: finds plans; pyperplan in a process of its own if left out.
        listener: is told every record of the run.

    Raises:
        InputError: the scenario is wrong.
    """
    world = (scenario or Scenario.default()).world(seed, faults)
    domain = PlanningDomain.from_pddl(HOME / "domain.pddl")
    knowledge = KnowledgeBase(domain.schema)
    knowledge.apply(initial_knowledge(world), "deployment")

    def believed(surface: str) -> list[str]:
        lying = [str(found["item"]) for found in knowledge.query("(lies-at ?item ?at)", {"at": surface})]
        for item in lying:  # grows: what is in an item is where the item is
            lying += [str(found["inner"]) for found in knowledge.query("(inside ?inner ?item)", {"item": item})]
        return lying

    components = [Base(world), Arm(world), Camera(world, believed), Voice(world)]
    executive = Executive(domain, plots(), components, knowledge, planner, foresight=Physics())
    deployed = CleanUpTable(world, executive)
    executive.listen(deployed.tally)
    if listener is not None:
        executive.listen(listener)
    return deployed


@cache
def plots() -> tuple[ActionPlot, ...]:
    """The plots of this domain; read once, since plots never change."""
    return tuple(load_library(HOME / "plots"))


class _SceneWriter:
    """Writes a `scene` record whenever a component's answer has changed what there is to draw."""

    def __init__(self, world: World, sequencer: Sequencer) -> None:
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


