r"""Generation of plots from plans; a step becomes a dynamic state whose candidates implement it (S0.12, S1.5, S2.7).

        before_1 -> step_1 -> after_1 -> step_2 -> after_2 -> ... -> finished
               \-> replan, if a condition of a step does not hold

Independent steps are in parallel regions (`planning.generation.control_flow`). Each region contains a chain of the
plan's partial order, usually the steps of one robot. An outcome without an inherited rule leads to `replan`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise

from dsc.dynamic.library import Library
from dsc.events import GAVE_UP, SKILL_FAILURES
from dsc.model.plot import ActionPlot
from dsc.model.rules import CONTINUE, ENTER, REPLAN, RETRY, Rule
from planning.generation.carried_steps import CarriedStep, Carrier, Usage, sketched
from planning.generation.control_flow import FINISHED, ControlFlow, Writer, passed
from planning.model.domain import PlanningDomain
from planning.model.plan import Plan, PlanStep
from planning.ordering.partial_order import PartialOrder, chains, in_sequence, scheduled
from planning.problem.derived import derivation

WORK = "work"
"""The name of the state with the parallel regions."""


@dataclass(frozen=True, slots=True)
class Layout:
    """The arrangement of a plan's steps as states of a plot.

    Attributes:
        steps: the steps with everything that their states need.
        order: the partial order, extended by pairs of steps that use one component.
        lanes: the chains of steps; several chains become parallel regions.
        rules: the inherited rules that can apply to steps of the plan.
    """

    steps: Sequence[CarriedStep]
    order: PartialOrder
    lanes: Sequence[ControlFlow]
    rules: Sequence[Rule]

    @property
    def before(self) -> frozenset[tuple[int, int]]:
        """Pairs of steps; the first step of a pair is done, or skipped, when the second begins."""
        return self.order.before.union(*(pairwise(lane.numbers) for lane in self.lanes))

    def labelled(self, labels: Sequence[int]) -> Layout:
        """Return the layout with labels instead of the numbers from 1, in its order and lanes."""

        def pairs(numbers: Iterable[tuple[int, int]]) -> frozenset[tuple[int, int]]:
            return frozenset((labels[first - 1], labels[second - 1]) for first, second in numbers)

        order = replace(self.order, before=pairs(self.order.before), begin_before=pairs(self.order.begin_before))
        lanes = [replace(one, numbers=tuple([labels[n - 1] for n in one.numbers])) for one in self.lanes]
        return replace(self, order=order, lanes=lanes)


def laid_out(
    plan: Plan,
    domain: PlanningDomain,
    library: Library | None,
    rules: Sequence[Rule],
    order: PartialOrder | None,
    shared: Collection[str],
) -> Layout:
    """Return the layout of a plan; for the arguments see `plot_from_plan`."""
    if order is None:
        order = scheduled(plan) if plan.schedule else in_sequence(plan)
    domain = derivation(domain).domain  # the knowledge base does not evaluate derived predicates
    rules = [own for rule in rules if (own := _inherit(rule, plan)) is not None]
    writing = None if library is None else Carrier.of(domain, library, rules)
    steps = [sketched(step, domain) if writing is None else writing.carried(step) for step in plan.steps]
    order = order.restricted(_clashes([step.usage for step in steps], order, shared))
    outcomes = SKILL_FAILURES.union(*(step.outcomes for step in steps))
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
    """Return the action plot that executes a plan.

    Args:
        plan: the steps. If the plan has a schedule, steps begin in the order of the schedule and may overlap as in the
            schedule.
        domain: the planning domain.
        library: the plots that implement the planning actions. Without a library the result is a sketch to complete, in
            which every step uses a plot with the name and arguments of its action.
        rules: the contingency rules that the plot inherits.
        name: the name of the plot.
        order: the partial order of the steps, e.g. from `ordering.partial_order.deordered`; by default a sequence.
        shared: components that can execute several skills concurrently. Steps that use another common component never
            overlap.

    Raises:
        UnknownNameError: no plot implements the action of a step.
    """
    layout = laid_out(plan, domain, library, rules, order, shared)
    return plot_of(plan, layout, name, watched=library is not None)


def plot_of(
    plan: Plan, layout: Layout, name: str, *, watched: bool, labels: Sequence[int] = (), running: int = 0
) -> ActionPlot:
    """Return the plot of a layout.

    Args:
        plan: the steps.
        layout: their arrangement.
        name: the name of the plot.
        watched: whether states report the progress to the planning component.
        labels: the number of each step in the names of states; by default, the steps count from 1.
        running: the number of first steps that are running already, in a plot that this plot replaces.
    """
    labels = labels or range(1, len(plan.steps) + 1)
    layout = layout.labelled(labels)
    steps, lanes, rules = layout.steps, layout.lanes, layout.rules
    omitted = [
        label for label, step in zip(labels, plan.steps, strict=True) if any(_omits(rule, step) for rule in rules)
    ]
    continuations = tuple(chain.from_iterable(rule.continuations for rule in rules))
    retried = any(one.then in {RETRY, ENTER} for one in continuations)
    leading = {one.outcome: dict.fromkeys(one.do.passed, "symbol") for one in continuations if one.leads_away}
    writer = Writer(
        dict(zip(labels, steps, strict=True)), layout.order, lanes, name if watched else None, omitted, leading,
        retried=retried, running=labels[:running],
    )  # fmt: skip
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


def _inherit(rule: Rule, plan: Plan) -> Rule | None:
    """Return the rule restricted to the steps of this plan; `None` if it applies to none of them."""
    if not rule.steps:
        return rule
    done = {step.action for step in plan.steps}
    key = "of" if rule.on is not None else rule.place
    named = tuple(name for name in rule.steps if name in done)
    return rule.model_copy(update={key: named}) if named else None


def _omits(rule: Rule, step: PlanStep) -> bool:
    return step.action in rule.before and rule.then == CONTINUE


def _clashes(used: Sequence[Usage], order: PartialOrder, shared: Collection[str]) -> Iterable[tuple[int, int]]:
    """Yield unordered pairs of steps that use one component."""
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
