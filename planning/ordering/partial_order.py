"""The partial order of a plan's steps, with causal links, chains of steps, and the purpose of each step.

A *causal link* connects the provider of a condition with its user (Tate 1977, *Generating project networks*). The
provider is a step or the present world; the user is a later step or the goal.

The steps are divided into the fewest chains (Dilworth 1950), found by matching (Fulkerson 1956).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from knowledge_base.language.syntax.expression import Expression
from knowledge_base.language.syntax.text import to_text
from planning.model.plan import Plan, PlanStep

PRESENT = 0
"""The provider number of facts that hold initially."""


@dataclass(frozen=True, slots=True)
class CausalLink:
    """A condition that step `provider` establishes and step `user` needs.

    `provider` 0 is the present world, and a `user` one past the last step is the goal. `fact` is a ground literal if
    the condition can be divided into literals; a disjunction or comparison is one condition. If several steps together
    establish a condition, each of them has a link, and the condition holds after the last of them.
    """

    provider: int
    fact: Expression
    user: int

    def __str__(self) -> str:
        """Return the link as text, e.g. `1 -(holding cup)-> 3`."""
        return f"{self.provider} -{to_text(self.fact)}-> {self.user}"


@dataclass(frozen=True)
class PartialOrder:
    """A plan in which two steps are ordered only for a reason.

    Attributes:
        steps: the steps, numbered from 1; their order in the plan is one of the linearizations.
        links: the causal links.
        before: pairs of steps; the first step of a pair must end before the second begins. Pairs that follow from other
            pairs are omitted (the transitive reduction).
        begin_before: pairs of steps; the first step of a pair must begin before the second begins, and both may
            overlap.
    """

    steps: tuple[PlanStep, ...]
    links: tuple[CausalLink, ...] = ()
    before: frozenset[tuple[int, int]] = frozenset()
    begin_before: frozenset[tuple[int, int]] = frozenset()

    @cached_property
    def waits_for(self) -> Mapping[int, tuple[int, ...]]:
        """The steps for which each step waits directly, in order."""
        direct: dict[int, list[int]] = {number: [] for number in range(1, len(self.steps) + 1)}
        for first, second in sorted(self.before):
            direct[second].append(first)
        return {number: tuple(earlier) for number, earlier in direct.items()}

    @cached_property
    def earlier(self) -> Mapping[int, frozenset[int]]:
        """All steps that end before each step begins (the transitive closure)."""
        found: dict[int, frozenset[int]] = {}
        for number, direct in self.waits_for.items():
            found[number] = frozenset(direct).union(*[found[one] for one in direct])
        return found

    def restricted(self, pairs: Iterable[tuple[int, int]]) -> PartialOrder:
        """Return the order with additional pairs; the first step of each pair must also come first in the plan."""
        return replace(self, before=reduced({*self.before, *pairs}))

    def begun(self, count: int) -> PartialOrder:
        """Return the order in which the first `count` steps, which have begun already, wait for no other step."""
        before = {(first, second) for second, earlier in self.earlier.items() if second > count for first in earlier}
        begin = frozenset(pair for pair in self.begin_before if min(pair) > count)
        return replace(self, before=reduced(before), begin_before=begin)


def in_sequence(plan: Plan) -> PartialOrder:
    """Return the total order of the plan's steps."""
    return PartialOrder(plan.steps, before=frozenset((n, n + 1) for n in range(1, len(plan.steps))))


def scheduled(plan: Plan) -> PartialOrder:
    """Return the order of a plan with a schedule: steps that end before others begin, and the order of the starts."""
    timed = list(enumerate(plan.schedule, start=1))
    ends = {(i, j) for j, later in timed for i, earlier in timed[: j - 1] if earlier.end <= later.start}
    order = PartialOrder(plan.steps, before=reduced(ends))
    last = {j: max((one.start for one in plan.schedule if one.start < now.start), default=None) for j, now in timed}
    begun = {(i, j) for j in last for i, one in timed if one.start == last[j] and i not in order.earlier[j]}
    return replace(order, begin_before=frozenset(begun))


def reduced(pairs: Iterable[tuple[int, int]]) -> frozenset[tuple[int, int]]:
    """Return the pairs that do not follow from other pairs; each pair must have the smaller number first."""
    direct: dict[int, int] = defaultdict(int)
    for first, second in pairs:
        direct[second] |= 1 << first
    return reduction(direct)


