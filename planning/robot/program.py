"""The program of a robot: domain, plots, components, knowledge and planner, checked and wired for each run."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Self, get_args
from zlib import crc32

from dsc.components.assembly import require_deployed, require_instances
from dsc.components.component import Component
from dsc.components.wiring import choose_sources, require_wired
from dsc.conversions import Conversion
from dsc.dynamic.experience import NO_EXPERIENCE, Experience
from dsc.dynamic.library import Library
from dsc.events import SKILL_FAILURES
from dsc.model.plot import ActionPlot
from dsc.monitoring.profile import MonitoringProfile
from dsc.profiles import configure
from dsc.rank import ORDINARY, Rank
from dsc.runs.pruning import prune
from dsc.runs.store import RunStore
from dsc.sequencer.clock import ClockKind, LoopClock
from dsc.sequencer.dispatcher import Dispatcher
from dsc.sequencer.sequencer import Sequencer
from dsc.supervision.room import Room
from dsc.text.profiles import Profile, adapted
from dsc.trace import Listener, Trace
from knowledge_base.errors import InputError, SchemaError, StoreError
from knowledge_base.journal.file import Durability, located
from knowledge_base.store import KnowledgeBase
from knowledge_base.user_objects import shown
from knowledge_base.world.schema_compatibility import require_extension
from planning.engines.planner import Planner
from planning.engines.race import CachingPlanner, PlannerRace
from planning.engines.registry import repeatable
from planning.execution.foresight import Foresight, require_foresight
from planning.execution.goal_skills import planner_services
from planning.execution.goals import GoalQueue
from planning.execution.planning_component import PlanningComponent
from planning.execution.shipped_plots import shipped_plots
from planning.model.domain import PlanningDomain
from planning.robot.bundles import (
    Bundle,
    components_of,
    conversions_of,
    domain_of,
    gathered,
    plots_of,
    resources_of,
    shipped_by,
    wiring_of,
    with_plots_of,
)
from planning.robot.observations import require_observable
from planning.robot.run import Run
from planning.robot.simulation import Simulation
from planning.robot.soundness import RUN_COMPONENTS, interfaces, require_parts, require_sound, run_skills
from planning.robot.task import Task


@dataclass(frozen=True, slots=True)
class Origin:
    """Origin of a robot: the bundle that was deployed.

    Attributes:
        bundle: the bundle.
        task: the task of the robot's reports.
        simulation: the simulated world; `None` without a simulation.
        profile: the settings profile; `None` without a profile.
        kept: plain data that the store keeps with a run.
        resumes: whether the robot resumes the run in its store.
    """

    bundle: Bundle
    task: Task
    simulation: Simulation | None = None
    profile: Profile | None = None
    kept: Mapping[str, Any] = field(default_factory=dict)
    resumes: bool = False


class RobotProgram:
    """The parts of a robot, checked together; for the arguments see `Robot`."""

    def __init__(
        self,
        domain: PlanningDomain | Path | str,
        plots: Iterable[ActionPlot],
        components: Iterable[Component],
        knowledge: KnowledgeBase | None = None,
        planner: Planner | None = None,
        *,
        clock: ClockKind | None = None,
        parallel: bool = True,
        foresight: Foresight | None = None,
        store: Path | str | None = None,
        durability: Durability = "process",
        failures: Collection[str] = (),
        origin: Origin | None = None,
        conversions: Iterable[Conversion[..., Any]] = (),
        wiring: Mapping[str, str] | None = None,
        resources: Mapping[str, float] | None = None,
        experience: Experience | None = None,
    ) -> None:
        require_parts(knowledge, planner, store)
        self.components = require_instances(components)
        configure(self.components)
        choose_sources(self.components, wiring or {})
        require_deployed(self.components, [PlanningComponent.name])
        require_wired([*self.components, planner_services()])
        self.room = None if resources is None else Room(resources)
        if self.room is not None:
            self.room.require(self.components)
        self.domain = PlanningDomain.from_fragments([domain, *shipped_by(self.components)])
        for kind in RUN_COMPONENTS:
            if any(component.name == kind.name for component in self.components):
                raise SchemaError(f"two components are named '{kind.name}'; each run has one", found=kind.name)
        if knowledge is not None and store is not None:
            raise InputError("a store provides the knowledge: give a store or knowledge, not both")
        if knowledge is not None:
            require_extension(self.domain.schema, knowledge.schema)
        self.store = None if store is None else located(store)
        self.library = plots if isinstance(plots, Library) else Library(plots, conversions)
        for plot in shipped_plots():
            if plot.name not in self.library:
                self.library.add(plot)
        self.library = with_plots_of(self.library, self.components)
        self.experience = experience or NO_EXPERIENCE
        if clock not in (None, *get_args(ClockKind)):
            message = f"the clock of a robot is real or simulated, not {shown(clock)}"
            raise InputError(message, found=str(clock), valid=get_args(ClockKind))
        self.clock = clock
        self._own_planners: dict[bool, CachingPlanner] = {}
        self._planner = planner
        self._parallel = parallel
        self._foresight = foresight
        self._failures = failures
        self._listeners: list[Listener] = []
        self._monitored: list[MonitoringProfile] = []
        self._runs: dict[Run[Any], None] = {}
        self._started = 0
        self._closed = False
        self.origin = origin
        self._schema = self.domain.schema if knowledge is None else knowledge.schema
        require_foresight(foresight, self._schema)
        self._require_sound(self.library)
        self._checked = self.library.plots
        if knowledge is not None:
            self.knowledge = knowledge
        else:  # last, since the caller must close an opened knowledge base
            kept = None if store is None else durability
            self.knowledge = KnowledgeBase.open(self.domain.schema, self.store, kept)

    @classmethod
    def of_bundles(
        cls,
        bundles: Iterable[Bundle | str],
        plots: Iterable[ActionPlot] = (),
        components: Iterable[Component] = (),
        *,
        profile: Profile | None = None,
        **how: Any,
    ) -> Self:
        """Return a robot for bundles, the bundles that they need, and further plots and components.

        Args:
            bundles: each a `Bundle`, or the name of an installed bundle.
            plots: further plots.
            components: further components.
            profile: the settings of components and plots, and the wiring.
            how: the keyword arguments of `Robot` (`knowledge`, `planner`, `store`, ...).

        Raises:
            UnknownNameError: a bundle is missing.
            InputError: two bundles contradict each other, or `Robot` raises the error.
        """
        found = gathered(bundles)
        how.setdefault("failures", frozenset[str]().union(*(bundle.failures for bundle in found)))
        how.setdefault("conversions", conversions_of(found))
        how.setdefault("resources", resources_of(found))
        how["wiring"] = {**wiring_of(found), **(how.get("wiring") or {})}
        known = adapted([*plots_of(found), *plots], profile)
        parts = [*components_of(found), *components]
        if profile is not None:
            configure(parts, profile)
            how["wiring"] |= profile.wiring
        return cls(domain_of(found), known, parts, **how)

    def _require_sound(self, library: Library, added: Collection[Component] = ()) -> None:
        """Raise `PlotError` if plots do not fit each other, the domain, or the components of the robot and its run."""
        components = [*self.components, *added]
        skills = [one for component in components for one in component.skills().values()]
        skills += run_skills()
        require_sound(library, self.domain, self._schema, skills, interfaces(components))

    def _check_added_plots(self) -> None:
        """Raise `PlotError` if plots that were added since the last check are invalid; plans are valid as made."""
        before, now = self._checked, self.library.plots
        if now is not before:
            if any(before.get(name) is not plot and not plot.generated for name, plot in now.items()):
                self._require_sound(self.library)
            self._checked = now

    @property
    def name(self) -> str:
        """The name of the bundle; `robot` without a bundle."""
        return "robot" if self.origin is None else self.origin.bundle.name

    @property
    def failures(self) -> frozenset[str]:
        """The outcomes that report failures: `failure_events` of the plots, and the argument `failures`."""
        return failure_events(self.library).union(self._failures)

    @property
    def simulation(self) -> Simulation | None:
        """The simulated world; `None` without a simulation."""
        return None if self.origin is None else self.origin.simulation

    @cached_property
    def goals(self) -> GoalQueue:
        """The queue that `Robot.serve` or the plot `serve_goals` serves; with a store, the store keeps it."""
        return GoalQueue(self.knowledge, kept=self.store is not None)

    def header(self) -> dict[str, Any]:
        """Return the inputs that determine a run, for the first line of the trace."""
        plots = "".join(sorted(plot.digest for plot in self.library))
        domain = "\n".join(f"{name}\n{text}" for name, text in sorted(self._statements().items()))
        origin, world = self.origin, self.simulation
        return {
            **({} if origin is None else {"run": origin.bundle.name}),
            **({} if world is None else {"seed": world.seed, "faults": world.chance}),
            **({} if origin is None or origin.profile is None else {"profile": origin.profile.digest}),
            **({"experience": self.experience.digest} if self.experience.tries else {}),
            "chart": hashlib.sha256(plots.encode()).hexdigest()[:12],
            "domain": hashlib.sha256(domain.encode()).hexdigest()[:12],
        }

    def listen(self, listener: Listener) -> Callable[[], None]:
        """Call `listener` with every later record of all runs; return a function that ends this."""
        if not callable(listener):
            raise InputError(f"a listener is a function of a record, not {shown(listener)}")
        self._listeners.append(listener)
        for run in self._runs:
            run.listen(listener)
        return partial(self._ignore, listener)

    def monitor(self, profile: MonitoringProfile) -> None:
        """Record the observations of a monitoring profile in every later run, as records `observation`.

        Raises:
            UnknownNameError: a component or a push port of the profile does not exist.
        """
        require_observable(profile, {one.name: one for one in self.components})
        self._monitored.append(profile)

    def _ignore(self, listener: Listener) -> None:
        if listener in self._listeners:
            self._listeners.remove(listener)
        for run in self._runs:
            run.ignore(listener)

    def wire(
        self, run: str, clock: LoopClock, last: int, store: RunStore | None, *, open_ended: bool, until: float | None
    ) -> tuple[Sequencer, PlanningComponent]:
        """Return a sequencer for the run of that id, with its planning component; `last` is the last kept record."""
        self._check_added_plots()
        trace = Trace(clock.now, last)
        for listener in self._listeners:
            trace.listen(listener)
        components: list[Component] = list(self.components)
        sequencer = Sequencer(
            self.library, self.knowledge, components, clock, trace, open_ended=open_ended, store=store,
            until=math.inf if until is None else until, failures=self.failures, run_id=run,
        )  # fmt: skip
        seed = 0 if self.simulation is None else self.simulation.seed
        sequencer.library.experience = replace(self.experience, seed=crc32(f"{seed} {run}".encode()))
        sequencer.check_plots = self._require_sound
        planning = PlanningComponent(
            self.domain, sequencer.library, self.knowledge, self.planner_for(clock), clock, trace,
            components=sequencer.dispatcher.components, working_for=sequencer.working_for,
            goals=lambda: self.goals, parallel=self._parallel,
            shared=[component.name for component in components if component.concurrent],
            foresight=self._foresight,
        )  # fmt: skip
        if self.room is not None:
            sequencer.dispatcher.activation.share(self.room, partial(_rank_of, sequencer.dispatcher))
        sequencer.listen(planning.note)
        sequencer.dispatcher.deploy(planning, last=True)
        return sequencer, planning

    def run_store(self, header: Mapping[str, Any]) -> RunStore | None:
        """Return the store of a run with these plain data, or `None` without a store."""
        if self.store is None:
            return None
        return RunStore(self.knowledge, self.store, header, self._statements())

    def _statements(self) -> dict[str, str]:
        """Return what a resumed run must find unchanged besides its plots: the domain and the conversions."""
        conversions = {f"conversion {name}": one.digest for name, one in self.library.conversions.items()}
        return {**self.domain.statements(), **conversions}

    def prune(self, keep: int) -> int:
        """Delete all but the latest `keep` runs of the store, also during a run; return the number of deleted runs.

        The versions of the knowledge before the first kept run are deleted, too, and the file becomes smaller.

        Raises:
            InputError: `keep` is not a positive integer.
            StoreError: there is no store, it has no runs, or it cannot be read or written.
        """
        if self.store is None:
            raise StoreError("only a robot with a store has kept runs to prune")
        return prune(self.knowledge, self.store, keep)

    def release(self) -> None:
        """Close the store and the simulated world, and terminate the processes of the default planners."""
        if self.store is not None:
            self.knowledge.close()
        if self.simulation is not None:
            self.simulation.close()
        for planner in self._own_planners.values():
            planner.kill()

    def planner_for(self, clock: LoopClock) -> Planner:
        """Return the planner for the kind of time of a clock."""
        if self._planner is not None:
            return self._planner
        if clock.simulated not in self._own_planners:
            planner = PlannerRace(choose=repeatable) if clock.simulated else PlannerRace()
            self._own_planners[clock.simulated] = CachingPlanner(planner)
        return self._own_planners[clock.simulated]


def failure_events(library: Library) -> frozenset[str]:
    """Return the failures of all skills, the outcomes of plots for planning actions, and the events of rules."""
    emitted = {event for plot in library if plot.implements for event in plot.emits}
    answered = {rule.on for plot in library for rule in plot.rules if rule.on is not None}
    return frozenset({*SKILL_FAILURES, *emitted, *answered})


def _rank_of(dispatcher: Dispatcher, component: str) -> Rank:
    """Return the largest rank of the running skills of a component."""
    return max((start.rank for start in dispatcher.started() if start.component == component), default=ORDINARY)
