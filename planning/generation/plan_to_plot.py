r"""From plan to plot: every step a dynamic state over the plots that carry it out (S0.12, S1.5, S2.7).

    before_1 -> step_1 -> after_1 -> step_2 -> after_2 -> ... -> finished
                            \-> replan, if what a step needs does not hold

Independent steps stand in regions side by side (`planning.generation.control_flow`); a region is a
chain of the plan's partial order, which is as a rule what one robot does. Outcomes that no inherited rule answers
lead to `replan`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from dsc.events import FAILURES, GAVE_UP
from dsc.model.plot import ActionPlot
from dsc.model.rules import CONTINUE, REPLAN, Rule
from planning.generation.carried_steps import CarriedStep, Carrier, Usage, sketched
from planning.generation.control_flow import FINISHED, ControlFlow, Writer, passed
from planning.ordering.chains import chains
from planning.ordering.partial_order import PartialOrder, in_sequence, scheduled
from planning.problem.derived import derivation

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from dsc.dynamic.library import Library
    from planning.domain import PlanningDomain
    from planning.plan import Plan, PlanStep

WORK = "work"
"""Name of the state that holds the regions."""


@dataclass(frozen=True, slots=True)
class Layout:
    """How the steps of a plan are spread.

    Attributes:
        steps: ready to become states.
        order: which of them wait for which, also since they use the same component.
        lanes: the chains that they stand in.
        rules: those that the plot inherits, as far as they are about its steps.
    """

    steps: Sequence[CarriedStep]
    order: PartialOrder
    lanes: Sequence[ControlFlow]
    rules: Sequence[Rule]

    @property
    def before(self) -> frozenset[tuple[int, int]]:
        """Pairs of steps of which the first is done, or left out, when the second begins."""
        return self.order.before.union(*(pairwise(lane.numbers) for lane in self.lanes))


def laid_out(
    plan: Plan,
    domain: PlanningDomain,
    library: Library | None,
    rules: Sequence[Rule] = (),
    order: PartialOrder | None = None,
    shared: Collection[str] = (),
) -> Layout:
    """How the plot of a plan will carry it out; the arguments are those of `plot_from_plan`."""
    if order is None:
        order = scheduled(plan) if plan.schedule else in_sequence(plan)
    domain = derivation(domain).domain  # the knowledge base knows no derived predicates
    rules = [own for rule in rules if (own := _inherited(rule, plan)) is not None]
    writing = None if library is None else Carrier.of(domain, library, rules)
    steps = [sketched(step, domain) if writing is None else writing.carried(step) for step in plan.steps]
    order = order.restricted(_clashes([step.usage for step in steps], order, shared))
    outcomes = FAILURES.union(*(step.outcomes for step in steps))
    answering = [rule for rule in rules if rule.on is None or rule.on in outcomes]
    return Layout(steps, order, _lanes(order, steps), answering)


def plot_from_plan(
    plan: Plan,
    domain: PlanningDomain,
    library: Library | None,
    rules: Sequence[Rule] = (),
    name: str = "plan",
    order: PartialOrder | None = None,
    shared: Collection[str] = (),
) -> ActionPlot:
    """The action plot that carries out a plan.

    Args:
        plan: its steps; with a schedule they begin in its order, and side by side where it has them so.
        domain: gives each step's precondition and effects.
        library: has the plots that implement the planning actions. Without one, a sketch is made for somebody to
            complete: every step uses a plot that is called like its action and takes all of its arguments.
        rules: the contingency rules it inherits.
        name: the plot's name.
        order: which steps wait for which, e.g. from `ordering.order.deordered`; one after the other if left out.
        shared: components that can carry out several skills at once. Steps that use any other one never overlap.

    Raises:
        UnknownNameError: no plot implements a step's action.
    """
    layout = laid_out(plan, domain, library, rules, order, shared)
    return plot_of(plan, layout, name, watched=library is not None)


def plot_of(plan: Plan, layout: Layout, name: str, *, watched: bool) -> ActionPlot:
    """The plot of a plan that is laid out; `watched`: the planner's component hears how far it is."""
    steps, lanes, rules = layout.steps, layout.lanes, layout.rules
    left_out = [n for n, step in enumerate(plan.steps, start=1) if any(_leaves_out(rule, step) for rule in rules)]
    leading = {rule.outcome: dict.fromkeys(rule.do.passed, "symbol") for rule in rules if rule.leads_away}
    writer = Writer(steps, layout.order, lanes, name if watched else None, left_out, leading)
    ends = {FINISHED: {"final": True}}
    if len(lanes) == 1:
        states = {**writer.states(lanes[0]), **ends}
    else:
        regions = {lane.name: {"states": {**writer.states(lane), lane.finished: {"final": True}}} for lane in lanes}
        states = {WORK: {"regions": regions, "on": {"done": FINISHED}}, **ends}
    return ActionPlot.model_validate(
        {
            "plot": name,
            "about": f"made from a plan of {len(steps)} steps",
            "variables": {
                "reason": {"type": "text", "initial": "unknown"},
                **writer.variables,
                **{passed(name): kind for handed_out in leading.values() for name, kind in handed_out.items()},
            },
            "emits": {REPLAN: {"reason": "text"}, GAVE_UP: {"reason": "text"}, **leading},
            "states": states,
            "rules": rules,
            "generated": True,
        }
    )


def _inherited(rule: Rule, plan: Plan) -> Rule | None:
    """The rule as far as it is about steps of this plan."""
    if not rule.steps:
        return rule
    done = {step.action for step in plan.steps}
    key = "of" if rule.on is not None else rule.place
    named = tuple(name for name in rule.steps if name in done)
    return rule.model_copy(update={key: named}) if named else None


def _leaves_out(rule: Rule, step: PlanStep) -> bool:
    return step.action in rule.before and rule.then == CONTINUE


def _clashes(used: Sequence[Usage], order: PartialOrder, shared: Collection[str]) -> Iterable[tuple[int, int]]:
    """The pairs of steps that have nothing to do with each other but the components they use."""
    for second, earlier in order.earlier.items():
        for first in range(1, second):
            if first not in earlier and used[first - 1].clashes(used[second - 1], shared):
                yield first, second


def _lanes(order: PartialOrder, steps: Sequence[CarriedStep]) -> list[ControlFlow]:
    linked = {(link.provider, link.user) for link in order.links}

    def kin(first: int, second: int) -> bool:
        one, other = steps[first - 1].usage.components, steps[second - 1].usage.components
        return one == other if one and other else (first, second) in linked

    found = chains(order.earlier, kin) or ((),)
    if len(found) == 1:
        return [ControlFlow(found[0])]
    names = ["_".join(sorted({name for n in chain for name in steps[n - 1].usage.components})) for chain in found]
    return [
        ControlFlow(chain, f"_{number}", name if name and names.count(name) == 1 else f"lane_{number}")
        for number, (chain, name) in enumerate(zip(found, names, strict=True), start=1)
    ]
