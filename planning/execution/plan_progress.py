"""Progress of a plan: done, running and remaining steps, and whether the remaining steps lead to the goal.

A local repair keeps the end of a broken plan, and plans only a short sequence of steps before that end.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import Any

from knowledge_base.errors import InputError
from knowledge_base.language.evaluation.evaluator import holds
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.expression import And, Atom, Constant, Expression
from knowledge_base.world.overlay import Overlay
from planning.analysis.validation import validate
from planning.execution.plan_ends import leads_to, shortest_end
from planning.execution.regression import CausalNeeds
from planning.model.cancellable_work import WorkLimit
from planning.model.domain import PlanningDomain
from planning.model.plan import Plan, PlanStep
from planning.model.problem import Problem
from planning.problem.construction import build_problem
from planning.problem.derived import derivation

_MOST_RUNNING = 3
"""The largest number of running steps for which each subset is tried as done; beyond it, only none and all."""
MOST_LONGER = 2
"""The number of steps by which a repaired plan may be longer than the remaining plan."""
_MOST_UNMET = 3
"""The largest number of unmet conditions with which a repair keeps an end of a plan."""
_MOST_OMITTED = 2
"""The largest number of first steps that a repair may replace."""
_MOST_THINNED = 60
"""The largest number of steps of a repaired plan from which useless steps are removed, in quadratic time."""


def is_true(e: Expression, world: World) -> bool:
    """Return whether the condition is true; a condition about a missing object is false."""
    try:
        return holds(e, world)
    except InputError:
        return False


def thinned(steps: Sequence[PlanStep], domain: PlanningDomain, world: World, goal: Expression) -> tuple[PlanStep, ...]:
    """Return the plan without useless steps, by action elimination (Nakhost & Müller 2010).

    A step is removed, together with the steps that need it, if the other steps still reach the goal. If `steps` lead to
    the goal, the result does too.
    """
    kept, number = tuple(steps), 0
    while number < len(kept):
        without = (*kept[:number], *_possible(kept[:number], kept[number + 1 :], domain, world))
        if leads_to(without, domain, world, goal):
            kept = without
        else:
            number += 1
    return kept


def _possible(
    first: Iterable[PlanStep], then: Iterable[PlanStep], domain: PlanningDomain, world: World
) -> Iterator[PlanStep]:
    """Yield the steps of `then` that are applicable one after the other, after all steps of `first`."""
    ahead = Overlay(world)
    for step in first:
        ahead.apply(domain.effects(step, ahead))
    for step in then:
        if domain.applicable(step, ahead):
            ahead.apply(domain.effects(step, ahead))
            yield step


class PlanProgress:
    """The done, running and remaining steps of a plan, by their numbers from 1.

    A plot never begins a step too early. A step therefore counts as done, or omitted by a rule, when a step that must
    follow it has begun.

    Args:
        steps: the steps of the plan.
        domain: the planning domain, with derived predicates expanded.
        goal: the goal of the plan, with derived predicates expanded.
        before: pairs of steps; the first step of a pair must be done when the second begins. By default the steps are
            a sequence.

    Attributes:
        running: the steps that have begun, except those that are certainly done.
        remaining: the steps that are not done, including the running ones, in an executable order.
        early: whether another author has caused an effect of a later step, so that steps may be useless.
    """

    def __init__(
        self,
        steps: Sequence[PlanStep],
        domain: PlanningDomain,
        goal: Expression,
        before: AbstractSet[tuple[int, int]] | None = None,
    ) -> None:
        self.steps = tuple(steps)
        self.goal = goal
        self.domain = domain
        self._needs = CausalNeeds(self.steps, domain, goal)
        self._before = before
        self._begun: set[int] = set()
        self._done: set[int] = set()
        self.running: tuple[int, ...] = ()
        self.remaining = tuple(range(1, len(self.steps) + 1))
        self.early = False

    def to_json(self) -> dict[str, Any]:
        """Return steps, order and the numbers of the begun steps as plain data; the done steps follow from these."""
        before = None if self._before is None else sorted(map(list, self._before))
        steps = [step.to_json() for step in self.steps]
        return {"steps": steps, "before": before, "begun": sorted(self._begun), "early": self.early}

    @classmethod
    def from_json(cls, form: Mapping[str, Any], domain: PlanningDomain, goal: Expression) -> PlanProgress:
        """Return the progress that `to_json` wrote as `form`, with conditions expanded for the present world."""
        before = None if form["before"] is None else {(first, second) for first, second in form["before"]}
        progress = cls([PlanStep.from_json(step) for step in form["steps"]], domain, goal, before)
        for number in form["begun"]:
            progress.begin(number)
        progress.early = form["early"]
        return progress

    def renewed(self, domain: PlanningDomain, goal: Expression) -> PlanProgress:
        """Return an equal progress with conditions expanded for another state of the world."""
        progress = PlanProgress(self.steps, domain, goal, self._before)
        for number in self._begun:
            progress.begin(number)
        return progress

    def after_running(self) -> PlanProgress:
        """Return an equal progress in which all running steps are done."""
        progress = self.renewed(self.domain, self.goal)
        progress.end_running()
        return progress

    def end_running(self) -> None:
        """Record that all running steps are done."""
        self.remaining, self._done = self._after(self.running), self._done | set(self.running)
        self.running = ()

    def withdraw(self, number: int) -> None:
        """Record that a running step was interrupted, and has not begun."""
        self._begun.discard(number)
        self.running = tuple([one for one in self.running if one != number])

    def take_order(self, before: AbstractSet[tuple[int, int]]) -> None:
        """Replace the order of the steps; valid only before the first step begins."""
        self._before = before

    def begin(self, number: int) -> None:
        """Record that a step begins; the steps that must end before it are then done."""
        self._begun.add(number)
        agenda = [number]
        while agenda:
            later = agenda.pop()
            earlier = self._earlier(later) - self._done
            self._done |= earlier
            agenda += earlier
        self.running = tuple(sorted(self._begun - self._done))
        self.remaining = self._after(self._done)

    def _earlier(self, later: int) -> set[int]:
        if self._before is None:
            return set(range(1, later))
        return {first for first, second in self._before if second == later}

    @property
    def remaining_steps(self) -> tuple[PlanStep, ...]:
        """The plan steps with the numbers in `remaining`."""
        return self.steps_of(self.remaining)

    def needed(self) -> Mapping[Expression, int] | None:
        """Return the conditions that must hold now, with the first user of each; `None` if regression is not possible.

        The effects of a running step may already hold. The conditions therefore include the needs of later steps.
        """
        return self._needs.before(self.remaining)

    def needed_by(self, numbers: tuple[int, ...]) -> Mapping[Expression, int] | None:
        """Return the conditions of `needed` as if only the steps with these numbers remained, in this order."""
        return self._needs.before(numbers)

    def steps_of(self, numbers: Iterable[int]) -> tuple[PlanStep, ...]:
        """Return the plan steps with these numbers."""
        return tuple([self.steps[number - 1] for number in numbers])

    def needed_later(self) -> Mapping[Expression, int] | None:
        """Return the conditions of `needed` as if all running steps were done."""
        return self._needs.before(self._after(self.running))

    def is_valid(self, world: World) -> bool:
        """Return whether the plan reaches the goal from `world`, with any subset of the running steps done."""
        return any(leads_to(steps, self.domain, world, self.goal) for steps in self._ways_on())

    def shortest_end(self, world: World) -> tuple[PlanStep, ...] | None:
        """Return the fewest last steps that lead to the goal from `world`, for any subset of the running steps done."""
        ends = (shortest_end(steps, self.domain, world, self.goal) for steps in self._ways_on())
        return min((end for end in ends if end is not None), key=len, default=None)

    def coming(self) -> tuple[PlanStep, ...]:
        """Return the steps that have not begun."""
        return self.steps_of(self.coming_numbers())

    def coming_numbers(self) -> tuple[int, ...]:
        """Return the numbers of the steps that have not begun."""
        return self._after(self.running)

    def _ways_on(self) -> Iterator[tuple[PlanStep, ...]]:
        """Return the step sequences that may remain, one for each choice of running steps that are done."""
        running = self.running
        sizes = range(len(running) + 1) if len(running) <= _MOST_RUNNING else (0, len(running))
        finished = itertools.chain.from_iterable(itertools.combinations(running, size) for size in sizes)
        return (self.steps_of(self._after(done)) for done in finished)

    def _after(self, done: Iterable[int]) -> tuple[int, ...]:
        gone = set(done)
        return tuple([number for number in self.remaining if number not in gone])


@dataclass(frozen=True, slots=True)
class LocalRepair:
    """The end of a plan to keep, and the problem of making this end applicable again."""

    end: tuple[PlanStep, ...]
    problem: Problem

    def repaired(
        self, first: Plan, before: Sequence[PlanStep], domain: PlanningDomain, world: World, goal: Expression
    ) -> Plan | None:
        """Return the plan of the solution `first` and the kept end; `None` if this plan is invalid or too long.

        The plan contains no useless steps, unless it is long.
        """
        steps = (*first.steps, *self.end)
        short = len(steps) <= len(before) + MOST_LONGER
        if not short or not validate(Plan(steps), domain, world, goal).valid:
            return None
        return Plan(thinned(steps, domain, world, goal) if len(steps) <= _MOST_THINNED else steps)


def local_repair(
    before: PlanProgress,
    excluded: AbstractSet[PlanStep],
    domain: PlanningDomain,
    world: World,
    goal: Expression,
    patience: WorkLimit | None = None,
) -> LocalRepair | None:
    """Return the repair of a plan with the fewest steps to keep and conditions to restore; `None` without a repair.

    The problem of the repair is to restore the conditions that the kept end of the plan needs.

    Args:
        before: the plan, with its done, running and remaining steps.
        excluded: steps that the repair must omit.
        domain: the planning domain.
        world: the present world.
        goal: the goal of the plan.
        patience: the limit of the work.

    Raises:
        WorkLimitError: the limit has passed.
    """
    derived = derivation(domain)
    closed, left = (
        derived.world(world),
        before.remaining,
    )  # read only once, since the plan may continue during the repair
    if derived.recursive:  # the conditions in `before` belong to another state of the world
        before = before.renewed(derived.domain, derived.expand(goal))
    ends = (left[first:] for first in range(min(_MOST_OMITTED + 1, len(left))))
    needs = [(before.steps_of(end), before.needed_by(end)) for end in ends]
    truths: dict[int, bool] = {}
    gaps = [
        (end, needed, _unmet(needed, closed, truths))
        for end, needed in needs
        if needed is not None and excluded.isdisjoint(end)
    ]
    near = [(end, needed, gap) for end, needed, gap in gaps if len(gap) <= _MOST_UNMET]
    if not near:
        return None
    # Of equal ends, the shortest leaves most to the planner, which then finds no detour to an abandoned place.
    end, needed, gap = min(near, key=lambda one: (len(one[0]) + len(one[2]), len(one[0])))
    if not all(map(derived.may_change, gap)):
        return None
    try:
        problem = build_problem(domain, world, And(tuple(needed)), patience=patience)
    except InputError:  # a problem cannot have these conditions as its goal
        return None
    return None if problem.unreachable else LocalRepair(end, problem)


def _unmet(needed: Iterable[Expression], world: World, known: dict[int, bool]) -> list[Expression]:
    """Return the conditions that are false in `world`, at most one more than `_MOST_UNMET`.

    `known` caches truth values by identity, since the ends of a plan share most of their conditions.
    """
    unmet: list[Expression] = []
    for one in needed:
        if id(one) not in known:
            known[id(one)] = _true(one, world)
        if not known[id(one)]:
            unmet.append(one)
            if len(unmet) > _MOST_UNMET:
                break
    return unmet


def _true(condition: Expression, world: World) -> bool:
    if isinstance(condition, Atom) and condition.predicate in world.schema.predicates:
        args = [term.value for term in condition.args if isinstance(term, Constant)]
        if len(args) == len(condition.args) and condition.predicate not in world.schema.computed:
            return world.holds(
                condition.predicate, tuple(args)
            )  # a shortcut for ground facts, the most frequent conditions
    return is_true(condition, world)
