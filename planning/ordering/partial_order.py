"""What the steps of a plan do for each other, and which need not wait for each other (S1.5).

A *causal link* says that a step (or the present) brings about a condition that a later step (or the goal) needs
(Tate 1977, *Generating project networks*). *De-ordering* keeps of the plan's order only what has a reason
(Bäckström 1998, *Computational aspects of reordering plans*); the reasons are

    a step needs what an earlier one brings about            (the link)
    a later step undoes what an earlier one needs             (the threat to it)
    one makes true what the other makes false, or both set one number in ways that do not commute

so that every linearisation takes the same steps to the same end. A fact that a step deletes and adds is taken to be
false in between: two such steps never overlap.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from knowledge_base.language.evaluation import World
from knowledge_base.language.expression import Expression
from knowledge_base.language.printer import to_text
from planning.domain import PlanningDomain
from planning.ordering.causal_tracing import PRESENT, CausalTrace
from planning.plan import Plan, PlanStep
from planning.problem.derived import derivation

__all__ = [
    "PRESENT", "CausalLink", "PartialOrder", "causal_links", "deordered", "in_sequence", "reduced", "scheduled",
    "standing",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class CausalLink:
    """Step number `provider` (0: the present) brings about a fact that step `user` (one past the last: the goal) needs.

    `fact` is a ground literal wherever the condition can be split that far; what cannot be split (a disjunction, a
    comparison) is one condition. If several steps bring it about together, each has a link, and it holds when the
    last of them is done.
    """

    provider: int
    fact: Expression
    user: int

    def __str__(self) -> str:
        """`1 -(holding cup)-> 3`."""
        return f"{self.provider} -{to_text(self.fact)}-> {self.user}"


@dataclass(frozen=True)
class PartialOrder:
    """A plan whose steps wait for each other only where there is a reason.

    Attributes:
        steps: in the order of the plan, which is one of the linearisations; numbered from 1.
        links: what is brought about, by whom and for whom.
        before: pairs of steps of which the first ends before the second begins; those that follow from others are
            left out (the transitive reduction).
        begin_before: pairs of steps of which the first begins before the second does; they may overlap.
    """

    steps: tuple[PlanStep, ...]
    links: tuple[CausalLink, ...] = ()
    before: frozenset[tuple[int, int]] = frozenset()
    begin_before: frozenset[tuple[int, int]] = frozenset()

    @cached_property
    def waits_for(self) -> Mapping[int, tuple[int, ...]]:
        """For each step, in order, those that it waits for directly."""
        direct: dict[int, list[int]] = {number: [] for number in range(1, len(self.steps) + 1)}
        for first, second in sorted(self.before):
            direct[second].append(first)
        return {number: tuple(earlier) for number, earlier in direct.items()}

    @cached_property
    def earlier(self) -> Mapping[int, frozenset[int]]:
        """For each step, in order, all that end before it begins (the transitive closure)."""
        found: dict[int, frozenset[int]] = {}
        for number, direct in self.waits_for.items():
            found[number] = frozenset(direct).union(*(found[one] for one in direct))
        return found

    def restricted(self, pairs: Iterable[tuple[int, int]]) -> PartialOrder:
        """The same with more pairs of steps in order, the first of each also first in the plan."""
        return replace(self, before=reduced({*self.before, *pairs}))


def in_sequence(plan: Plan) -> PartialOrder:
    """All steps one after the other."""
    return PartialOrder(plan.steps, before=frozenset((n, n + 1) for n in range(1, len(plan.steps))))


def scheduled(plan: Plan) -> PartialOrder:
    """The steps as the plan's schedule has them: what it has end before another begins, and the order of the starts."""
    timed = list(enumerate(plan.schedule, start=1))
    ends = {(i, j) for j, later in timed for i, earlier in timed[: j - 1] if earlier.end <= later.start}
    order = PartialOrder(plan.steps, before=reduced(ends))
    last = {j: max((one.start for one in plan.schedule if one.start < now.start), default=None) for j, now in timed}
    begun = {(i, j) for j in last for i, one in timed if one.start == last[j] and i not in order.earlier[j]}
    return replace(order, begin_before=frozenset(begun))


def causal_links(plan: Plan, domain: PlanningDomain, world: World, goal: Expression) -> tuple[CausalLink, ...]:
    """Who brings about what for whom in a plan that leads from `world` to the goal, by user.

    As long as all of them hold, the plan leads to the goal.

    Raises:
        InputError: the plan does not lead to the goal.
    """
    return deordered(plan, domain, world, goal).links


def deordered(plan: Plan, domain: PlanningDomain, world: World, goal: Expression) -> PartialOrder:
    """The plan without those parts of its order that have no reason.

    Every linearisation of it leads from `world` to the goal. It is not always the least order with that property,
    which is NP-hard to find.

    Raises:
        InputError: the plan does not lead to the goal; `planning.validation.validate` says at which step and why.
    """
    derived = derivation(domain)
    tracing = CausalTrace(derived.world(world))
    for number, step in enumerate(plan.steps, start=1):
        tracing.take(number, step, derived.domain)
    tracing.reach(len(plan.steps) + 1, derived.expand(goal))
    links = tuple(dict.fromkeys(CausalLink(*link) for link in tracing.links))
    steps = {number: bits for number, bits in tracing.earlier.items() if number <= len(plan.steps)}
    return PartialOrder(plan.steps, links, _reduced(steps))


def standing(links: Iterable[CausalLink], done: Collection[int], begun: Collection[int]) -> tuple[CausalLink, ...]:
    """The links whose facts have to hold now: all who bring them about are done, who needs them has not begun."""
    waiting = [link for link in links if link.user not in begun]
    coming = {(link.fact, link.user) for link in waiting if link.provider not in {PRESENT, *done}}
    return tuple(link for link in waiting if (link.fact, link.user) not in coming)


def reduced(pairs: Iterable[tuple[int, int]]) -> frozenset[tuple[int, int]]:
    """The pairs (the smaller number first) that do not follow from others."""
    direct: dict[int, int] = defaultdict(int)
    for first, second in pairs:
        direct[second] |= 1 << first
    return _reduced(direct)


def _reduced(direct: Mapping[int, int]) -> frozenset[tuple[int, int]]:
    """As `reduced`; for each step, those before it as bits."""
    earlier: dict[int, int] = {}
    kept: list[tuple[int, int]] = []
    for number in sorted(direct):
        open_, covered = direct[number], 0
        while open_:
            one = open_.bit_length() - 1  # what is before it has a smaller number
            kept.append((one, number))
            covered |= earlier.get(one, 0) | 1 << one
            open_ &= ~covered
        earlier[number] = covered
    return frozenset(kept)
