"""The plots of plans: the necessary order of a plan's steps, laid out as a chart."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from knowledge_base.language.syntax.expression import Expression
from planning.execution.plan_run import PlanRun
from planning.generation.plan_to_plot import laid_out, plot_of
from planning.model.plan import Plan
from planning.ordering.causal_tracing import deordered
from planning.ordering.partial_order import PartialOrder, in_sequence
from planning.ordering.timed_links import linked

if TYPE_CHECKING:
    from dsc.dynamic.library import Library
    from knowledge_base.store import KnowledgeBase
    from planning.problem.derived import Derivation


@dataclass(frozen=True, slots=True)
class Plotting:
    """Generator of the plots of plans.

    Attributes:
        derivation: the derivation of the planning domain.
        library: the plots that implement planning actions, and the plots whose rules are inherited.
        knowledge: the knowledge base with the present world.
        parallel: whether independent steps are executed in parallel.
        shared: names of components that can execute several skills concurrently.
    """

    derivation: Derivation
    library: Library
    knowledge: KnowledgeBase
    parallel: bool
    shared: Collection[str]

    def plotted(
        self,
        run: PlanRun,
        plan: Plan,
        known: PartialOrder | None = None,
        instead_of: str | None = None,
        running: int = 0,
    ) -> tuple[PartialOrder, dict[str, Any]]:
        """Return the partial order of a plan's steps and the plot of the plan as data; set the order of `run.progress`.

        Args:
            run: the plan in execution.
            plan: the steps, possibly with a schedule.
            known: the partial order of the steps; this method computes the order if `known` is omitted.
            instead_of: the candidate that the first step must try last.
            running: the number of first steps that are running already, in parallel.
        """
        order = self._order(plan, run.goal, known)
        if running:
            order = order.begun(running)
        rules = self.library.plot(run.holder).rules if run.holder in self.library else ()
        plan = Plan(plan.steps)
        layout = laid_out(plan, run.progress.domain, self.library, rules, order, self.shared)
        run.progress.take_order(layout.before)
        plot = plot_of(plan, layout, run.name, watched=True, labels=run.labels, running=running)
        self.library.expect(plot)
        form = plot.to_form()
        if instead_of is not None:
            state: Any = form
            for key in next(path for name, _, path in plot.walk() if name == "step_1"):
                state = state[key]
            state["dynamic"].sort(key=lambda name: name == instead_of)  # stable: the other candidates keep their order
            state.pop("choose", None)  # by order
        return order, form

    def _order(self, plan: Plan, goal: Expression, known: PartialOrder | None) -> PartialOrder:
        if plan.schedule:
            return linked(plan, self.derivation.original, self.knowledge, goal)
        order = known or deordered(plan, self.derivation.original, self.knowledge, goal)
        return order if self.parallel else replace(order, before=in_sequence(plan).before)
