"""The partial order of a plan's steps, with its causal links; few control flows for it, and purposes of steps.

A *causal link*: a step, or the present, establishes a condition that a later step, or the goal, needs (Tate 1977,
*Generating project networks*).

Few control flows are a minimum chain cover (Dilworth 1950), found by matching (Fulkerson 1956).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from knowledge_base.language.syntax.expression import Expression
from knowledge_base.language.syntax.text import to_text
from planning.plan import Plan, PlanStep

PRESENT = 0
"""The provider of facts that hold initially."""


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
            found[number] = frozenset(direct).union(*[found[one] for one in direct])
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
    return reduction(direct)


def reduction(direct: Mapping[int, int]) -> frozenset[tuple[int, int]]:
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


@dataclass(frozen=True, slots=True)
class Purpose:
    """The purpose of a step in a plan.

    Attributes:
        number: the step's number, counted from 1.
        step: the step.
        provides: the conditions that it establishes, each with the later step that needs it; `None` is the goal.
        serves: the conditions of the goal that it contributes to, directly or through later steps.
    """

    number: int
    step: PlanStep
    provides: tuple[tuple[Expression, int | None], ...]
    serves: tuple[Expression, ...]

    def __str__(self) -> str:
        """Text such as `3 (pick-up cup1 table): (holding cup1) for step 4; serves (tidy cup1)`."""
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
    """Return the purpose of step `number`, from its causal links."""
    goal = len(order.steps) + 1
    own = [link for link in order.links if link.provider == number]
    provides = tuple((link.fact, None if link.user == goal else link.user) for link in own)
    return Purpose(number, order.steps[number - 1], provides, _served(order.links, number, goal))


def _served(links: tuple[CausalLink, ...], number: int, goal: int) -> tuple[Expression, ...]:
    reached, before = {number}, 0
    while before != len(reached):  # along a time line, a later step may provide for an earlier one
        before = len(reached)
        reached |= {link.user for link in links if link.provider in reached}
    return tuple(dict.fromkeys(link.fact for link in links if link.provider in reached and link.user == goal))


Kin = Callable[[int, int], bool]
"""Returns whether two steps should share a chain, e.g. because one robot takes both."""


def chains(earlier: Mapping[int, frozenset[int]], kin: Kin) -> tuple[tuple[int, ...], ...]:
    """Return the fewest chains that contain each step once, ordered by their first steps.

    A chain is a sequence of steps each of which ends before the next begins. Among the covers with the fewest chains,
    the result extends a maximum matching of kin.

    Args:
        earlier: for each step in order, the steps that end before it begins.
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
    """A matching of steps with their direct predecessors; `follow` extends it along an augmenting path."""

    def __init__(self, earlier: Mapping[int, frozenset[int]]) -> None:
        self.before: dict[int, int] = {}
        self._after: dict[int, int] = {}
        self._earlier = {number: sorted(those, reverse=True) for number, those in earlier.items()}

    def follow(self, second: int, kin: Kin) -> None:
        """Give a step a direct predecessor if it has none and the matching allows one."""
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
