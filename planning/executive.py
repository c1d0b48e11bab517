"""The executive: a domain, plots, components, knowledge and a planner, wired and ready to run."""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable, Coroutine, Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Self

from pydantic import ValidationError

from dsc.components.component import Component
from dsc.components.robot import require_deployed, require_instances, require_wired
from dsc.dynamic.knowledge_situation import ACHIEVE
from dsc.dynamic.library import Library
from dsc.model.plot import ActionPlot
from dsc.model.states import Budget
from dsc.profiles import configure
from dsc.runs.kept import Kept
from dsc.runs.store import RunStore
from dsc.sequencer.clock import LoopClock, run_real, run_simulated
from dsc.sequencer.sequencer import RunEnd, Sequencer
from dsc.skills import signatures
from dsc.text.plot_files import parse_plot
from dsc.trace import Listener, Trace
from knowledge_base.errors import InputError, SchemaError, StoreError
from knowledge_base.journal.file import Durability, located
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema_compatibility import require_extension
from planning.bundles import Bundle, components_of, domain_of, gathered, plots_of, shipped_by
from planning.domain import PlanningDomain
from planning.engines.planner import Planner, PlannerProcess
from planning.engines.race import CachingPlanner, PlannerRace
from planning.execution.planning_component import PlanningComponent
from planning.execution.search import Foresight
from planning.problem.construction import check_goal
from planning.soundness import require_parts, require_sound

Prepare = Callable[[Sequencer], None]
"""A callback before a run starts, e.g. to post events or to keep a reference to the sequencer."""
_BUDGET = Budget()


