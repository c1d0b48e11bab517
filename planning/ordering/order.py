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
from dataclasses import dataclass, field, replace
from functools import cached_property

from knowledge_base.errors import InputError
from knowledge_base.facts import Fact
from knowledge_base.language.effect import substitute_effect
from knowledge_base.language.evaluation import World, apply_effect, holds
from knowledge_base.language.expression import Expression
from knowledge_base.language.printer import to_text
from knowledge_base.world.overlay import Overlay
from planning.domain import PlanningDomain
from planning.ordering.dependencies import Changes, Ground, Support, changes, conjuncts, favours, support
from planning.plan import Plan, PlanStep
from planning.posing.conditions import Literal
from planning.posing.derived import derivation

PRESENT = 0
"""Who provides what holds already."""


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
        InputError: the plan does not lead to the goal.
    """
    derived = derivation(domain)
    tracing = _Tracing(Overlay(derived.world(world)))
    for number, step in enumerate(plan.steps, start=1):
        tracing.take(number, step, derived.domain)
    for condition in conjuncts(derived.expand(goal), tracing.world):
        tracing.need(len(plan.steps) + 1, condition, "the goal")
    pairs = {(first, second) for first, second in tracing.pairs if PRESENT < first < second <= len(plan.steps)}
    return PartialOrder(plan.steps, tuple(dict.fromkeys(tracing.links)), reduced(pairs))


def standing(
    links: Iterable[CausalLink], done: Collection[int], begun: Collection[int]
) -> tuple[CausalLink, ...]:
    """The links whose facts have to hold now: all who bring them about are done, who needs them has not begun."""
    waiting = [link for link in links if link.user not in begun]
    coming = {(link.fact, link.user) for link in waiting if link.provider not in {PRESENT, *done}}
    return tuple(link for link in waiting if (link.fact, link.user) not in coming)


def reduced(pairs: Iterable[tuple[int, int]]) -> frozenset[tuple[int, int]]:
    """The pairs (the smaller number first) that do not follow from others."""
    direct: dict[int, set[int]] = defaultdict(set)
    for first, second in pairs:
        direct[second].add(first)
    earlier: dict[int, int] = {}  # sets of numbers as bits
    kept: set[tuple[int, int]] = set()
    for number in sorted(direct):
        covered = 0
        for one in sorted(direct[number], reverse=True):  # what is before it has a smaller number
            if not covered >> one & 1:
                kept.add((one, number))
                covered |= earlier.get(one, 0) | 1 << one
        earlier[number] = covered
    return frozenset(kept)


@dataclass(slots=True)
class _Tracing:
    """A plan carried out in thought; remembers who made what, and who relied on it.

    Attributes:
        world: the state reached.
        links, pairs: what was found so far.
        since: the step that made a fact what it is; without one, it was so from the beginning.
        makers: the steps that make a literal true.
        setters: the steps that change a number, and whether they only add to it.
        moves: by how much a step made a number greater.
        users: the steps that rely on a literal or a number.
    """

    world: Overlay
    links: list[CausalLink] = field(default_factory=list)
    pairs: set[tuple[int, int]] = field(default_factory=set)
    since: dict[Literal, int] = field(default_factory=dict)
    makers: dict[Literal, list[int]] = field(default_factory=lambda: defaultdict(list))
    setters: dict[Ground, list[tuple[int, bool]]] = field(default_factory=lambda: defaultdict(list))
    moves: dict[tuple[Fact, int], float] = field(default_factory=dict)
    users: dict[Ground, list[int]] = field(default_factory=lambda: defaultdict(list))

    def take(self, number: int, step: PlanStep, domain: PlanningDomain) -> None:
        """Step number `number` comes next."""
        action, bindings = domain.action(step), domain.bindings(step)
        ground = domain.ground(step)
        effect = ground.effect
        if action.timed is None:
            doing = changes(effect, self.world)
        else:
            start, end = (substitute_effect(e, bindings) for e in (action.timed.start_effect, action.timed.end_effect))
            doing = changes(end, self.world, after=start)
        needed = conjuncts(ground.condition, self.world)
        asked = (one for one in doing.conditions if holds(one, self.world, {}))  # else its own start brings it about
        for condition in dict.fromkeys((*needed, *asked)):
            self.need(number, condition, str(step))
        for fluent in doing.reads:
            self._rely(number, fluent)
        self._change(number, doing)
        if action.timed is None and not doing.numbers:
            self.world.apply(doing.delta())
            return
        made = apply_effect(effect, self.world)
        for fluent, now in made.values.items():
            before = self.world.value(fluent.predicate, fluent.args)
            if isinstance(now, int | float) and isinstance(before, int | float):
                self.moves[fluent, number] = now - before
        self.world.apply(made)

    def need(self, user: int, condition: Expression, whose: str) -> None:
        """A step, or the goal, needs a ground condition now."""
        found = support(condition, self.world, self._latest)
        if found is None:
            raise InputError(f"the plan does not lead to the goal: {whose} needs {to_text(condition)}")
        if not found:  # nothing can change it
            return
        providers = {one for ground in found for one in self._providers(ground) if self._helps(one, ground, condition)}
        self.links += [CausalLink(one, condition, user) for one in sorted(providers - {PRESENT} or {PRESENT})]
        for ground in found:
            self._rely(user, ground)

    def _rely(self, user: int, ground: Ground) -> None:
        self.pairs.update((provider, user) for provider in self._providers(ground))
        self.users[ground].append(user)

    def _change(self, number: int, doing: Changes) -> None:
        for literal in doing.makes:
            opposite = literal.negated
            rivals = (*self.users[opposite], *self.makers[opposite])
            self.pairs.update((rival, number) for rival in rivals if rival != number)
        for literal in doing.makes:
            self.makers[literal].append(number)
            fact = literal.fact
            if literal.negated in doing.makes or self.world.holds(fact.predicate, fact.args) is not literal.positive:
                self.since[literal] = number
        for fluent, adds in doing.numbers.items():
            others = [setter for setter, also_adds in self.setters[fluent] if not (adds and also_adds)]
            self.pairs.update((other, number) for other in (*self.users[fluent], *others) if other != number)
            self.setters[fluent].append((number, adds))

    def _providers(self, ground: Ground) -> tuple[int, ...]:
        if isinstance(ground, Literal):
            return (self.since.get(ground, PRESENT),)
        return tuple(setter for setter, _ in self.setters[ground]) or (PRESENT,)

    def _helps(self, provider: int, ground: Ground, condition: Expression) -> bool:
        """Whether the condition owes something to the provider: who uses up fuel does not provide what is left."""
        if isinstance(ground, Literal) or provider == PRESENT or not all(adds for _, adds in self.setters[ground]):
            return True
        good = favours(condition, ground, self.world)
        return good is None or good * self.moves.get((ground, provider), 0.0) > 0

    def _latest(self, found: Support) -> int:
        return max((provider for ground in found for provider in self._providers(ground)), default=PRESENT)
