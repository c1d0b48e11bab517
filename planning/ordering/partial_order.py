"""Causal links of a plan, and the partial order that follows from them (S1.5).

A *causal link*: a step, or the present, establishes a condition that a later step, or the goal, needs (Tate 1977,
*Generating project networks*).

*De-ordering* keeps only the ordered pairs of the plan with a reason (Bäckström 1998, *Computational aspects of
reordering plans*). The reasons:

- Link: a step needs a condition that an earlier step establishes.
- Threat: a later step falsifies a condition that an earlier step needs.
- Conflict: one step makes a fact true that the other makes false, or both change a number and do not commute.

Every linearization then takes the same steps to the same end. A fact that a step both deletes and adds counts as false
in between, so that two such steps never overlap.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from knowledge_base.language.evaluation.world import World
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.language.syntax.text import to_text
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
    """Step `provider` (0: the present) establishes a condition of step `user` (one past the last: the goal).

    `fact` is a ground literal if the condition can be split that far; a disjunction or comparison is one condition. If
    several steps establish it together, each has a link, and the condition holds after the last of them.
    """

    provider: int
    fact: Expression
    user: int

    def __str__(self) -> str:
        """Text such as `1 -(holding cup)-> 3`."""
        return f"{self.provider} -{to_text(self.fact)}-> {self.user}"


@dataclass(frozen=True)
class PartialOrder:
    """A plan whose steps are ordered only where there is a reason.

    Attributes:
        steps: in the order of the plan, which is one of the linearizations; numbered from 1.
        links: the causal links.
        before: pairs of steps of which the first ends before the second begins, without pairs that follow from others
            (the transitive reduction).
        begin_before: pairs of steps of which the first begins before the second does; they may overlap.
    """

    steps: tuple[PlanStep, ...]
    links: tuple[CausalLink, ...] = ()
    before: frozenset[tuple[int, int]] = frozenset()
    begin_before: frozenset[tuple[int, int]] = frozenset()

    @cached_property
    def waits_for(self) -> Mapping[int, tuple[int, ...]]:
        """Step -> the steps that it waits for directly, in order."""
        direct: dict[int, list[int]] = {number: [] for number in range(1, len(self.steps) + 1)}
        for first, second in sorted(self.before):
            direct[second].append(first)
        return {number: tuple(earlier) for number, earlier in direct.items()}

    @cached_property
    def earlier(self) -> Mapping[int, frozenset[int]]:
        """Step -> all steps that end before it begins, in order (the transitive closure)."""
        found: dict[int, frozenset[int]] = {}
        for number, direct in self.waits_for.items():
            found[number] = frozenset(direct).union(*(found[one] for one in direct))
        return found

    def restricted(self, pairs: Iterable[tuple[int, int]]) -> PartialOrder:
        """Return the order with more ordered pairs, the first step of each also first in the plan."""
        return replace(self, before=reduced({*self.before, *pairs}))


def in_sequence(plan: Plan) -> PartialOrder:
    """Return the total order of the steps."""
    return PartialOrder(plan.steps, before=frozenset((n, n + 1) for n in range(1, len(plan.steps))))


def scheduled(plan: Plan) -> PartialOrder:
    """Return the order of the plan's schedule: steps that end before others begin, and the order of the starts."""
    timed = list(enumerate(plan.schedule, start=1))
    ends = {(i, j) for j, later in timed for i, earlier in timed[: j - 1] if earlier.end <= later.start}
    order = PartialOrder(plan.steps, before=reduced(ends))
    last = {j: max((one.start for one in plan.schedule if one.start < now.start), default=None) for j, now in timed}
    begun = {(i, j) for j in last for i, one in timed if one.start == last[j] and i not in order.earlier[j]}
    return replace(order, begin_before=frozenset(begun))


def causal_links(plan: Plan, domain: PlanningDomain, world: World, goal: Expression) -> tuple[CausalLink, ...]:
    """Return the causal links of a plan from `world` to the goal, by user.

    The plan leads to the goal as long as all of them hold.

    Raises:
        InputError: the plan does not lead to the goal.
    """
    return deordered(plan, domain, world, goal).links


def deordered(plan: Plan, domain: PlanningDomain, world: World, goal: Expression) -> PartialOrder:
    """Return the plan without ordered pairs that have no reason.

    Every linearization leads from `world` to the goal. The result is not always the least such order, which is NP-hard
    to find.

    Raises:
        InputError: the plan does not lead to the goal; `planning.validation.validate` returns the step and the reason.
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
    """Return the links whose facts must hold now: all their providers are done, and their users have not begun."""
    waiting = [link for link in links if link.user not in begun]
    coming = {(link.fact, link.user) for link in waiting if link.provider not in {PRESENT, *done}}
    return tuple(link for link in waiting if (link.fact, link.user) not in coming)


def reduced(pairs: Iterable[tuple[int, int]]) -> frozenset[tuple[int, int]]:
    """Return the pairs (the smaller number first) that do not follow from others."""
    direct: dict[int, int] = defaultdict(int)
    for first, second in pairs:
        direct[second] |= 1 << first
    return _reduced(direct)


def _reduced(direct: Mapping[int, int]) -> frozenset[tuple[int, int]]:
    """Return the transitive reduction; `direct` has for each step the steps before it, as bits."""
    earlier: dict[int, int] = {}
    kept: list[tuple[int, int]] = []
    for number in sorted(direct):
        open_, covered = direct[number], 0
        while open_:
            one = open_.bit_length() - 1  # its predecessors have smaller numbers
            kept.append((one, number))
            covered |= earlier.get(one, 0) | 1 << one
            open_ &= ~covered
        earlier[number] = covered
    return frozenset(kept)
