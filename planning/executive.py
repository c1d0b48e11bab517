"""Everything wired together: a domain, plots, skills, knowledge and a planner, ready to run."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Iterable, Mapping
from contextlib import nullcontext
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Self

from pydantic import ValidationError

from dsc.components.component import Component
from dsc.components.component_dependencies import require_deployed
from dsc.components.component_registry import require_instances
from dsc.components.streams import require_wired
from dsc.dynamic.candidate_selection import ACHIEVE
from dsc.dynamic.library import Library
from dsc.model.plot import ActionPlot
from dsc.model.states import Budget
from dsc.profiles import configure
from dsc.runs.encoding import Kept
from dsc.runs.store import RunStore
from dsc.sequencer.clock import LoopClock, run_real, run_simulated
from dsc.sequencer.sequencer import RunEnd, Sequencer
from dsc.skills import signatures
from dsc.text.plot_files import parse_plot
from dsc.trace import Listener, Trace
from knowledge_base.errors import InputError, SchemaError, StoreError
from knowledge_base.journal.file import Durability, located
from knowledge_base.language.parser import parse_condition
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema_compatibility import require_extension
from planning import entrance
from planning.bundles import Bundle, components_of, domain_of, gathered, plots_of
from planning.domain import PlanningDomain
from planning.engines.cache import CachingPlanner
from planning.engines.planner import Planner, PlannerProcess
from planning.engines.race import PlannerRace
from planning.execution.component import PlanningComponent
from planning.execution.foresight import Foresight
from planning.fragments import shipped_by
from planning.garbage_collection import settled
from planning.problem.construction import check_goal
from planning.soundness import require_sound

Prepare = Callable[[Sequencer], None]
"""Called before a run starts, e.g. to post events or to keep the sequencer at hand."""
_BUDGET = Budget()


class Executive:
    """A robot program that can be run.

    Args:
        domain: the planning domain, or the PDDL file it is in, which the components may add to; the knowledge
            base's schema declares all that these do.
        plots: the plots; those with `implements` carry out the domain's planning actions. A `Library` is taken as it
            is, so that executives can share what was worked out for it; `achieve` is added if it has none.
        components: the skills.
        knowledge: the world model; an empty one of the domain's schema if left out. Plots may ask for all that its
            schema declares.
        planner: finds plans; if left out, pyperplan in simulated time, so that a run can be repeated, and in real
            time the engines that suit a problem, in a race.
        parallel: whether steps of a plan that need not wait for each other are carried out side by side.
        foresight: tries out plans in a simulation before they are carried out.
        store: a file in which knowledge and runs are kept, so that a run can be resumed after a crash; it is made
            when it is not there. The knowledge is the file's then.
        durability: with a store, what it outlives: "process" the death of the process, "power" a power cut too.

    Raises:
        PlotError: a plot does not pass the validator; the error has all findings.
        InputError: a domain file is wrong, two fragments contradict each other, two plots have one name, a component's
            parameter has no value, a relation between them does not hold, or both knowledge and a store are given.
        SchemaMismatchError: the given world model does not know what the domain is about.
        StoreError: the store cannot be opened, or somebody else is writing it.
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
        entrance.require_parts(knowledge, planner, foresight, store)
        self.components = require_instances(components)
        configure(self.components)
        require_deployed(self.components, [PlanningComponent.name])
        require_wired(self.components)
        self.domain = PlanningDomain.from_fragments([domain, *shipped_by(self.components)])
        if any(component.name == PlanningComponent.name for component in self.components):
            raise SchemaError(f"two components are named '{PlanningComponent.name}'", found=PlanningComponent.name)
        if knowledge is not None and store is not None:
            raise InputError("with a store the knowledge is the store's; none can be given beside it")
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
        else:  # at last, since what is opened has to be closed
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
        """A robot program put together of bundles, with all that these need, and plots and components of its own.

        Args:
            bundles: each a `Bundle`, or the name of an installed one.
            plots: what the bundles lack.
            components: what the bundles lack.
            how: the other arguments of an `Executive`, by name (`knowledge`, `planner`, `store`, ...).

        Raises:
            UnknownNameError: a bundle is not there.
            InputError: two bundles contradict each other; and as for an `Executive`.
        """
        found = gathered(bundles)
        return cls(domain_of(found), [*plots_of(found), *plots], [*components_of(found), *components], **how)

    def listen(self, listener: Listener) -> None:
        """Tell `listener` every record of every run from now on."""
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
            plot: its name.
            arguments: values for its parameters.
            simulated: whether time jumps from event to event; if not, it passes as on the clock on the wall.
            open_ended: whether events may still come from outside (an operator, a user interface) when nothing
                is going on; if not, such a run ends and says so.
            prepare: see `Prepare`.
            header: what is to be found with the run in the store, plain data.

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
        """As `run`, inside an asyncio loop that is there already, e.g. with components that are elsewhere.

        Time is that of the loop: real, or simulated by `run_simulated`.
        """
        clock = LoopClock()
        store = self._run_store({**(header or {}), "simulated": clock.simulated, "open_ended": open_ended})
        sequencer, planning = self._wired(clock, 0, store, open_ended=open_ended)
        if prepare is not None:
            prepare(sequencer)
        return await _to_its_end(sequencer.run(plot, arguments), planning, clock)

    def resume(self, *, prepare: Prepare | None = None) -> RunEnd:
        """Go on with the store's unfinished run where it was broken off, and run it to its end.

        Those who listen hear its records from the beginning. `prepare` is called again; what was handed in to
        come later, and has not come, is kept and need not be handed in again.

        Raises:
            StoreError: there is no store, no unfinished run in it, or it cannot be read or written.
            ChangedError: plots or domain are not those with which it was begun; the error says what is different.
        """
        store, kept = self._taken_up()
        going_on = self._go_on(store, kept, prepare)
        return run_simulated(going_on, kept.time) if kept.run.header["simulated"] else run_real(going_on)

    async def go_on(self, *, prepare: Prepare | None = None) -> RunEnd:
        """As `resume`, inside an asyncio loop that is there already, of the same kind of time as when it was begun.

        Raises:
            InputError: the run was begun in real time and this loop's is simulated, or the other way round.
        """
        store, kept = self._taken_up()
        simulated = LoopClock().simulated
        if simulated != kept.run.header["simulated"]:
            was, now = ("real", "simulated") if simulated else ("simulated", "real")
            raise InputError(f"the run was begun in {was} time and cannot go on in {now} time")
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
        """Plan for a goal, carry the plan out, and plan again when the world disagrees.

        The end is `finished` when the attempt has come to its end, and says whether the goal was `reached`; if not,
        it `emitted` why: `no_plan` or `gave_up`, with the reason.

        Args:
            goal: a condition.
            seconds: real time for each search.
            replans: how often to plan again after the first plan.
            simulated: as for `run`.
            open_ended: as for `run`.
            prepare: as for `run`.

        Raises:
            InputError: the goal is no condition, or names something that is not declared or not known; or a bound is
                no number that makes sense.
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
        """End the planners' processes, if there are any of its own, and give back the store."""
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
        """Itself; `close` at the end."""
        return self

    def __exit__(self, *_: object) -> None:
        """`close`."""
        self.close()


async def _to_its_end(running: Coroutine[Any, Any, RunEnd], planning: PlanningComponent, clock: LoopClock) -> RunEnd:
    with nullcontext() if clock.simulated else settled():
        try:
            return await running
        finally:
            await planning.over()


@cache
def achieve_plot() -> ActionPlot:
    """The plot that stands in where no designed candidate fits; read once, since plots never change."""
    resource = files("planning") / "plots" / "achieve.yaml"
    return parse_plot(resource.read_text(encoding="utf-8"), str(resource))


def _budget(seconds: float, replans: int) -> Budget:
    try:
        return Budget(seconds=seconds, replans=replans)
    except ValidationError as error:
        first = error.errors()[0]
        wrong = f"'{first['loc'][0]}' is {first['input']!r}: {first['msg']}"
        raise InputError(wrong, found=str(first["input"])) from None