class Executive:
    """A robot program, ready to run.

    Args:
        domain: the planning domain, or its PDDL file. Components may add fragments; the knowledge base's schema
            declares the merged domain.
        plots: the plots; those with `implements` execute planning actions. Executives may share a `Library` and its
            caches. The plot `achieve` is added if the library has none.
        components: the components with the skills.
        knowledge: the world model, whose schema plots may query; by default an empty one of the domain's schema.
        planner: finds plans. The default is pyperplan in simulated time, so that a run is repeatable. In real time it
            is a race of the engines that suit a problem.
        parallel: execute independent steps of a plan concurrently.
        foresight: simulates plans before they are executed.
        store: a file for knowledge and runs, so that a run can be resumed after a crash. It is created if missing, and
            provides the knowledge.
        durability: with a store, "process" survives the death of the process, "power" also a power cut.

    Raises:
        PlotError: a plot does not pass the validator; the error has all findings.
        InputError: a domain file is wrong, two fragments contradict each other, or two plots have one name. A
            component's parameter has no value, or a relation between parameters does not hold. Both knowledge
            and a store are given.
        SchemaMismatchError: the schema of `knowledge` lacks declarations of the domain.
        StoreError: the store cannot be opened, or another process writes it.
    """

    def __init__(
        self,
        domain: PlanningDomain | Path | str,
        plots: Iterable[ActionPlot],
        components: Iterable[Component],
        knowledge: KnowledgeBase | None = None,
        planner: Planner | None = None,
        *,
        parallel: bool = True,
        foresight: Foresight | None = None,
        store: Path | str | None = None,
        durability: Durability = "process",
    ) -> None:
        require_parts(knowledge, planner, foresight, store)
        self.components = require_instances(components)
        configure(self.components)
        require_deployed(self.components, [PlanningComponent.name])
        require_wired(self.components)
        self.domain = PlanningDomain.from_fragments([domain, *shipped_by(self.components)])
        if any(component.name == PlanningComponent.name for component in self.components):
            raise SchemaError(f"two components are named '{PlanningComponent.name}'", found=PlanningComponent.name)
        if knowledge is not None and store is not None:
            raise InputError("a store provides the knowledge: give a store or knowledge, not both")
        if knowledge is not None:
            require_extension(self.domain.schema, knowledge.schema)
        self._store = None if store is None else located(store)
        self.library = plots if isinstance(plots, Library) else Library(plots)
        if ACHIEVE not in self.library:
            self.library.add(achieve_plot())
        self._own_planners: dict[bool, CachingPlanner] = {}
        self._planner = planner
        self._parallel = parallel
        self._foresight = foresight
        self._listeners: list[Listener] = []
        skills = [s for c in self.components for s in c.skills().values()]
        skills += signatures(PlanningComponent, PlanningComponent.name).values()
        declared = {PlanningComponent.name: PlanningComponent.declares, **{c.name: c.declares for c in self.components}}
        schema = self.domain.schema if knowledge is None else knowledge.schema
        require_sound(self.library, self.domain, schema, skills, declared)
        if knowledge is not None:
            self.knowledge = knowledge
        else:  # last, since an opened knowledge base must be closed
            kept = None if store is None else durability
            self.knowledge = KnowledgeBase.open(self.domain.schema, self._store, kept)

    @classmethod
    def of_bundles(
        cls,
        bundles: Iterable[Bundle | str],
        plots: Iterable[ActionPlot] = (),
        components: Iterable[Component] = (),
        **how: Any,
    ) -> Self:
        """Return a robot program made of bundles, the bundles that these need, and further plots and components.

        Args:
            bundles: each a `Bundle`, or the name of an installed one.
            plots: plots that the bundles lack.
            components: components that the bundles lack.
            how: the other arguments of an `Executive`, by name (`knowledge`, `planner`, `store`, ...).

        Raises:
            UnknownNameError: a bundle is missing.
            InputError: two bundles contradict each other; and as for an `Executive`.
        """
        found = gathered(bundles)
        return cls(domain_of(found), [*plots_of(found), *plots], [*components_of(found), *components], **how)

    def listen(self, listener: Listener) -> None:
        """Call `listener` with every record of every run from now on."""
        self._listeners.append(listener)

    def run(
        self,
        plot: str,
        arguments: Mapping[str, Any] | None = None,
        *,
        simulated: bool = True,
        open_ended: bool = False,
        prepare: Prepare | None = None,
        header: Mapping[str, Any] | None = None,
    ) -> RunEnd:
        """Run a plot to its end.

        Args:
            plot: the plot's name.
            arguments: values for its parameters.
            simulated: time jumps from event to event; otherwise it is real time.
            open_ended: events may still come from outside (an operator, a user interface) when the run is idle.
                Otherwise an idle run ends and reports that.
            prepare: see `Prepare`.
            header: plain data to keep with the run in the store.

        Raises:
            InputError: the plot is unknown, or a parameter is missing or unknown.
            StoreError: the store cannot be written, or has an unfinished run.
        """
        runner = run_simulated if simulated else run_real
        return runner(self.execute(plot, arguments, open_ended=open_ended, prepare=prepare, header=header))

    async def execute(
        self,
        plot: str,
        arguments: Mapping[str, Any] | None = None,
        *,
        open_ended: bool = False,
        prepare: Prepare | None = None,
        header: Mapping[str, Any] | None = None,
    ) -> RunEnd:
        """Run a plot inside an existing asyncio loop, e.g. with remote components.

        The loop determines the time: real, or simulated by `run_simulated`. For the arguments see `run`.
        """
        clock = LoopClock()
        store = self._run_store({**(header or {}), "simulated": clock.simulated, "open_ended": open_ended})
        sequencer, planning = self._wired(clock, 0, store, open_ended=open_ended)
        if prepare is not None:
            prepare(sequencer)
        return await _to_its_end(sequencer.run(plot, arguments), planning, clock)

    def resume(self, *, prepare: Prepare | None = None) -> RunEnd:
        """Resume the store's unfinished run where it was interrupted, and run it to its end.

        Listeners get its records from the beginning. `prepare` is called again. Scheduled input that is still pending
        is kept and need not be posted again.

        Raises:
            StoreError: there is no store or no unfinished run in it, or it cannot be read or written.
            ChangedError: plots or domain differ from those at the run's start; the error lists the differences.
        """
        store, kept = self._taken_up()
        going_on = self._go_on(store, kept, prepare)
        return run_simulated(going_on, kept.time) if kept.run.header["simulated"] else run_real(going_on)

    async def go_on(self, *, prepare: Prepare | None = None) -> RunEnd:
        """Resume the unfinished run inside an existing asyncio loop with the run's kind of time; see `resume`.

        Raises:
            InputError: the run began in real time and this loop's is simulated, or the other way round.
        """
        store, kept = self._taken_up()
        simulated = LoopClock().simulated
        if simulated != kept.run.header["simulated"]:
            was, now = ("real", "simulated") if simulated else ("simulated", "real")
            raise InputError(f"the run was begun in {was} time and cannot be resumed in {now} time")
        return await self._go_on(store, kept, prepare)

    def achieve(
        self,
        goal: str,
        *,
        seconds: float = _BUDGET.seconds,
        replans: int = _BUDGET.replans,
        simulated: bool = True,
        open_ended: bool = False,
        prepare: Prepare | None = None,
    ) -> RunEnd:
        """Plan for a goal, execute the plan, and plan again when the world changes against it.

        The end is `finished` when the attempt ends, and states whether the goal was `reached`. If not, it `emitted`
        `no_plan` or `gave_up`, with the reason.

        Args:
            goal: a condition.
            seconds: real time for each search.
            replans: number of plans after the first one.
            simulated: as for `run`.
            open_ended: as for `run`.
            prepare: as for `run`.

        Raises:
            InputError: the goal is not a condition, or names something undeclared or unknown; or a limit is out of
                range.
        """
        check_goal(parse_condition(goal), self.knowledge)
        budget = _budget(seconds, replans)
        arguments = {"goal": goal, "holder": "", "replans": budget.replans, "seconds": budget.seconds}
        return self.run(ACHIEVE, arguments, simulated=simulated, open_ended=open_ended, prepare=prepare)

    def _taken_up(self) -> tuple[RunStore, Kept]:
        store = self._run_store({})
        if store is None:
            raise StoreError("only a run with a store can be resumed")
        return store, store.take_up(self.library)

    async def _go_on(self, store: RunStore, kept: Kept, prepare: Prepare | None) -> RunEnd:
        for record in kept.records:
            for listener in self._listeners:
                listener(record)
        clock = LoopClock(kept.time)
        open_ended = bool(kept.run.header["open_ended"])
        sequencer, planning = self._wired(clock, kept.last_record, store, open_ended=open_ended)
        if prepare is not None:
            prepare(sequencer)
        return await _to_its_end(sequencer.resume(kept), planning, clock)

    def _wired(
        self, clock: LoopClock, last: int, store: RunStore | None, *, open_ended: bool
    ) -> tuple[Sequencer, PlanningComponent]:
        trace = Trace(clock.now, last)
        for listener in self._listeners:
            trace.listen(listener)
        components: list[Component] = list(self.components)
        sequencer = Sequencer(
            self.library, self.knowledge, components, clock, trace, open_ended=open_ended, store=store
        )
        planning = PlanningComponent(
            self.domain, self.library, self.knowledge, self._planner_for(clock), clock, trace,
            working_for=sequencer.working_for, parallel=self._parallel,
            shared=[component.name for component in components if component.concurrent],
            foresight=self._foresight,
        )  # fmt: skip
        sequencer.listen(planning.note_choices)
        sequencer.dispatcher.deploy(planning)
        return sequencer, planning

    def _run_store(self, header: Mapping[str, Any]) -> RunStore | None:
        if self._store is None:
            return None
        return RunStore(self.knowledge, self._store, header, self.domain.statements())

    def close(self) -> None:
        """Close the store, and end the processes of the default planners."""
        if self._store is not None:
            self.knowledge.close()
        for planner in self._own_planners.values():
            planner.kill()

    def _planner_for(self, clock: LoopClock) -> Planner:
        if self._planner is not None:
            return self._planner
        if clock.simulated not in self._own_planners:
            planner = PlannerProcess() if clock.simulated else PlannerRace()
            self._own_planners[clock.simulated] = CachingPlanner(planner)
        return self._own_planners[clock.simulated]

    def __enter__(self) -> Self:
        """Return the executive; `close` runs at the end of the block."""
        return self

    def __exit__(self, *_: object) -> None:
        """Call `close`."""
        self.close()


