"""Everything wired together: a domain, plots, skills, knowledge and a planner, ready to run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Self

from pydantic import ValidationError

from dsc.dynamic.library import Library
from dsc.dynamic.selection import ACHIEVE
from dsc.model.plot import ActionPlot
from dsc.model.states import Budget
from dsc.sequencer.clock import LoopClock, run_real, run_simulated
from dsc.sequencer.sequencer import RunEnd, Sequencer
from dsc.skills import Component, signatures
from dsc.text.plots import parse_plot
from dsc.trace import Listener, Trace
from dsc.validation import raise_findings, validate_library
from knowledge_base.compatibility import require_extension
from knowledge_base.errors import InputError, SchemaError
from knowledge_base.language.parser import parse_condition
from knowledge_base.store import KnowledgeBase
from planning.domain import PlanningDomain
from planning.engines.cache import CachingPlanner
from planning.engines.planner import Planner, PlannerProcess
from planning.engines.race import PlannerRace
from planning.execution.component import PlanningComponent
from planning.execution.foresight import Foresight
from planning.fragments import shipped_by
from planning.implementations import check_implementations
from planning.posing.problem import check_goal

Prepare = Callable[[Sequencer], None]
"""Called before a run starts, e.g. to post events or to keep the sequencer at hand."""
_BUDGET = Budget()


class Executive:
    """A robot program that can be run.

    Args:
        domain: the planning domain, or the PDDL file it is in, which the components may add to; the knowledge
            base's schema declares all that these do.
        plots: the plots; those with `implements` carry out the domain's planning actions.
        components: the skills.
        knowledge: the world model; an empty one of the domain's schema if left out.
        planner: finds plans; if left out, pyperplan in simulated time, so that a run can be repeated, and in real
            time the engines that suit a problem, in a race.
        parallel: whether steps of a plan that need not wait for each other are carried out side by side.
        foresight: tries out plans in a simulation before they are carried out.

    Raises:
        PlotError: a plot does not pass the validator; the error has all findings.
        InputError: a domain file is wrong, two fragments contradict each other, or two plots have one name.
        SchemaMismatchError: the given world model does not know what the domain is about.
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
    ) -> None:
        self.components = tuple(components)
        self.domain = PlanningDomain.from_fragments([domain, *shipped_by(self.components)])
        _refuse_namesakes(self.components)
        self.knowledge = knowledge if knowledge is not None else KnowledgeBase(self.domain.schema)
        require_extension(self.domain.schema, self.knowledge.schema)
        self.library = Library(plots)
        if ACHIEVE not in self.library:
            self.library.add(achieve_plot())
        self._own_planners: dict[bool, CachingPlanner] = {}
        self._planner = planner
        self._parallel = parallel
        self._foresight = foresight
        self._listeners: list[Listener] = []
        skills = [s for c in self.components for s in c.skills().values()]
        skills += signatures(PlanningComponent, PlanningComponent.name).values()
        declared = {PlanningComponent.name: {}, **{c.name: c.declares for c in self.components}}
        findings = validate_library(self.library, self.domain.schema, skills, declared)
        raise_findings([*findings, *check_implementations(self.library, self.domain)])

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
    ) -> RunEnd:
        """Run a plot to its end.

        Args:
            plot: its name.
            arguments: values for its parameters.
            simulated: whether time jumps from event to event; if not, it passes as on the clock on the wall.
            open_ended: whether events may still come from outside (an operator, a user interface) when nothing
                is going on; if not, such a run ends and says so.
            prepare: see `Prepare`.

        Raises:
            InputError: the plot is unknown, or a parameter is missing or unknown.
        """
        runner = run_simulated if simulated else run_real
        return runner(self.execute(plot, arguments or {}, prepare, open_ended=open_ended))

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

    async def execute(
        self, plot: str, arguments: Mapping[str, Any], prepare: Prepare | None = None, *, open_ended: bool = False
    ) -> RunEnd:
        """As `run`, inside a loop that is there already."""
        clock = LoopClock()
        trace = Trace(clock.now)
        for listener in self._listeners:
            trace.listen(listener)
        components: list[Component] = list(self.components)
        sequencer = Sequencer(self.library, self.knowledge, components, clock, trace, open_ended=open_ended)
        planning = PlanningComponent(
            self.domain, self.library, self.knowledge, self._planner_for(clock), clock, trace,
            working_for=sequencer.working_for, parallel=self._parallel,
            shared=[component.name for component in components if component.concurrent],
            foresight=self._foresight,
        )  # fmt: skip
        sequencer.listen(planning.note_choices)
        sequencer.dispatcher.deploy(planning)
        if prepare is not None:
            prepare(sequencer)
        return await sequencer.run(plot, arguments)

    def close(self) -> None:
        """End the planners' processes, if there are any of its own."""
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


def _refuse_namesakes(components: Iterable[Component]) -> None:
    names = {PlanningComponent.name}
    for component in components:
        if component.name in names:
            raise SchemaError(f"two components are named '{component.name}'", found=component.name)
        names.add(component.name)