def reduction(direct: Mapping[int, int]) -> frozenset[tuple[int, int]]:
    """Return the transitive reduction; `direct` contains, for each step, the steps before it as bits."""
    earlier: dict[int, int] = {}
    kept: list[tuple[int, int]] = []
    for number in sorted(direct):
        open_, covered = direct[number], 0
        while open_:
            one = open_.bit_length() - 1  # the highest bit; predecessors of a step have smaller numbers
            kept.append((one, number))
            covered |= earlier.get(one, 0) | 1 << one
            open_ &= ~covered
        earlier[number] = covered
    return frozenset(kept)


@dataclass(frozen=True, slots=True)
class Purpose:
    """The purpose of a step in a plan.

    Attributes:
        number: the number of the step, counted from 1.
        step: the plan step.
        provides: the conditions that the step establishes, each with the later step that needs it; `None` is the goal.
        serves: the conditions of the goal to which the step contributes, directly or through later steps.
    """

    number: int
    step: PlanStep
    provides: tuple[tuple[Expression, int | None], ...]
    serves: tuple[Expression, ...]

    def __str__(self) -> str:
        """Return text, e.g. `3 (pick-up cup1 table): (holding cup1) for step 4; serves (tidy cup1)`."""
        if not self.provides:
            return f"{self.number} {self.step}: nothing needs what it does"
        users: dict[str, list[str]] = {}
        for fact, user in self.provides:
            users.setdefault("the goal" if user is None else f"step {user}", []).append(to_text(fact))
        said = "; ".join(f"{' '.join(facts)} for {user}" for user, facts in users.items())
        direct = {fact for fact, user in self.provides if user is None}
        further = [to_text(fact) for fact in self.serves if fact not in direct]
        return f"{self.number} {self.step}: {said}" + (f"; serves {' '.join(further)}" if further else "")


def why(order: PartialOrder, number: int) -> Purpose:
    """Return the purpose of the step with this number, computed from the causal links."""
    goal = len(order.steps) + 1
    own = [link for link in order.links if link.provider == number]
    provides = tuple((link.fact, None if link.user == goal else link.user) for link in own)
    return Purpose(number, order.steps[number - 1], provides, _find_served(order.links, number, goal))


def _find_served(links: tuple[CausalLink, ...], number: int, goal: int) -> tuple[Expression, ...]:
    reached, before = {number}, 0
    while before != len(reached):  # in a schedule, a later step may provide for an earlier step
        before = len(reached)
        reached |= {link.user for link in links if link.provider in reached}
    return tuple(dict.fromkeys(link.fact for link in links if link.provider in reached and link.user == goal))


Kin = Callable[[int, int], bool]
"""Returns whether two steps should be in one chain, e.g. because one robot executes both."""


def chains(earlier: Mapping[int, frozenset[int]], kin: Kin) -> tuple[tuple[int, ...], ...]:
    """Return the fewest chains that together contain each step exactly once, ordered by their first steps.

    In a chain, each step ends before the next step begins. The search first matches as many pairs that satisfy `kin` as
    possible, and then extends this matching by other pairs.

    Args:
        earlier: for each step, in order, the steps that end before it begins.
        kin: see `Kin`.
    """
    matching = _Matching(earlier)
    for relatives in (kin, _any_pair):
        for second in earlier:
            matching.follow(second, relatives)
    following = {first: second for second, first in matching.before.items()}
    return tuple(_chain(first, following) for first in earlier if first not in matching.before)


def _any_pair(_first: int, _second: int) -> bool:
    return True


def _chain(first: int, following: Mapping[int, int]) -> tuple[int, ...]:
    chain = [first]
    while chain[-1] in following:
        chain.append(following[chain[-1]])
    return tuple(chain)


class _Matching:
    """A matching of steps with their direct predecessors, extended along augmenting paths."""

    def __init__(self, earlier: Mapping[int, frozenset[int]]) -> None:
        self.before: dict[int, int] = {}
        self._after: dict[int, int] = {}
        self._earlier = {number: sorted(those, reverse=True) for number, those in earlier.items()}

    def follow(self, second: int, kin: Kin) -> None:
        """Match a step with a direct predecessor, if the step has none and the matching allows one."""
        if second not in self.before:
            self._augment(second, kin, set())

    def _augment(self, second: int, kin: Kin, tried: set[int]) -> bool:
        for first in self._earlier[second]:
            if first in tried or not kin(first, second):
                continue
            tried.add(first)
            other = self._after.get(first)
            if other is None or self._augment(other, kin, tried):
                self.before[second], self._after[first] = first, second
                return True
        return False
