"""The plot that a plan is carried out with."""

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
    from knowledge_base.language.expression import Expression
    from knowledge_base.store import KnowledgeBase
    from planning.execution.carried import Carried
    from planning.problem.derived import Derivation


@dataclass(frozen=True, slots=True)
class Plotting:
    """Makes plots of plans.

    Attributes:
        derivation: of the planning domain.
        library: plots that implement its actions, and the holders whose rules are inherited.
        knowledge: the world that a plan is for.
        parallel: whether steps that need not wait for each other are carried out side by side.
        shared: names of components that can carry out several skills at once.
    """

    derivation: Derivation
    library: Library
    knowledge: KnowledgeBase
    parallel: bool
    shared: Collection[str]

    def order(self, plan: Plan, goal: Expression, known: PartialOrder | None = None) -> PartialOrder:
        """Which steps wait for which; `known` if that was found out already."""
        if plan.schedule:
            return linked(plan, self.derivation.original, self.knowledge, goal)
        order = known or deordered(plan, self.derivation.original, self.knowledge, goal)
        return order if self.parallel else replace(order, before=in_sequence(plan).before)

    def form(self, carried: Carried, order: PartialOrder, instead_of: str | None = None) -> dict[str, Any]:
        """The plot as data; its first step is done rather not with the candidate `instead_of`.

        The plan's course learns in which order the plot takes the steps.
        """
        rules = self.library.plot(carried.holder).rules if carried.holder in self.library else ()
        plan, domain = Plan(carried.course.steps), carried.course.domain
        layout = laid_out(plan, domain, self.library, rules, order, self.shared)
        carried.course.take_in_order(layout.before)
        plot = plot_of(plan, layout, carried.name, watched=True)
        self.library.expect(plot)
        form = plot.to_form()
        if instead_of is not None:
            _put_last(instead_of, _state(plot, form, "step_1")["dynamic"])
        return form


def _state(plot: ActionPlot, form: dict[str, Any], name: str) -> dict[str, Any]:
    """The form of a state, wherever it stands in the plot's."""
    path = next(path for own, _, path in plot.walk() if own == name)
    found: Any = form
    for key in path:
        found = found[key]
    state: dict[str, Any] = found
    return state


def _put_last(candidate: str, candidates: list[str]) -> None:
    candidates.sort(key=lambda name: name == candidate)  # the others stay in their order