async def _to_its_end(running: Coroutine[Any, Any, RunEnd], planning: PlanningComponent, clock: LoopClock) -> RunEnd:
    with nullcontext() if clock.simulated else settled():
        try:
            return await running
        finally:
            await planning.over()


@cache
def achieve_plot() -> ActionPlot:
    """Return the plot for goals without a designed candidate, cached, since plots are immutable."""
    resource = files("planning") / "plots" / "achieve.yaml"
    return parse_plot(resource.read_text(encoding="utf-8"), str(resource))


def _budget(seconds: float, replans: int) -> Budget:
    try:
        return Budget(seconds=seconds, replans=replans)
    except ValidationError as error:
        first = error.errors()[0]
        wrong = f"'{first['loc'][0]}' is {first['input']!r}: {first['msg']}"
        raise InputError(wrong, found=str(first["input"])) from None


_YOUNG = 10_000
"""Allocations between collections of the youngest generation, as a minimum.

The interpreter's default of 700 suits programs with few allocations. One new plan makes twice this number of objects,
most of them short-lived.
"""

_lock = threading.Lock()
_thresholds: list[tuple[int, int, int]] = []
"""The collector's thresholds before each run in progress."""


@contextmanager
def settled() -> Iterator[None]:
    """Freeze the existing objects until the end of this run, and of others at the same time.

    A collection of all objects takes a tenth of a second. New objects are collected less often too.
    """
    with _lock:
        gc.freeze()
        before = gc.get_threshold()
        _thresholds.append(before)
        if before[0]:  # else it is switched off
            gc.set_threshold(max(before[0], _YOUNG), *before[1:])
    try:
        yield
    finally:
        with _lock:
            gc.set_threshold(*_thresholds.pop())
            if not _thresholds:
                gc.unfreeze()
