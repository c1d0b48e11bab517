"""Plotting makes the plot that executes a plan."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from planning.generation.plan_to_plot import laid_out, plot_of
from planning.ordering.partial_order import PartialOrder, deordered, in_sequence
from planning.ordering.timed_links import linked
from planning.plan import Plan

if TYPE_CHECKING:
    from collections.abc import Collection

    from dsc.dynamic.library import Library
    from dsc.model.plot import ActionPlot
    from knowledge_base.language.syntax.expression import Expression
    from knowledge_base.store import KnowledgeBase
    from planning.execution.plan_run import PlanRun
    from planning.problem.derived import Derivation


@dataclass(frozen=True, slots=True)
class Plotting:
    """Makes plots of plans.

    Attributes:
        derivation: of the planning domain.
        library: plots that implement its actions, and the holders whose rules are inherited.
        knowledge: the world that a plan is for.
        parallel: whether independent steps run in parallel.
        shared: names of components that can execute several skills concurrently.
    """

    derivation: Derivation
    library: Library
    knowledge: KnowledgeBase
    parallel: bool
    shared: Collection[str]

    def order(self, plan: Plan, goal: Expression, known: PartialOrder | None = None) -> PartialOrder:
        """Return which steps wait for which: `known`, if given."""
        if plan.schedule:
            return linked(plan, self.derivation.original, self.knowledge, goal)
        order = known or deordered(plan, self.derivation.original, self.knowledge, goal)
        return order if self.parallel else replace(order, before=in_sequence(plan).before)

    def form(self, run: PlanRun, order: PartialOrder, instead_of: str | None = None) -> dict[str, Any]:
        """Return the plot as data; its first step tries the candidate `instead_of` last.

        The progress of the plan takes over the order of the plot.
        """
        rules = self.library.plot(run.holder).rules if run.holder in self.library else ()
        plan, domain = Plan(run.progress.steps), run.progress.domain
        layout = laid_out(plan, domain, self.library, rules, order, self.shared)
        run.progress.take_in_order(layout.before)
        plot = plot_of(plan, layout, run.name, watched=True)
        self.library.expect(plot)
        form = plot.to_form()
        if instead_of is not None:
            _put_last(instead_of, _state(plot, form, "step_1")["dynamic"])
        return form


def _state(plot: ActionPlot, form: dict[str, Any], name: str) -> dict[str, Any]:
    """Return the form of a state inside the form of its plot."""
    path = next(path for own, _, path in plot.walk() if own == name)
    found: Any = form
    for key in path:
        found = found[key]
    state: dict[str, Any] = found
    return state


def _put_last(candidate: str, candidates: list[str]) -> None:
    candidates.sort(key=lambda name: name == candidate)  # the others stay in their order
